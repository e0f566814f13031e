#!/usr/bin/env python3
"""Measures the maximum rate at which a subscriber receives joint_states without loss.

    cargo build --release --bins --examples && source .build/env.sh
    tools/measure_rate.py --seconds 5

In real time, with decreasing position cycles, to a subscriber in Rust (examples/count_joint_states.rs) and to one in
rclpy, each alone with the node: samples per second, missing samples on the stamp grid, and the CPU share of the node.
Both subscribers are reliable and deserialize each message; the history depth is 100 000 in Rust and 100 in rclpy. Then
in `fast`, in motion, where the simulation waits for its subscribers and rclpy keeps all samples: samples per second.
Rates are multiples of the default one in the same run.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

import options

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from measure_node import STARTED_S, cpu_seconds  # noqa: E402
from node_process import Node  # noqa: E402
from virtual_axes_py.ros import PSEC_QOS, TSP_NS, joint_trajectory, to_ns  # noqa: E402

PERIODS_MS = (6, 3, 2, 1, 0.5, 0.25)
"""Position cycles, down to the velocity cycle."""
LAST = QoSProfile(depth=100)
"""Lateness above which the reader loses samples."""
ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
COUNTER = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "examples" / "count_joint_states"
# Longer than any span in `fast`: half an hour of machine time.
LONG_S = 1800


class Count(NamedTuple):
    """Samples that a subscriber received."""

    samples: int
    seconds: float
    lost: int

    @property
    def rate(self) -> float:
        """Returns the rate in samples per second."""
        return (self.samples - 1) / self.seconds


class Subscriber:
    """rclpy subscriber with messages and callbacks, as in usual nodes."""

    def __init__(self, process: Node, qos: QoSProfile):
        """Joins the node's graph."""
        self._process = process
        self._stamps: list[int] = []
        self._context = Context()
        rclpy.init(context=self._context, domain_id=process.domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(
            "counter", context=self._context, enable_rosout=False, start_parameter_services=False
        )
        self._node.create_subscription(JointState, "/joint_states", self._keep, qos)
        self._psec = self._node.create_publisher(JointTrajectory, "/psec", PSEC_QOS)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def _keep(self, message: JointState) -> None:
        self._stamps.append(to_ns(message.header.stamp))

    def count(self, seconds: float, period_ns: int) -> Count:
        """Counts the samples within `seconds` after the first one."""
        deadline = time.monotonic() + 10
        while not self._stamps:
            if time.monotonic() > deadline or self._process.poll() is not None:
                raise SystemExit(f"no samples received; the node's output:\n{self._process.output()}")
            self._executor.spin_once(timeout_sec=0.1)
        self._stamps.clear()
        start = time.monotonic()
        while time.monotonic() - start < seconds:
            self._executor.spin_once(timeout_sec=0.1)
        stamps = np.array(self._stamps)
        return Count(len(stamps), time.monotonic() - start, int(np.sum(np.rint(np.diff(stamps) / period_ns) - 1)))

    def send(self, trajectory: JointTrajectory) -> None:
        """Publishes setpoints once the node is matched."""
        while not self._psec.get_subscription_count():
            self._executor.spin_once(timeout_sec=0.1)
        time.sleep(0.2)
        self._psec.publish(trajectory)

    def close(self) -> None:
        """Leaves the graph."""
        self._executor.shutdown(timeout_sec=2.0)
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


def count_in_rust(process: Node, seconds: float, period_ns: int) -> Count:
    """Returns the count of examples/count_joint_states.rs."""
    env = os.environ | {"ROS_DOMAIN_ID": str(process.domain_id)}
    command = [str(COUNTER), str(seconds), str(period_ns / 1e6)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=seconds + 20, check=False)
    found = re.search(r"(\d+) samples in ([\d.]+) s: [\d.]+ per second, (-?\d+) lost", done.stdout)
    if done.returncode or found is None:
        raise SystemExit(f"{COUNTER.name}: {done.stdout}{done.stderr}")
    return Count(int(found[1]), float(found[2]), int(found[3]))


def count_in_rclpy(process: Node, seconds: float, period_ns: int) -> Count:
    """Returns the count of rclpy."""
    subscriber = Subscriber(process, LAST)
    try:
        return subscriber.count(seconds, period_ns)
    finally:
        subscriber.close()


def real_time(seconds: float) -> None:
    """Prints rates, losses and CPU shares, and the maximum rate without loss."""
    print(f"{'multiple':>10}{'cycle, ms':>12}{'subscriber':>12}{'per second':>12}{'lost':>8}{'node CPU share':>17}")
    best: dict[str, float] = {}
    for period_ms in PERIODS_MS:
        period_ns = round(period_ms * 1e6)
        for name, count in (("Rust", count_in_rust), ("rclpy", count_in_rclpy)):
            with Node(["-p", f"periods.position_ms:={period_ms}"]) as process:
                time.sleep(STARTED_S)
                before, start = cpu_seconds(process.pid), time.monotonic()
                found = count(process, seconds, period_ns)
                used = (cpu_seconds(process.pid) - before) / (time.monotonic() - start)
                if process.stop() != 0:
                    raise SystemExit(f"the node failed; its output:\n{process.output()}")
            multiple = TSP_NS / period_ns
            # At the grid's own rate: samples in transit at the end of the span are not lost.
            is_whole = found.lost == 0 and found.rate > 0.97e9 / period_ns
            if is_whole:
                best[name] = max(best.get(name, 0), multiple)
            print(
                f"{multiple:>10g}{period_ms:>12g}{name:>12}{found.rate:>10.0f}{found.lost:>8}{used:>17.1%}",
                "" if is_whole else "  incomplete",
                flush=True,
            )
    for name, multiple in best.items():
        print(f"maximum rate without loss to {name}: {multiple:g} times the default rate")


def fast(seconds: float) -> None:
    """Prints samples per second while the simulation waits for its subscribers."""
    default = 1e9 / TSP_NS
    for name in ("Rust", "rclpy"):
        with Node(["-p", "time:=fast"]) as process:
            time.sleep(STARTED_S)
            sender = Subscriber(process, ALL)
            # Reciprocating motion in x, a point per second.
            points = np.arange(LONG_S + 1)
            sender.send(joint_trajectory(["x"], points, 0.05 * (points % 2)[:, None]))
            if name == "rclpy":
                found = sender.count(seconds, TSP_NS)
            else:
                # Otherwise the simulation would wait for it.
                sender.close()
                found = count_in_rust(process, seconds, TSP_NS)
            if name == "rclpy":
                sender.close()
            if process.poll() is not None:
                raise SystemExit(f"the node ended; its output:\n{process.output()}")
        times = f"{found.rate / default:.1f} times real time"
        print(f"fast, to {name}: {found.rate:.0f} samples per second, {found.lost} lost, {times}")


def main() -> int:
    """Runs the measurement and prints the result."""
    parser = options.parser(__doc__)
    parser.add_argument("--seconds", type=options.positive, default=5, help="duration of each span, s (5)")
    args = parser.parse_args()
    real_time(args.seconds)
    fast(args.seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
