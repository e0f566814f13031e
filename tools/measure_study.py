#!/usr/bin/env python3
"""Measures a sweep on a local Dask cluster against the sweep in one process, and what bounds larger clusters.

    tools/measure_study.py                      # 100 000 predictive controllers on the ballbar, some minutes
    tools/measure_study.py --designs 5000

The cluster has two workers of one thread each, the sweep in one process two threads. The parts of the study alternate
between both, so that other load on the machine strikes both alike. Workers are started and imports done before.

The table of larger clusters is calculated from the measured durations, for a study of ten minutes with results in
Parquet files: its designs, the chunks that `sweep` would choose, the part of the time in which driver and scheduler are
busy, and that of the last chunk of a worker, while others may be idle already.
"""

from __future__ import annotations

import time
from statistics import median

import psutil
from distributed import Client, LocalCluster

import options
import virtual_axes_py as va
from virtual_axes_py import chunks, cluster, study

BOUNDS = {
    f"{axis}.position_loop.gpc.{key}": bounds
    for axis in "xy"
    for key, bounds in {"n2": (8, 20), "nu": (1, 6), "lambda_rel": (0.01, 1.0)}.items()
}
DURATION = 600.0
"""Duration of the study in the table, s."""
SIZE = 256
"""Variants of the chunk whose handling is measured."""


def returned(content: bytes) -> chunks.Produce:
    """Returns a function that has the result of a chunk without a simulation."""
    return lambda setup, first, variants: content


def handling(client: Client, setup: chunks.Setup, designs: study.RandomVariants, count: int) -> float:
    """Returns the time of a chunk that is not simulated, s: driver, scheduler, and less for both workers."""
    content = chunks.simulate_to_parquet(setup, 0, designs[:SIZE])
    parts = [(first, first + 1) for first in range(count)]
    start = time.perf_counter()
    for _ in cluster.run(client, returned(content), setup, designs, parts):
        pass
    return (time.perf_counter() - start) / count


def print_bounds(overhead: cluster.Overhead, handled: float) -> None:
    """Prints the table of larger clusters."""
    print("workers    designs  chunk  driver and scheduler  last chunk")
    for workers in (2, 20, 200):
        designs = int(workers * DURATION / overhead.per_variant)
        size = study.chunk_size(overhead, designs, workers)
        seconds = size * overhead.per_variant
        busy, last = workers * handled / seconds, seconds / DURATION
        print(f"{workers:7}  {designs:9}  {size:5}  {100 * busy:18.1f} %  {100 * last:8.1f} %")
    most = study.CHUNK * overhead.per_variant / handled
    print(f"workers that driver and scheduler can serve, with chunks of {study.CHUNK}: {most:.0f}")


def compare(client: Client, setup: chunks.Setup, designs: study.RandomVariants, parts: int) -> None:
    """Runs the study in one process and on the cluster, and prints rates and ratio."""
    edges = [len(designs) * part // parts for part in range(parts + 1)]
    ways: dict[str, dict] = {"one process, two threads": {"threads": 2}, "two workers of Dask": {"executor": client}}
    times = dict.fromkeys(ways, 0.0)
    for first, end in zip(edges, edges[1:]):
        results = [timed(times, name, setup, designs[first:end], way) for name, way in ways.items()]
        if list(results[0]) != list(results[1]):
            raise SystemExit(f"rows {first} to {end - 1} differ")
    for name, seconds in times.items():
        print(f"{name}: {len(designs)} designs in {seconds:.1f} s, {len(designs) / seconds:.0f}/s")
    one, two = times.values()
    print(f"rows: identical\nratio of the rates, Dask to one process: {one / two:.3f}")


def timed(
    times: dict[str, float], name: str, setup: chunks.Setup, designs: study.RandomVariants, way: dict
) -> va.SweepResults:
    """Runs a part of the study and adds its duration."""
    start = time.perf_counter()
    found = va.sweep(setup.machine, designs, setup.psec, progress=False, **way)
    times[name] += time.perf_counter() - start
    return found


def resident_memory() -> int:
    """Returns the memory of this process, octets."""
    return psutil.Process().memory_info().rss


def main() -> None:
    parser = options.parser(__doc__)
    parser.add_argument("--designs", type=options.whole, default=100_000)
    parser.add_argument("--parts", type=options.whole, default=4, help="parts of the study that alternate")
    arguments = parser.parse_args()
    machine = va.Machine.load()
    machine = machine.with_({f"{axis}.position_loop.controller": "gpc" for axis in machine.axes})
    setup = chunks.Setup(machine, va.scenario("ballbar"), "axes", 1)
    designs = va.random_variants(1, arguments.designs, BOUNDS)
    options_of_cluster = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "dashboard_address": "127.0.0.1:0",
        "host": "127.0.0.1",
    }
    with LocalCluster(**options_of_cluster) as local, Client(local) as client:
        cluster.measure(client, setup, designs[:32])
        overhead = cluster.measure(client, setup, designs[:32], 50)
        print(f"overhead of a chunk, round trip: {1e3 * overhead.per_chunk:.1f} ms")
        print(f"simulation of a variant: {1e3 * overhead.per_variant:.3f} ms of one core")
        handled = median(handling(client, setup, designs, 300) for _ in range(3))
        print(
            f"driver, scheduler and workers, a chunk of {SIZE} that is not simulated: {1e3 * handled:.1f} ms",
            flush=True,
        )
        print_bounds(overhead, handled)
        compare(client, setup, designs, arguments.parts)
        memory = max(client.run(resident_memory).values())
        print(f"memory of a worker: {memory / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
