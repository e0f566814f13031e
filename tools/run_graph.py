#!/usr/bin/env python3
"""Runs four processes in real time; checks the stamp grid and measures the latency of samples.

    cargo build --release && source .build/env.sh
    tools/run_graph.py --seconds 60

Trajectory source, node, process model with loads in proportion to the velocity, and recorder. The exit status is 1 if a
stamp is missing or duplicated.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import numpy as np

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from four_processes import DAMPING, run_graph  # noqa: E402
from motion import RATIO  # noqa: E402

TORQUE_CONSTANT = 2.64


def main() -> int:
    """Runs the graph and prints the figures."""
    parser = options.parser(__doc__)
    parser.add_argument("--seconds", type=options.positive, default=60.0, help="duration of the motion, s (60)")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = run_graph(args.seconds, Path(folder) / "recorded.json")
    print(f"{args.seconds:g} s on {os.cpu_count()} cores")
    for topic, late in figures.lateness.items():
        p50, p99 = np.percentile(late * 1e3, [50, 99])
        times = f"p50 {p50:.2f}, p99 {p99:.2f}, max {late.max() * 1e3:.2f}"
        print(f"  {topic:<15}{len(late)} samples; from stamp to recorder, ms: {times}")
    for fault in figures.faults():
        print(f"  {fault}")
    slope, correlation, lag = figures.load_per_velocity()
    nominal = DAMPING * RATIO / TORQUE_CONSTANT
    print(f"  load over velocity: {slope:.3f} A s/m ({nominal:.3f}), correlation {correlation:.5f}, lag {lag:g} cycles")
    print(f"  loads equal to a published velocity times this factor: {figures.answered(nominal) * 100:.2f} %")
    for key in ("position_periods", "missed_periods", "dropped_samples", "mean_lateness_ms", "max_lateness_ms"):
        print(f"  {key}: {figures.diagnostics[key]}")
    return int(bool(figures.faults()))


if __name__ == "__main__":
    sys.exit(main())
