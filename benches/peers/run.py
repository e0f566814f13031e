"""Compares this library with its peers: same cases, same setpoints, alternating runs.

    benches/peers/setup.sh                 # once: the peers, into .build/peers
    python3 benches/peers/run.py [--case NAME]... [--rounds 10] [--cpu] [--json FILE] [--contender PROGRAM]

Each contender is a process that has compiled and warmed up, stays alive, and runs once for each input line. First, the
figures of each are compared with those of the C loop, with a printed bound; only contenders within their bound are
timed, and the exit status is 1 if this library is not among them. Then the runs alternate. Only ratios are printed:
duration of a contender over that of the C loop in the same round for the same simulated time, as the median over the
rounds. With --cpu the time is the CPU time of all threads of a contender, for machines with other load; without it is
wall-clock time.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))
sys.dont_write_bytecode = True

from cases import CASES, TABLE, Case  # noqa: E402

VENV = ROOT / ".build" / "peers"
C_FLAGS = ("-std=gnu11", "-O3", "-march=native", "-ffast-math")
"""Flags of the C loop."""
REFERENCE = "C loop"
LIBRARY = "virtual_axes"
ON_TWO = ", 2 cores"
"""Suffix of contenders with two cores; for the C loop, two independent processes run at once."""
ROUND_SECONDS = 0.2
"""Approximate duration of a contender per round; at least one run."""
SAME = 1e-6
"""Relative bound for contenders with an exact step: rounding and the order of operations."""
PATIENCE = 300.0
"""Timeout of a contender, s; compilation takes part of it."""


class Unavailable(Exception):
    """A contender that cannot run here, with the reason."""


@dataclass
class Contender:
    """Program in the comparison."""

    name: str
    command: list[str]
    bound: float = SAME
    process: subprocess.Popen[str] | None = None
    errors: IO[str] | None = None
    runs: int = 1
    seconds: list[float] = field(default_factory=list)
    differs: float = 0.0

    def start(self) -> None:
        """Starts the program."""
        threads = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
        # Not a pipe: it is only read after the program's end.
        self.errors = tempfile.TemporaryFile("w+")
        try:
            self.process = subprocess.Popen(
                self.command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.errors,
                text=True,
                cwd=HERE,
                env={**os.environ, **threads, "PYTHONDONTWRITEBYTECODE": "1", "JAX_PLATFORMS": "cpu"},
            )
        except OSError as reason:
            raise Unavailable(str(reason)) from reason

    def on_core(self) -> float:
        """Returns the CPU time of its threads so far, s."""
        assert self.process
        tasks = Path(f"/proc/{self.process.pid}/task").iterdir()
        return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks) * 1e-9

    def time(self, cpu: bool) -> float:
        """Returns the CPU or wall-clock time, s."""
        before = self.on_core() if cpu else 0.0
        seconds = self.run(self.runs)["seconds"]
        return (self.on_core() - before) / self.runs if cpu else seconds

    def run(self, runs: int) -> dict:
        """Makes some runs and returns the response."""
        assert self.process and self.process.stdin and self.process.stdout and self.errors
        watch = threading.Timer(PATIENCE, self.process.kill)
        watch.start()
        try:
            self.process.stdin.write(f"run {runs}\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        finally:
            watch.cancel()
        if not line:
            status = self.process.wait()
            self.errors.seek(0)
            lines = self.errors.read().strip().splitlines()
            raise Unavailable(lines[-1] if lines else f"exit status {status}")
        try:
            answer = json.loads(line)
            if not float(answer["seconds"]) > 0:
                raise Unavailable(f"invalid duration of a run: {answer['seconds']} s")
        except (KeyError, TypeError, ValueError) as reason:
            raise Unavailable(f"{line.strip()[:60]} is not a response: {reason!r}") from reason
        return answer

    def end(self) -> None:
        """Ends the program and waits for it."""
        if self.process:
            self.process.kill()
            self.process.communicate()
            self.process = None
        if self.errors:
            self.errors.close()
            self.errors = None


@dataclass
class AtOnce(Contender):
    """Simultaneous processes of one program, `copies` of them: the throughput of several cores."""

    copies: int = 2
    others: list[Contender] = field(default_factory=list)

    def start(self) -> None:
        """Starts the processes."""
        super().start()
        for _ in range(1, self.copies):
            self.others.append(Contender(self.name, self.command, self.bound))
            self.others[-1].start()

    def run(self, runs: int) -> dict:
        """Makes the runs in each process; returns one response with the slowest time over their number."""
        with ThreadPoolExecutor(self.copies) as pool:
            others = [pool.submit(other.run, runs) for other in self.others]
            answers = [super().run(runs), *(other.result() for other in others)]
        return {**answers[0], "seconds": max(answer["seconds"] for answer in answers) / self.copies}

    def end(self) -> None:
        """Ends the processes."""
        super().end()
        for other in self.others:
            other.end()


def build(source: str, folder: Path, *more: str) -> str:
    """Builds a C program with the flags of the C loop plus `more`."""
    gcc = shutil.which("gcc")
    if not gcc:
        raise Unavailable("gcc not found")
    program = folder / Path(source).stem
    program = program.with_name(program.name + str(len(list(folder.iterdir()))))
    done = subprocess.run(
        [gcc, *C_FLAGS, *more[:1], "-o", str(program), str(HERE / source), "-lm", *more[1:]],
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise Unavailable(f"gcc: {done.stderr.strip().splitlines()[-1]}")
    return str(program)


def library(program: str | None) -> str:
    """Returns this library's program, built by cargo."""
    if program:
        return program
    command = ["cargo", "bench", "--bench", "contender", "--no-run", "--locked", "--message-format=json"]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    messages = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    found = [m["executable"] for m in messages if m.get("target", {}).get("name") == "contender" and "executable" in m]
    if done.returncode or not found:
        raise Unavailable("cargo failed to build it")
    return found[-1]


def python_peer(module: str, script: str) -> list[str]:
    """Returns the command of a Python peer, if its package is installed."""
    python = VENV / "bin" / "python"
    if not python.exists() or subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode:
        raise Unavailable(f"{module} is not installed: run benches/peers/setup.sh")
    return [str(python), str(HERE / script)]


def mujoco(folder: Path) -> str:
    """Builds the program with the library of MuJoCo's wheel."""
    package = next(VENV.glob("lib/python3*/site-packages/mujoco"), None)
    shared = next(package.glob("libmujoco.so*"), None) if package else None
    if not package or not shared:
        raise Unavailable("mujoco is not installed: run benches/peers/setup.sh")
    return build("with_mujoco.c", folder, f"-I{package / 'include'}", str(shared), f"-Wl,-rpath,{package}")


def contenders(case: Case, folder: Path, cpu: bool, program: str | None) -> tuple[list[Contender], dict[str, str]]:
    """Returns the contenders of a case, and the reasons for missing ones."""
    setpoints = [str(case.write(folder)), *case.arguments()]
    table_first = [str(TABLE), *setpoints]
    found: list[Contender] = []
    missing: dict[str, str] = {}

    def add(name: str, command, bound: float = SAME, kind: type[Contender] = Contender) -> None:
        try:
            found.append(kind(name, command(), bound))
        except Unavailable as reason:
            missing[name] = str(reason)

    add(REFERENCE, lambda: [build("scalar.c", folder), *table_first])
    if not found:
        return found, missing
    add("C loop, -O2", lambda: [build("scalar.c", folder, "-O2"), *table_first])
    add(LIBRARY, lambda: [library(program), *setpoints])
    # CPU time is the sum over all cores.
    if case.machines > 1 and not cpu and (os.cpu_count() or 1) > 1:
        add(LIBRARY + ON_TWO, lambda: [library(program), *setpoints, "--cores", "2"])
        add(REFERENCE + ON_TWO, lambda: found[0].command, kind=AtOnce)
    if case.name == "single-axis":
        for name, module, script in (
            ("numba", "numba", "with_numba.py"),
            ("CasADi mapaccum", "casadi", "with_casadi.py"),
            ("jaxonomy", "jaxonomy", "with_jaxonomy.py"),
            ("Drake", "pydrake", "with_drake.py"),
        ):
            add(name, lambda module=module, script=script: [*python_peer(module, script), *table_first])
        # Its integration error depends on its step: step sizes of the model's tick, of the tolerance on the model's
        # page, and of a tenth of that.
        # page, and for a tenth of that.
        for steps, bound in ((1, 0.025), (3, 0.01), (25, 0.001)):
            name = f"MuJoCo, 125 µs / {steps}"
            add(name, lambda steps=steps: [mujoco(folder), *table_first, str(steps)], bound)
    return found, missing


def compared(reference: dict, answer: dict) -> float:
    """Returns the largest relative difference of a common figure; infinite where one is missing."""
    worst = 0.0

    def compare(value: float | None, wanted: float, scale: float) -> None:
        nonlocal worst
        if value is None or not math.isfinite(value):
            worst = math.inf
        else:
            worst = max(worst, abs(value - wanted) / scale if scale else math.inf if value else 0.0)

    for mine, other in zip(reference["machines"], answer["machines"], strict=True):
        for joint, figures in mine["axes"].items():
            both = figures.keys() & other["axes"][joint].keys() - {"position"}
            if not both:
                raise ValueError(f"no figures of {joint}")
            for key in both:
                compare(other["axes"][joint][key], figures[key], abs(figures[key]))
        # A mean may be close to 0: each is relative to the largest of the three.
        circle = mine.get("circle", {})
        for key, value in circle.items():
            compare(other["circle"][key], value, max(map(abs, circle.values())))
    return worst


def check_all(all_of_them: list[Contender], missing: dict[str, str]) -> list[Contender]:
    """Starts and warms up each contender and compares its figures; returns those within their bound."""
    kept: list[Contender] = []
    reference: dict = {}
    for contender in all_of_them:
        try:
            contender.start()
            answer = contender.run(1)
            reference = reference or answer
            try:
                contender.differs = compared(reference, answer)
            except (KeyError, TypeError, ValueError) as reason:
                raise Unavailable(f"its figures cannot be compared: {reason!r}") from reason
            if not contender.differs <= contender.bound:
                raise Unavailable(f"its figures differ by {contender.differs:.2g}, more than {contender.bound:.2g}")
            again = contender.run(1)["seconds"]
            contender.runs = max(1, math.ceil(ROUND_SECONDS / again))
            kept.append(contender)
        except Unavailable as reason:
            missing[contender.name] = str(reason)
            contender.end()
    return kept


def measure(case: Case, rounds: int, cpu: bool, program: str | None) -> dict:
    """Runs a case and returns its results."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        everyone, missing = contenders(case, folder, cpu, program)
        try:
            kept = check_all(everyone, missing)
            for turn in range(rounds):
                # The order changes from round to round.
                shift = turn % max(len(kept), 1)
                for contender in kept[shift:] + kept[:shift]:
                    contender.seconds.append(contender.time(cpu))
        finally:
            for contender in everyone:
                contender.end()
    results = []
    if kept and kept[0].name == REFERENCE:
        for contender in kept:
            ratios = [mine / his for mine, his in zip(contender.seconds, kept[0].seconds, strict=True)]
            results.append(
                {
                    "contender": contender.name,
                    "time_relative_to_c": statistics.median(ratios),
                    "least_and_largest_of_a_round": [min(ratios), max(ratios)],
                    "simulated_seconds_per_second": case.simulated_seconds() / statistics.median(contender.seconds),
                    "differs_by": contender.differs,
                    "bound": contender.bound,
                }
            )
    clock = "CPU time" if cpu else "time"
    return {
        "case": case.name,
        "clock": clock,
        "rounds": rounds,
        "results": results,
        "two_cores_are_worth": worth_of_two(kept),
        "missing": missing,
    }


def worth_of_two(kept: list[Contender]) -> dict[str, float]:
    """Returns the speedup by a second core for each contender that uses it, as the median over the rounds."""
    times = {contender.name: contender.seconds for contender in kept}
    return {
        name: statistics.median(one / two for one, two in zip(seconds, times[name + ON_TWO], strict=True))
        for name, seconds in times.items()
        if name + ON_TWO in times
    }


def table(measured: dict) -> str:
    """Returns the results of a case as a Markdown table."""
    rounds = measured["rounds"]
    lines = [
        f"### {measured['case']}: " + (f"median of {rounds} rounds" if rounds > 1 else "one round"),
        "",
        f"| contender | {measured['clock']}, C loop = 1 | range over the rounds | largest difference of figures |",
        "|---|---|---|---|",
    ]
    for row in sorted(measured["results"], key=lambda row: row["time_relative_to_c"]):
        least, largest = row["least_and_largest_of_a_round"]
        lines.append(
            f"| {row['contender']} | {row['time_relative_to_c']:.3g} | {least:.3g} … {largest:.3g} "
            f"| {row['differs_by']:.1g} (bound {row['bound']:.2g}) |"
        )
    if worth := measured["two_cores_are_worth"]:
        lines += [
            "",
            "Speedup by a second core: " + ", ".join(f"{v:.2f} for {name}" for name, v in worth.items()) + ".",
        ]
    lines += [f"\nNot run: {name}: {reason}" for name, reason in measured["missing"].items()]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Runs the cases of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", action="append", choices=list(CASES), help="case to run (default: all)")
    parser.add_argument("--rounds", type=int, default=10, help="rounds; at least 10 for published figures")
    parser.add_argument("--cpu", action="store_true", help="use CPU time in place of wall-clock time")
    parser.add_argument("--json", type=Path, help="also write the results to this file")
    parser.add_argument("--contender", help="this library's program (default: built by cargo)")
    arguments = parser.parse_args()
    if arguments.rounds < 1:
        parser.error("--rounds: must be at least 1")
    if arguments.json:
        # An output that cannot be written is reported before the measurement.
        try:
            arguments.json.touch()
        except OSError as reason:
            parser.error(f"--json: {reason}")
    measured = []
    for name in arguments.case or list(CASES):
        measured.append(measure(CASES[name], arguments.rounds, arguments.cpu, arguments.contender))
        print(table(measured[-1]), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(measured, indent=2) + "\n")
    took_part = [{row["contender"] for row in case["results"]} for case in measured]
    return 0 if all({REFERENCE, LIBRARY} <= names for names in took_part) else 1


if __name__ == "__main__":
    sys.exit(main())
