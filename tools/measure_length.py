#!/usr/bin/env python3
"""Measures time and memory of `virtual_axes run` over the length of the setpoints.

    cargo build --release
    tools/measure_length.py                        # a minute, ten minutes, an hour, ten hours
    tools/measure_length.py --seconds 60 600 --report --trace
    tools/measure_length.py --write 36000 psec.csv # only the setpoints, five axes every 6 ms

A row per length: CPU time and wall-clock time in s, ratio to real time, time per simulated second relative to the first
length, maximum resident memory, and the sizes of the input and the outputs. `--report` and `--trace` also write a page
and a trace (at position cycles). With several `--rounds`, which alternate between the lengths, the figures are
medians.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import options

COMMAND = Path(__file__).resolve().parent.parent / "target" / "release" / "virtual_axes"
LENGTHS = [60, 600, 3600, 36000]
# Position cycle of the default machine, ms.
PERIOD_MS = 6
# The motion repeats after this number of instants, a minute: its text is generated once.
CYCLE = 10_000
# Amplitude (m, rad) and periods per minute of the axes: each minute begins and ends at rest.
AXES = {"x": (0.1, 6), "y": (0.08, 7), "z": (0.05, 5), "a": (0.3, 3), "c": (0.6, 4)}
MEBIBYTE = 1 << 20
# Interval between samples of a run's memory, s.
LOOK_EVERY = 0.005


def write_psec(path: Path, seconds: int) -> None:
    """Writes setpoints of this duration, with all digits."""
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


class Run(NamedTuple):
    """Resources and outputs of a run."""

    processor: float  # CPU time, s
    clock: float  # Wall-clock time, s
    memory: int  # Maximum resident memory, bytes
    written: list[int]  # Size of each output, bytes


def resident(pid: int) -> int:
    """Returns the maximum resident memory of a process so far, bytes; 0 after its end."""
    # Not ru_maxrss: its initial value is the size of this interpreter.
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM:")), 0)


def run(command: list[str], outputs: list[Path]) -> Run:
    began = time.monotonic()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    memory = 0
    try:
        while True:
            ended, status, usage = os.wait4(child.pid, os.WNOHANG)
            if ended:
                break
            memory = max(memory, resident(child.pid))
            time.sleep(LOOK_EVERY)
    except BaseException:
        child.kill()
        raise
    clock = time.monotonic() - began
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        sys.exit(f"measure_length: {' '.join(command)} ended with {child.returncode}")
    written = [output.stat().st_size for output in outputs]
    return Run(usage.ru_utime + usage.ru_stime, clock, memory, written)


def measure(arguments: argparse.Namespace, folder: Path) -> None:
    pages = [("--report", folder / "page.html")] * arguments.report
    options_and_files = pages + [("--trace", folder / "trace.csv")] * arguments.trace
    outputs = [output for _, output in options_and_files]
    options = [word for option, output in options_and_files for word in (option, str(output))]
    runs: dict[int, list[Run]] = {seconds: [] for seconds in arguments.seconds}
    read: dict[int, int] = {}
    for _ in range(arguments.rounds):
        for seconds, done in runs.items():
            psec = folder / "psec.csv"
            write_psec(psec, seconds)
            read[seconds] = psec.stat().st_size
            done.append(run([str(arguments.command), "run", str(psec), *options], outputs))
            if len(done) == arguments.rounds:
                row(seconds, done, read[seconds], next(iter(runs.items())))


def row(seconds: int, runs: list[Run], read: int, first: tuple[int, list[Run]]) -> None:
    """Prints the medians of a length's runs; the heading before the first."""
    if seconds == first[0]:
        heads = ["length, s", "processor, s", "clock, s", "× real time", "per s", "memory, MiB"]
        heads += ["read, MB", "written, MB"]
        print(" ".join(f"{head:>12}" for head in heads))
    processor = statistics.median(run.processor for run in runs)
    clock = statistics.median(run.clock for run in runs)
    memory = max(run.memory for run in runs)
    ratio = processor / seconds / (statistics.median(run.processor for run in first[1]) / first[0])
    written = ", ".join(f"{size / 1e6:.2f}" for size in runs[-1].written)
    print(
        f"{seconds:12} {processor:12.2f} {clock:12.2f} {seconds / processor:12.0f} {ratio:12.2f} "
        f"{memory / MEBIBYTE:12.1f} {read / 1e6:12.1f} {written:>12}",
        flush=True,
    )


def main() -> None:
    parser = options.parser(__doc__)
    parser.add_argument("--command", type=Path, default=COMMAND, help="path of the program virtual_axes")
    parser.add_argument(
        "--seconds", type=options.whole, nargs="+", default=LENGTHS, metavar="S", help="lengths of the setpoints"
    )
    parser.add_argument("--report", action="store_true", help="also write a page")
    parser.add_argument("--trace", action="store_true", help="also write a trace")
    parser.add_argument("--rounds", type=options.whole, default=1, metavar="N", help="runs of each length")
    parser.add_argument("--folder", type=Path, help="folder for temporary setpoints and outputs")
    parser.add_argument("--write", nargs=2, metavar=("S", "FILE"), help="write setpoints and run nothing")
    arguments = parser.parse_args()
    if arguments.write:
        try:
            write_psec(Path(arguments.write[1]), options.whole(arguments.write[0]))
        except (argparse.ArgumentTypeError, OSError) as error:
            parser.error(f"--write: {error}")
        return
    if arguments.folder and not arguments.folder.is_dir():
        parser.error(f"--folder: there is no folder {arguments.folder}")
    if not arguments.command.is_file():
        parser.error(f"there is no {arguments.command}: cargo build --release --bin virtual_axes")
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        measure(arguments, Path(folder))


if __name__ == "__main__":
    main()
