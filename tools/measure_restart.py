#!/usr/bin/env python3
"""Measures how soon participants that stay reach a node that is ended and started again.

    cargo build --release && source .build/env.sh
    tools/measure_restart.py --runs 10

An rclpy process stays, with a publisher, a subscriber and a service client. For each restart of the node by SIGINT the
table has the time from its start to its first sample, and the time that the first trajectory and the first call take
then, in s: median and maximum.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from itertools import pairwise
from pathlib import Path

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from node_process import Node  # noqa: E402
from virtual_axes_py.ros import AxesClient, joint_trajectory  # noqa: E402

TIMEOUT_S = 30.0
GAIN = "x.velocity_loop.gain"


def measure(runs: int) -> dict[str, list[float]]:
    """Returns the times of all restarts by their names."""
    found: dict[str, list[float]] = {"first sample": [], "first trajectory": [], "first call": []}
    motion = joint_trajectory(["x"], [1.0], [[0.001]])
    with Node() as process, AxesClient(process=process) as drive:
        drive.accept(motion)
        drive.get_parameters([GAIN])
        for _ in range(runs):
            drive.process = None
            process.stop()
            last = drive.now()
            instants = [time.monotonic()]
            process.start()
            drive.process = process
            drive.wait_for(lambda last=last: drive.now() > last, TIMEOUT_S, "samples of the new node")
            instants.append(time.monotonic())
            drive.accept(motion, timeout=TIMEOUT_S)
            instants.append(time.monotonic())
            drive.get_parameters([GAIN])
            instants.append(time.monotonic())
            for name, (begin, end) in zip(found, pairwise(instants), strict=True):
                found[name].append(end - begin)
    return found


def main() -> None:
    parser = options.parser(__doc__)
    parser.add_argument("--runs", type=options.whole, default=10, help="number of restarts")
    arguments = parser.parse_args()
    print("| time, s | median | maximum |\n|---|---|---|")
    for name, seconds in measure(arguments.runs).items():
        print(f"| {name} | {statistics.median(seconds):.3f} | {max(seconds):.3f} |")


if __name__ == "__main__":
    main()
