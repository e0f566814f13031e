#!/usr/bin/env python3
"""Measures the latency from a setpoint on `psec_stream` to the joint state with its effect.

    cargo build --release && source .build/env.sh
    tools/measure_latency.py --messages 500

One setpoint at a time at a random phase of the position cycle; wall-clock time from the call of publish to the callback
of the first message

- of ~/drive_states that contains it as psec: the latency of the graph;
- of joint_states in which the axis has moved: also the pure delay of the simulated drive.

Figures are ratios to the position cycle. A sample is published after its cycle has been computed. The first latency
consists of the wait for the next position cycle (uniform between 0 and 1 cycle), the computation of that cycle, and
the transport in both directions.
"""

from __future__ import annotations

import os
import random
import sys
import time
from pathlib import Path

import numpy as np
from sensor_msgs.msg import JointState
from virtual_axes.msg import DriveStates

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from node_process import Node  # noqa: E402
from virtual_axes_py.ros import DEEP_QOS, TSP_NS, AxesClient  # noqa: E402

STEP = 2e-3
"""Step of the setpoint within reach of the axis in one cycle, m."""
MOVED = 1e-7
"""Threshold of motion, m: above the creep of an axis at rest during the measurement."""
REST = 0.4
"""Time until the axis is at rest again, s."""


def measure(drive: AxesClient, messages: int, seed: int) -> dict[str, np.ndarray]:
    """Returns the latencies of both kinds, s."""
    rng = random.Random(seed)
    came: dict[str, list[tuple[int, float]]] = {"psec": [], "position": []}

    def keep_states(message: DriveStates) -> None:
        came["psec"].append((time.monotonic_ns(), message.psec[message.name.index("x")]))

    def keep_joints(message: JointState) -> None:
        came["position"].append((time.monotonic_ns(), message.position[message.name.index("x")]))

    drive.node.create_subscription(DriveStates, f"{drive.target}/drive_states", keep_states, DEEP_QOS)
    drive.node.create_subscription(JointState, "/joint_states", keep_joints, DEEP_QOS)
    drive.wait_for(lambda: all(came.values()), 10, "samples")
    found: dict[str, list[float]] = {key: [] for key in came}
    for number in range(messages):
        target = 0.0 if number % 2 else STEP
        time.sleep(REST + rng.random() * TSP_NS / 1e9)
        before = came["position"][-1][1]
        for samples in came.values():
            samples.clear()
        sent = time.monotonic_ns()
        drive.stream(["x"], [target])
        for key, has_come in (
            ("psec", lambda value, target=target: value == target),
            ("position", lambda value, before=before: abs(value - before) > MOVED),
        ):

            def first(key: str = key, has_come=has_come) -> list[int]:
                return [at for at, value in list(came[key]) if has_come(value)][:1]

            found[key].append((drive.wait_for(first, 2, f"{key} of message {number}")[0] - sent) / 1e9)
    return {key: np.array(latencies) for key, latencies in found.items()}


def main() -> int:
    """Runs the measurement and prints the result."""
    parser = options.parser(__doc__)
    parser.add_argument("--messages", type=options.whole, default=300, help="setpoints (300)")
    parser.add_argument("--seed", type=int, default=1, help="random seed of the phases (1)")
    args = parser.parse_args()
    with Node(["-p", "time:=real"]) as process, AxesClient(process=process) as drive:
        latencies = measure(drive, args.messages, args.seed)
    print(f"{args.messages} setpoints, position cycle {TSP_NS / 1e6:g} ms, {os.cpu_count()} cores; in cycles:")
    for key, name in (("psec", "commanded"), ("position", "axis has moved")):
        periods = latencies[key] * 1e9 / TSP_NS
        low, median, high = np.percentile(periods, [5, 50, 95])
        print(f"  {name:<15} p5 {low:.2f}, median {median:.2f}, p95 {high:.2f}, max {periods.max():.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
