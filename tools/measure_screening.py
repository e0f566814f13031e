#!/usr/bin/env python3
"""Measures the time to screen tunings, and the speedup by a second core.

    cargo build --release --no-default-features --features cli --bin virtual_axes
    tools/measure_screening.py                          # 100 000 designs on the ballbar
    tools/measure_screening.py --designs 5000 --scenario corner-90

Each stable design of a predictive controller is run on the scenario; the best designs are refined. A machine-second is
a simulated second of one machine with all of its axes.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import options

PROGRAM = Path(__file__).resolve().parent.parent / "target" / "release" / "virtual_axes"


def screen(arguments: argparse.Namespace, designs: int, threads: int) -> float:
    """Screens, prints the duration, and returns the machine-seconds per second."""
    command = [
        str(arguments.program), "tune", arguments.scenario, "--controller", "gpc", "--designs", str(designs),
        "--modulus-margin", "0", "--delay-margin-ms", "0", "--json",
    ]  # fmt: skip
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run(command, env=environment, capture_output=True)
    seconds = time.monotonic() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit status {done.returncode}: {done.stderr.decode(errors='replace').strip()}")
    found = json.loads(done.stdout)
    runs, duration = found["runs"], found["best"]["figures"]["duration_s"]
    core = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    rate = runs * duration / seconds
    print(f"{threads} threads: {found['designs']} designs, {runs} tunings run in {seconds:.1f} s")
    print(f"  {rate:.0f} machine-seconds per second; {core:.1f} s CPU time, ", end="")
    print(f"{runs * duration / core:.0f} machine-seconds per second of one core", flush=True)
    return rate


def main() -> None:
    parser = options.parser(__doc__)
    parser.add_argument("--program", type=Path, default=PROGRAM)
    parser.add_argument("--scenario", default="ballbar")
    parser.add_argument("--designs", type=options.whole, default=100_000)
    parser.add_argument("--part", type=options.whole, default=10, help="divisor of the designs for one core")
    arguments = parser.parse_args()
    if not arguments.program.is_file():
        parser.error(f"there is no {arguments.program}: cargo build --release --bin virtual_axes")
    two = screen(arguments, arguments.designs, 2)
    one = screen(arguments, max(arguments.designs // arguments.part, 1), 1)
    print(f"speedup by a second core: {two / one:.2f}")


if __name__ == "__main__":
    main()
