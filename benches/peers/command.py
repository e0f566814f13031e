"""Compares whole processes of the command with the C loop, which computes the axes only.

    python3 benches/peers/command.py [--case NAME]... [--rounds 10] [--cpu] [--before PROGRAM]

The time of a command is that of its process from start to end, with reading, contour and orientation errors, and
output. The C loop simulates the same setpoints of the same axes, which it has read before. All run in turns on a core.
The table has, as the median over the rounds, the time relative to the C loop in the same round, and the seconds for an
hour of machine time. With --before another build is measured in the same rounds; with --cpu it is CPU time.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

from run import PROGRAM, ROUND_S, TABLE, TSP, Contender, c_loop, setpoints, shuttles

POINTS = (
    (15, 0, -100, 2, 5),
    (35, 10, -95, 10, 20),
    (45, 35, -90, 20, 45),
    (30, 60, -95, 25, 75),
    (0, 65, -100, 20, 100),
    (-15, 45, -100, 15, 60),
    (-15, 25, -100, 12, 25),
    (0, 0, -100, 0, 0),
)
"""Control points of a closed B-spline of the tool tip in the workpiece, mm and degrees."""
POINT = "      - {{x_mm: {}, y_mm: {}, z_mm: {}, a_deg: {}, c_deg: {}}}\n"
SPLINE = (
    """description: benchmark
frame: workpiece
start: {z_mm: -100}
feed_m_min: 5
rest_s: 0.5
moves:
"""
    + 20 * ("  - spline:\n" + "".join(POINT.format(*row) for row in POINTS))
)
CIRCLES = """description: benchmark
feed_m_min: 15
rest_s: 0.5
moves:
  - arc: {center: {x_mm: -150, y_mm: 0}, turns: 150}
    ramp_s: 0.5
"""
COMMANDS = {
    "setpoints": ("run path.csv", "path", 1),
    "json": ("run path.csv --json", "path", 1),
    "report": ("run path.csv --report out.html", "path", 1),
    "mcap": ("run spline.mcap", "spline", 1),
    "circles": ("run circles.yaml", "circles", 1),
    "ballbar": ("run ballbar", "ballbar", 1),
    "start": ("--version", "ballbar", 1),
    "spline": ("run spline.yaml", "spline", 1),
    "trace-csv": ("run path.csv --trace out.csv", "path", 1),
    "trace-mcap": ("run path.csv --trace out.mcap", "path", 1),
    "trace-tick": ("run spline.yaml --trace tick.mcap --trace-period 125us", "spline", 1),
    "tune": ("tune ballbar --controller gpc", "ballbar", 1090),
    "robustness": ("robustness ballbar", "ballbar", 15),
    "identify": ("identify recording.csv --axis x", "campaign", 1),
}
"""Arguments, setpoints of the C loop, and the number of simulations of these setpoints that the command makes."""


def write_inputs() -> None:
    """Writes the inputs of all commands into the working directory."""
    Path("path.csv").write_text(shuttles(600))
    Path("circles.yaml").write_text(CIRCLES)
    Path("spline.yaml").write_text(SPLINE)
    for words in (
        "psec ballbar --out ballbar.csv",
        "psec circles.yaml --out circles.csv",
        "psec spline.yaml --out spline.csv",
        "psec spline.yaml --out spline.mcap",
        "psec campaign --axis x --out campaign.csv",
        "run campaign.csv --trace recording.csv",
    ):
        process_seconds([PROGRAM, *words.split()], cpu=False)


def process_seconds(command: list[object], cpu: bool) -> float:
    """Runs a command without output; returns wall-clock or CPU time, s."""
    began = time.monotonic()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{command} ended with status {process.returncode}")
    return usage.ru_utime + usage.ru_stime if cpu else time.monotonic() - began


def measure(name: str, programs: dict[str, Path], compiled: str, rounds: int, cpu: bool) -> None:
    """Prints the rows of a command."""
    words, source, simulations = COMMANDS[name]
    text, instants = setpoints(Path(f"{source}.csv"))
    loop = Contender("C loop", [compiled, str(TABLE), text])
    loop.warm_up()
    parts = {"C loop": lambda: loop.time(cpu) * simulations}
    for build, program in programs.items():
        command = [program, *words.split()]
        times = max(1, math.ceil(ROUND_S / process_seconds(command, cpu=False)))
        parts[build] = lambda c=command, n=times: sum(process_seconds(c, cpu) for _ in range(n)) / n
    found: dict[str, list[float]] = {part: [] for part in parts}
    for turn in range(rounds):
        order = list(parts)[turn % len(parts) :] + list(parts)[: turn % len(parts)]
        for part in order:
            found[part].append(parts[part]())
    loop.end()
    for build in programs:
        ratios = [mine / his for mine, his in zip(found[build], found["C loop"], strict=True)]
        hour = statistics.median(found[build]) / (instants * TSP * simulations) * 3600
        spread = f"{min(ratios):.3g} … {max(ratios):.3g}"
        print(f"| {name} | {build} | {statistics.median(ratios):.3g} | {spread} | {hour:.3g} |", flush=True)


def main() -> None:
    """Measures the commands of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", action="append", choices=list(COMMANDS), help="command to measure (default: all)")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--cpu", action="store_true", help="use CPU time in place of wall-clock time")
    parser.add_argument("--before", type=Path, help="another build of the command, measured in the same rounds")
    arguments = parser.parse_args()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    programs = {"now": PROGRAM} | ({"before": arguments.before.resolve()} if arguments.before else {})
    print(
        "| command | build | time, C loop = 1 | range over the rounds | s per simulated hour |\n|---|---|---|---|---|"
    )
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        compiled = c_loop(Path(folder))
        write_inputs()
        for name in arguments.case or COMMANDS:
            measure(name, programs, compiled, arguments.rounds, arguments.cpu)


if __name__ == "__main__":
    main()
