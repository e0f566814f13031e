#!/usr/bin/env python3
"""How time and memory of `virtual_axes run` grow with the length of the set-points.

    cargo build --release
    tools/measure_length.py                        # a minute, ten minutes, an hour, ten hours
    tools/measure_length.py --seconds 60 600 --report --trace
    tools/measure_length.py --write 36000 psec.csv # only the set-points, five axes every 6 ms

A row per length: seconds of the processor (and of the clock, which a busy machine makes longer), times real time,
time per simulated second relative to the first length, largest resident memory, and the length of what was written. `--report` and `--trace` have a page and a trace (at position
instants) written too.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

COMMAND = Path(__file__).resolve().parent.parent / "target" / "release" / "virtual_axes"
LENGTHS = [60, 600, 3600, 36000]
# The position period of the default machine, ms.
PERIOD_MS = 6
# After so many instants, a minute, the motion begins anew: its text is made once.
CYCLE = 10_000
# Amplitude (m, rad) and turns a cycle of the axes: each begins and ends a cycle at rest.
AXES = {"x": (0.1, 6), "y": (0.08, 7), "z": (0.05, 5), "a": (0.3, 3), "c": (0.6, 4)}
MEBIBYTE = 1 << 20


def write_psec(path: Path, seconds: int) -> None:
    """Set-points of so many seconds, with all digits of their numbers."""
    rows = []
    for k in range(CYCLE):
        values = (size * (1.0 - math.cos(math.tau * turns * k / CYCLE)) for size, turns in AXES.values())
        rows.append("".join(f",{value!r}" for value in values) + "\n")
    instants = seconds * 1000 // PERIOD_MS + 1
    with path.open("w", buffering=MEBIBYTE) as file:
        file.write("time," + ",".join(AXES) + "\n")
        for first in range(0, instants, CYCLE):
            count = min(CYCLE, instants - first)
            file.write("".join(f"{(first + i) * PERIOD_MS / 1000!r}{rows[i]}" for i in range(count)))


def run(command: list[str]) -> tuple[float, float, int]:
    """Seconds that it takes, of the processor and of the clock, and the most memory that it holds, bytes."""
    began = time.monotonic()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    took = time.monotonic() - began
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        sys.exit(f"measure_length: {' '.join(command)} ended with {child.returncode}")
    return usage.ru_utime + usage.ru_stime, took, usage.ru_maxrss * 1024


def measure(arguments: argparse.Namespace, folder: Path) -> None:
    first = None
    heads = ["length, s", "processor, s", "clock, s", "× real time", "per s", "memory, MiB", "read, MB", "written, MB"]
    print(" ".join(f"{head:>12}" for head in heads))
    for seconds in arguments.seconds:
        psec = folder / "psec.csv"
        write_psec(psec, seconds)
        command = [str(arguments.command), "run", str(psec)]
        outputs = [folder / "page.html"] * arguments.report + [folder / "trace.csv"] * arguments.trace
        for option, output in zip(["--report"] * arguments.report + ["--trace"] * arguments.trace, outputs):
            command += [option, str(output)]
        took, clock, memory = run(command)
        first = first or took / seconds
        written = ", ".join(f"{output.stat().st_size / 1e6:.2f}" for output in outputs)
        print(
            f"{seconds:12} {took:12.2f} {clock:12.2f} {seconds / took:12.0f} {took / seconds / first:12.2f} "
            f"{memory / MEBIBYTE:12.1f} {psec.stat().st_size / 1e6:12.1f} {written:>12}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--command", type=Path, default=COMMAND, help="the program virtual_axes")
    parser.add_argument("--seconds", type=int, nargs="+", default=LENGTHS, metavar="S", help="lengths of the set-points")
    parser.add_argument("--report", action="store_true", help="write a page, too")
    parser.add_argument("--trace", action="store_true", help="write a trace, too")
    parser.add_argument("--write", nargs=2, metavar=("S", "FILE"), help="write set-points and run nothing")
    arguments = parser.parse_args()
    if arguments.write:
        write_psec(Path(arguments.write[1]), int(arguments.write[0]))
        return
    with tempfile.TemporaryDirectory() as folder:
        measure(arguments, Path(folder))


if __name__ == "__main__":
    main()
