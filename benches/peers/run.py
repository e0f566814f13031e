"""Compares the library with the C loop (`scalar.c`): same setpoints, alternating runs.

    cargo build --release && python3 benches/peers/run.py [--case NAME]... [--rounds 10] [--cpu]

Each program stays alive and runs once for each input line. First its figures are compared with those of the C loop.
Only ratios are printed: the time of a run over that of the C loop in the same round, as the median over the rounds.
With --cpu it is the CPU time of all threads, for machines with other load.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
PROGRAM = ROOT / "target/release/virtual_axes"
TABLE = ROOT / "benches/peers/mikron_ucp710.txt"
C_FLAGS = ("-std=gnu11", "-O3", "-march=native", "-ffast-math")
SHUTTLES = (0.300, 1.9), (0.250, 1.35), (0.200, 1.05), (math.pi / 2, 3.1), (1.5 * math.pi, 4.7)
"""Length (m, rad) and time (s) of a move of each axis, there and back at once."""
TSP = 6e-3
"""Position cycle, s."""
ROUND_S = 0.2
"""Approximate time of a contender in a round, s; at least one run."""
BOUND = 1e-6
"""Largest relative difference of figures: rounding and the order of operations."""
CASES = {
    "single-axis": ("x-constant", "x", []),
    "five-axis": ("shuttles", "xyzac", []),
    "sweep": ("ballbar", "xy", ["--circle", "0.15", "250", "1340", "--machines", "256"]),
}
"""Setpoints, joints and arguments of each case; the window of the circle is that of the radial deviation."""


class Contender:
    """Program that runs once for each input line."""

    def __init__(self, name: str, command: list[str]):
        """Starts the program."""
        self.name, self.seconds, self.runs = name, [], 1
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, runs: int) -> dict:
        """Makes some runs and returns the response."""
        print(f"run {runs}", file=self.process.stdin, flush=True)
        if not (line := self.process.stdout.readline()):
            raise SystemExit(f"{self.name} ended with status {self.process.wait()}")
        return json.loads(line)

    def cpu_seconds(self) -> float:
        """Returns the CPU time of its threads so far, s."""
        tasks = Path(f"/proc/{self.process.pid}/task").iterdir()
        return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks) * 1e-9

    def warm_up(self) -> None:
        """Sets the number of runs of a round."""
        self.runs = max(1, math.ceil(ROUND_S / self.run(1)["seconds"]))

    def time(self, cpu: bool) -> float:
        """Returns the time of a run in a round, s."""
        before = self.cpu_seconds()
        seconds = self.run(self.runs)["seconds"]
        return (self.cpu_seconds() - before) / self.runs if cpu else seconds

    def end(self) -> None:
        """Ends the program."""
        self.process.kill()
        self.process.communicate()


def shuttles(seconds: float) -> str:
    """Returns setpoints of all axes in CSV, each move from rest to rest."""
    rows = ["time,x,y,z,a,c"]
    for k in range(round(seconds / TSP)):
        values = [k * TSP]
        for length, time in SHUTTLES:
            moves = seconds // time
            done = min(values[0] // time, moves)
            part = values[0] / time - done if done < moves else 0.0
            way = length * (part - math.sin(2 * math.pi * part) / (2 * math.pi))
            values.append(length - way if done % 2 else way)
        rows.append(",".join(map(repr, values)))
    return "\n".join(rows) + "\n"


def c_loop(folder: Path) -> str:
    """Builds the C loop."""
    program = str(folder / "scalar")
    subprocess.run(["gcc", *C_FLAGS, "-o", program, str(TABLE.with_name("scalar.c")), "-lm"], check=True)
    return program


def setpoints(csv: Path, joints: str = "xyzac") -> tuple[str, int]:
    """Writes the setpoints of a CSV file as the C loop reads them; returns the path and their number."""
    rows = [line.split(",") for line in csv.read_text().splitlines()]
    columns = [index for index, name in enumerate(rows[0]) if name in joints]
    text = csv.with_suffix(".txt")
    text.write_text("".join(" ".join(row[index] for index in columns) + "\n" for row in rows))
    return str(text), len(rows) - 1


def library() -> str:
    """Builds the library's program."""
    command = ["cargo", "bench", "--bench", "contender", "--no-run", "--locked", "--message-format=json"]
    output = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    return next(m["executable"] for m in messages if m.get("target", {}).get("name") == "contender")


def difference(one: object, other: object, scale: float = 0.0) -> float:
    """Returns the largest relative difference of numbers of the same place; a circle's are relative to the largest."""
    if isinstance(one, dict):
        scale = max(map(abs, one.values())) if "mean" in one else 0.0
        return max(
            (difference(one[key], other[key], scale) for key in one.keys() & other.keys() - {"position"}), default=0
        )
    if isinstance(one, list):
        return max(map(difference, one, other))
    return abs(one - other) / (scale or abs(one) or 1.0)


def measure(name: str, rounds: int, cpu: bool, folder: Path, program: str) -> None:
    """Prints the table of a case."""
    source, joints, arguments = CASES[name]
    csv = folder / f"{name}.csv"
    if source == "shuttles":
        csv.write_text(shuttles(10))
    else:
        subprocess.run([PROGRAM, "psec", source, "--out", csv], check=True, stdout=subprocess.DEVNULL)
    words = [setpoints(csv, joints)[0], *arguments]
    everyone = [
        Contender("C loop", [c_loop(folder), str(TABLE), *words]),
        Contender("virtual_axes", [program, *words]),
    ]
    if "--machines" in arguments and not cpu:
        everyone.append(Contender("virtual_axes, 2 cores", [program, *words, "--cores", "2"]))
    reference = everyone[0].run(1)
    for contender in everyone:
        if not (differs := difference(reference["machines"], contender.run(1)["machines"])) <= BOUND:
            sys.exit(f"{name}: figures of {contender.name} differ by {differs:.2g}, more than {BOUND:.2g}")
        contender.warm_up()
    for turn in range(rounds):
        # The order changes from round to round.
        for contender in everyone[turn % len(everyone) :] + everyone[: turn % len(everyone)]:
            contender.seconds.append(contender.time(cpu))
    print(f"\n| {name} | time, C loop = 1 | range over the rounds |\n|---|---|---|")
    for contender in everyone:
        ratios = [mine / his for mine, his in zip(contender.seconds, everyone[0].seconds, strict=True)]
        print(
            f"| {contender.name} | {statistics.median(ratios):.3g} | {min(ratios):.3g} … {max(ratios):.3g} |",
            flush=True,
        )
        contender.end()


def main() -> None:
    """Measures the cases of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", action="append", choices=list(CASES), help="case to measure (default: all)")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--cpu", action="store_true", help="use CPU time in place of wall-clock time")
    arguments = parser.parse_args()
    program = library()
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.case or CASES:
            measure(name, arguments.rounds, arguments.cpu, Path(folder), program)


if __name__ == "__main__":
    main()
