#!/usr/bin/env python3
"""Measures a sweep on a local Dask cluster against the sweep in one process.

    tools/measure_study.py                      # 100 000 predictive controllers on the ballbar, some minutes
    tools/measure_study.py --designs 5000

The cluster has two workers of one thread each, the sweep in one process two threads. The parts of the study alternate
between both, so that other load on the machine strikes both alike. Workers are started and imports done before.
"""

from __future__ import annotations

import time

from distributed import Client, LocalCluster

import options
import virtual_axes_py as va
from virtual_axes_py import chunks, cluster

BOUNDS = {
    f"{axis}.position_loop.gpc.{key}": bounds
    for axis in "xy"
    for key, bounds in {"n2": (8, 20), "nu": (1, 6), "lambda_rel": (0.01, 1.0)}.items()
}


def main() -> None:
    parser = options.parser(__doc__)
    parser.add_argument("--designs", type=options.whole, default=100_000)
    parser.add_argument("--parts", type=options.whole, default=2)
    arguments = parser.parse_args()
    machine = va.Machine.load()
    machine = machine.with_({f"{axis}.position_loop.controller": "gpc" for axis in machine.axes})
    motion, designs = va.scenario("ballbar"), va.random_variants(1, arguments.designs, BOUNDS)
    edges = [arguments.designs * part // arguments.parts for part in range(arguments.parts + 1)]
    times = {"one process, two threads": 0.0, "two workers of Dask": 0.0}
    options_of_cluster = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1"}
    with LocalCluster(**options_of_cluster) as local, Client(local) as client:
        overhead = cluster.measure(client, chunks.Setup(machine, motion, "axes", 1), designs[:32], 50)
        print(f"overhead of a chunk: {1e3 * overhead.per_chunk:.1f} ms")
        print(f"a variant: {1e3 * overhead.per_variant:.3f} ms of one core", flush=True)
        for first, end in zip(edges, edges[1:]):
            part, results = designs[first:end], []
            for name, how in zip(times, ({"threads": 2}, {"executor": client})):
                start = time.perf_counter()
                results.append(va.sweep(machine, part, motion, progress=False, **how))
                times[name] += time.perf_counter() - start
            if list(results[0]) != list(results[1]):
                raise SystemExit(f"rows {first} to {end - 1} differ")
    for name, seconds in times.items():
        print(f"{name}: {arguments.designs} designs in {seconds:.1f} s, {arguments.designs / seconds:.0f}/s")
    print("rows: identical")
    print(
        "ratio of the rates, Dask to one process: {:.3f}".format(
            times["one process, two threads"] / times["two workers of Dask"]
        )
    )


if __name__ == "__main__":
    main()
