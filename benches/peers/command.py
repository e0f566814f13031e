"""Compares whole processes of the command with the C loop, which computes the axes only.

    python3 benches/peers/command.py [--case NAME]... [--rounds 10] [--cpu] [--before PROGRAM] [--program PROGRAM]

Each case is a command of a user: its time is that of the whole process on one core, from start to end, with reading of
the input, contour and orientation error, and output. The C loop (`scalar.c`) simulates the same setpoints of the same
axes; it has read them before and has no contour error. Both run in turns on one core. The table has, as the median over
the rounds, the duration relative to the C loop in the same round, the seconds for an hour of machine time, and the
largest resident memory. With --before another program is measured in the same rounds, for comparison. With --cpu the
time is CPU time, for machines with other load.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import re
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
sys.dont_write_bytecode = True

from cases import POSITION_PERIOD, TABLE, Shuttle  # noqa: E402
from run import ROOT, ROUND_SECONDS, Contender, build  # noqa: E402

JOINTS = ("x", "y", "z", "a", "c")
"""Axes of the default machine."""
HOUR = 3600.0
"""An hour, s."""

SPLINE_POINTS = (
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


@dataclass(frozen=True)
class Command:
    """Command of a user, and the setpoints that the C loop runs."""

    name: str
    words: tuple[str, ...]
    """Arguments; `{folder}` is the folder with the inputs."""
    setpoints: str
    """Name of a CSV file in the folder."""
    runs: float = 1
    """Simulations of these setpoints that the command makes at least."""
    program: Path | None = None
    """Another program than the command; it prints the time that it simulates."""


@dataclass
class Measured:
    """Times (s) of a program over the rounds, and its peak memory (MB)."""

    seconds: list[float] = field(default_factory=list)
    memory: float = 0.0


def shuttles() -> Iterable[tuple[float, ...]]:
    """Returns ten minutes of simultaneous motion of all five axes, one row per position cycle."""
    axes = (
        Shuttle(0.300, 1.9, 315),
        Shuttle(0.250, 1.35, 444),
        Shuttle(0.200, 1.05, 571),
        Shuttle(math.radians(90), 3.1, 193),
        Shuttle(math.radians(270), 4.7, 127),
    )
    return (tuple(axis.at(k * POSITION_PERIOD) for axis in axes) for k in range(round(600 / POSITION_PERIOD)))


def scenario(moves: Iterable[str]) -> str:
    """Returns a scenario file of a tool tip in the workpiece."""
    head = "description: benchmark\nframe: workpiece\nstart: {z_mm: -100}\nfeed_m_min: 5\nrest_s: 0.5\nmoves:\n"
    return head + "".join(moves)


def spline(turns: int) -> str:
    """Returns a scenario file of a closed five-axis B-spline, run several times."""
    rows = "".join(
        "      - {" + ", ".join(f"{key}: {value}" for key, value in zip(KEYS, row, strict=True)) + "}\n"
        for row in SPLINE_POINTS
    )
    return scenario(["  - spline:\n" + rows] * turns)


KEYS = ("x_mm", "y_mm", "z_mm", "a_deg", "c_deg")
"""Keys of a point of a scenario."""

CIRCLES = """description: benchmark
feed_m_min: 15
rest_s: 0.5
moves:
  - arc: {center: {x_mm: -150, y_mm: 0}, turns: 150}
    ramp_s: 0.5
"""
"""The ballbar test with 150 turns."""

STRESS = ROOT / "target/release/virtual_axes_stress"
"""Random trajectories with a check of every tick: `cargo build --release -p virtual_axes_verification`."""

COMMANDS = (
    Command("setpoints", ("run", "{folder}/path.csv"), "path.csv"),
    Command("ballbar", ("run", "ballbar"), "ballbar.csv"),
    # Start of the process only.
    Command("start", ("--version",), "ballbar.csv"),
    Command("circles", ("run", "{folder}/circles.yaml"), "circles.csv"),
    Command("spline", ("run", "{folder}/spline.yaml"), "spline.csv"),
    Command("mcap", ("run", "{folder}/spline.mcap"), "spline.csv"),
    Command("json", ("run", "{folder}/path.csv", "--json"), "path.csv"),
    Command("report", ("run", "{folder}/path.csv", "--report", "{folder}/out.html"), "path.csv"),
    Command("trace-csv", ("run", "{folder}/path.csv", "--trace", "{folder}/out.csv"), "path.csv"),
    Command("trace-mcap", ("run", "{folder}/path.csv", "--trace", "{folder}/out.mcap"), "path.csv"),
    Command(
        "trace-tick",
        ("run", "{folder}/spline.yaml", "--trace", "{folder}/tick.mcap", "--trace-period", "125us"),
        "spline.csv",
    ),
    # The number of simulations that `tune` prints, and the plants of `robustness`.
    Command("tune", ("tune", "ballbar", "--controller", "gpc"), "ballbar.csv", 1090),
    Command("robustness", ("robustness", "ballbar"), "ballbar.csv", 15),
    Command("stress", ("--count", "2000", "--threads", "1"), "path.csv", program=STRESS),
    Command("identify", ("identify", "{folder}/recording.csv", "--axis", "x"), "campaign.csv"),
)
"""Commands by name; the first column of docs/internals/performance.md."""


def write_inputs(folder: Path, program: str) -> None:
    """Writes the inputs of all commands."""
    with (folder / "path.csv").open("w") as file:
        file.write("time," + ",".join(JOINTS) + "\n")
        for k, row in enumerate(shuttles()):
            file.write(",".join(map(repr, (k * POSITION_PERIOD, *row))) + "\n")
    (folder / "circles.yaml").write_text(CIRCLES)
    (folder / "spline.yaml").write_text(spline(20))
    for source in ("ballbar", folder / "circles.yaml", folder / "spline.yaml"):
        target = folder / (Path(source).stem + ".csv")
        quietly(program, "psec", str(source), "--out", str(target))
    quietly(program, "psec", str(folder / "spline.yaml"), "--out", str(folder / "spline.mcap"))
    campaign, recording = str(folder / "campaign.csv"), str(folder / "recording.csv")
    quietly(program, "psec", "campaign", "--axis", "x", "--out", campaign)
    quietly(program, "run", campaign, "--trace", recording)


def quietly(*command: str) -> None:
    """Runs a command without its output."""
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def c_loop(folder: Path, name: str, program: str) -> Contender:
    """Returns the C loop for the setpoints of a CSV file."""
    with (folder / name).open() as file:
        rows = [row[1:] for row in csv.reader(file)]
    text = folder / (Path(name).stem + ".txt")
    text.write_text("\n".join(" ".join(row) for row in rows) + "\n")
    return Contender(name, [program, str(TABLE), str(text)])


def of_program(command: Command, setpoints: float) -> Command:
    """Returns a command whose runs of `setpoints` (s) are those of the time that its program simulates."""
    if command.program is None:
        return command
    done = subprocess.run([command.program, *command.words], check=True, capture_output=True, text=True)
    found = re.search(r"^simulated time: ([\d.]+) s", done.stdout, re.MULTILINE)
    if found is None:
        sys.exit(f"{command.program.name}: prints no simulated time")
    return replace(command, runs=float(found[1]) / setpoints)


def rows_of(folder: Path, name: str) -> int:
    """Returns the number of setpoints of a CSV file."""
    with (folder / name).open() as file:
        return sum(1 for _ in file) - 1


def timed(usage: str, command: list[str], cpu: bool, measured: Measured) -> float:
    """Runs a command and returns its duration, s."""
    done = subprocess.run([usage, *command], stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)}: exit status {done.returncode}: {done.stderr.strip()}")
    wall, used, memory = map(float, done.stdout.split())
    measured.memory = max(measured.memory, memory / 1024)
    return used if cpu else wall


def measure(
    command: Command, folder: Path, programs: dict[str, str], loop: Contender, usage: str, rounds: int, cpu: bool
) -> dict[str, Measured]:
    """Measures a command and the C loop in turns."""
    found = {name: Measured() for name in ("C loop", *programs)}

    def run_loop(_: Measured) -> float:
        return loop.time(cpu) * command.runs

    def run_program(name: str) -> Callable[[Measured], float]:
        words = [word.format(folder=folder) for word in command.words]
        once = timed(usage, [programs[name], *words], cpu, Measured())
        times = max(1, math.ceil(ROUND_SECONDS / once)) if once < ROUND_SECONDS else 1
        return lambda kept: sum(timed(usage, [programs[name], *words], cpu, kept) for _ in range(times)) / times

    loop.runs = 1
    loop.runs = max(1, math.ceil(ROUND_SECONDS / loop.run(1)["seconds"]))
    parts = {"C loop": run_loop, **{name: run_program(name) for name in programs}}
    for turn in range(rounds):
        names = list(parts)
        shift = turn % len(names)
        for name in names[shift:] + names[:shift]:
            found[name].seconds.append(parts[name](found[name]))
    return found


def row_of(command: Command, name: str, found: dict[str, Measured], simulated: float) -> str:
    """Returns a row of the table."""
    mine, his = found[name].seconds, found["C loop"].seconds
    ratios = [a / b for a, b in zip(mine, his, strict=True)]
    ratio = statistics.median(ratios)
    cells = (
        command.name,
        name,
        f"{ratio:.3g}",
        f"{min(ratios):.3g} … {max(ratios):.3g}",
        f"{statistics.median(mine) / simulated * HOUR:.3g}",
        f"{found[name].memory:.0f} MB",
    )
    return "| " + " | ".join(cells) + " |"


def main() -> int:
    """Measures the cases of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [command.name for command in COMMANDS]
    parser.add_argument("--case", action="append", choices=names, help="command to measure (default: all)")
    parser.add_argument("--rounds", type=int, default=10, help="rounds; at least 10 for published figures")
    parser.add_argument("--cpu", action="store_true", help="use CPU time in place of wall-clock time")
    parser.add_argument("--program", default=str(ROOT / "target/release/virtual_axes"), help="the command")
    parser.add_argument("--before", help="another build of the command, measured in the same rounds")
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)), help="core that everything runs on")
    arguments = parser.parse_args()
    if arguments.rounds < 1:
        parser.error("--rounds: must be at least 1")
    os.sched_setaffinity(0, {arguments.core})
    programs = {"now": arguments.program, **({"before": arguments.before} if arguments.before else {})}
    print("| command | build | time, C loop = 1 | range over the rounds | s per simulated hour | memory |")
    print("|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_inputs(folder, arguments.program)
        wanted = [command for command in COMMANDS if command.name in (arguments.case or names)]
        for missing in [command for command in wanted if command.program and not command.program.exists()]:
            print(f"{missing.name}: not measured, {missing.program} is not built", file=sys.stderr)
            wanted.remove(missing)
        compiled, usage = build("scalar.c", folder), build("usage.c", folder)
        for command in wanted:
            seconds = rows_of(folder, command.setpoints) * POSITION_PERIOD
            command, contenders = of_program(command, seconds), programs
            if command.program is not None:
                contenders = {"now": str(command.program)}
            loop = c_loop(folder, command.setpoints, compiled)
            loop.start()
            try:
                found = measure(command, folder, contenders, loop, usage, arguments.rounds, arguments.cpu)
            finally:
                loop.end()
            for program in contenders:
                print(row_of(command, program, found, seconds * command.runs), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
