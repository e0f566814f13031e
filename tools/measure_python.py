#!/usr/bin/env python3
"""Measures the speed of the Python module beside the Rust library, with the Python of .venv.

    cargo build --release --example time_simulation && tools/measure_python.py

`simulate` records position, velocity and current of a five-axis motion of 4 s with the figures of the axes; the example
simulates the same setpoints with the same figures and signals in Rust. Both run in turns. The stepper follows the
ballbar.
"""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path
from statistics import median

import numpy as np

import options
import virtual_axes_py as va

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release/examples/time_simulation"
SIGNALS = ("position", "velocity", "current")
DURATION_S = 4.0


def motion(machine: va.Machine) -> np.ndarray:
    """Returns setpoints of five axes, which `time_simulation` computes too."""
    cycles = round(DURATION_S / machine.position_period)
    angle = 2 * np.pi * np.arange(cycles + 1) / cycles
    return np.outer(1 - np.cos(angle), [0.02, 0.02, 0.02, 0.05, 0.1])


def rust_seconds(runs: int) -> float:
    """Returns the seconds per simulation of the Rust library."""
    done = subprocess.run([EXAMPLE, str(runs)], check=True, capture_output=True, text=True, timeout=600)
    return float(done.stdout)


def python_seconds(machine: va.Machine, psec: np.ndarray, runs: int) -> float:
    """Returns the seconds per `simulate`."""
    start = time.perf_counter()
    for _ in range(runs):
        machine.simulate(psec, signals=SIGNALS, figures="axes")
    return (time.perf_counter() - start) / runs


def cycles_per_second(machine: va.Machine, machines: int, cycles: int) -> float:
    """Returns the position cycles per second of a stepper, each of all machines."""
    psec = va.scenario("ballbar").psec(machine)[:cycles]
    rows = psec if machines == 1 else np.repeat(psec[:, None, :], machines, axis=1)
    stepper = va.Stepper(machine, machines)
    start = time.perf_counter()
    for row in rows:
        stepper.step(row)
    return len(rows) / (time.perf_counter() - start)


def main() -> None:
    parser = options.parser(__doc__)
    parser.add_argument("--machines", type=options.whole, default=64)
    parser.add_argument("--runs", type=options.whole, default=50)
    parser.add_argument("--rounds", type=options.whole, default=9)
    arguments = parser.parse_args()
    machine = va.Machine.load()
    psec = motion(machine)
    pairs = [
        (rust_seconds(arguments.runs), python_seconds(machine, psec, arguments.runs)) for _ in range(arguments.rounds)
    ]
    ratio = median(python / rust for rust, python in pairs)
    rust, python = (median(column) * 1e3 for column in zip(*pairs))
    print(f"simulate, {DURATION_S:g} s of five axes: Rust {rust:.3f} ms, Python {python:.3f} ms, ratio {ratio:.3f}")
    steps = [
        (cycles_per_second(machine, 1, 1000), cycles_per_second(machine, arguments.machines, 1000) * arguments.machines)
        for _ in range(arguments.rounds)
    ]
    one, many = (median(column) for column in zip(*steps))
    print(f"stepper, one machine: {one:.0f} cycles per second")
    factor = median(right / left for left, right in steps)
    print(f"stepper, {arguments.machines} machines: {many:.0f} machine-steps per second, ratio {factor:.1f}")


if __name__ == "__main__":
    main()
