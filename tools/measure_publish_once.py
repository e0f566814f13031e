#!/usr/bin/env python3
"""Measures the share of trajectories that arrive from publishers that publish at the match and leave.

    cargo build --release && source .build/env.sh
    tools/measure_publish_once.py --runs 200              # the hardest case, transient local
    tools/measure_publish_once.py --durability volatile --settle 0.3 --keep-alive 0.5
    tools/measure_publish_once.py --poll 0.1 --load 2     # the polling of ros2 topic pub, a busy machine
    tools/measure_publish_once.py --node-last --runs 20   # publishers that start before the node

Each publisher is a separate participant that acts like `ros2 topic pub --once`, and names its own nonexistent joint:
the rejections identify the trajectories that arrived.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from node_process import DomainId, Node  # noqa: E402
from virtual_axes_py.ros import AxesClient  # noqa: E402

PUBLISHERS = """
import sys, time
import rclpy
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

first, runs, durability, poll, settle, keep_alive, times, points = sys.argv[1:]
profile = QoSProfile(
    depth=1 if durability == "transient_local" else 10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL if durability == "transient_local" else DurabilityPolicy.VOLATILE,
)
for number in range(int(first), int(first) + int(runs)):
    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node(f"once_{number}", context=context)
    publisher = node.create_publisher(JointTrajectory, "/psec", profile)
    rows = [JointTrajectoryPoint(positions=[0.0]) for _ in range(int(points))]
    message = JointTrajectory(joint_names=[f"once_{number}"], points=rows)
    deadline = time.monotonic() + 20
    while publisher.get_subscription_count() < 1:
        if time.monotonic() > deadline:
            sys.exit("no subscriber")
        time.sleep(float(poll))
    time.sleep(float(settle))
    for time_ in range(int(times)):
        if time_:
            time.sleep(1.0)
        publisher.publish(message)
        print(number, time.time(), flush=True)
    time.sleep(float(keep_alive))
    node.destroy_node()
    rclpy.shutdown(context=context)
"""


def arguments() -> argparse.Namespace:
    """Returns the parsed command line."""
    parser = options.parser(__doc__)
    parser.add_argument("--runs", type=options.whole, default=100, help="number of successive publishers (100)")
    parser.add_argument("--durability", choices=["transient_local", "volatile"], default="transient_local")
    parser.add_argument("--poll", type=options.from_zero, default=0.001, help="polling period for the match, s (0.001)")
    parser.add_argument(
        "--settle", type=options.from_zero, default=0.0, help="delay from the match to the sample, s (0)"
    )
    parser.add_argument(
        "--keep-alive", type=options.from_zero, default=0.1, help="delay from the sample to the end, s (0.1)"
    )
    parser.add_argument("--times", type=options.whole, default=1, help="samples per publisher, one per second (1)")
    parser.add_argument(
        "--points", type=options.whole, default=1, help="points per trajectory; 2000 need fragments (1)"
    )
    parser.add_argument("--load", type=options.whole_from_zero, default=0, help="busy processes on the machine (0)")
    parser.add_argument("--node-last", action="store_true", help="start a new node after each publisher")
    parser.add_argument("--per-process", type=options.whole, default=1, help="publishers in one process (1)")
    parser.add_argument("--log-level", help="log level of the node; its output goes to --output")
    parser.add_argument("--output", type=Path, help="file for the node's output")
    return parser.parse_args()


def publish(args: argparse.Namespace, first: int, runs: int, domain_id: int) -> dict[int, float]:
    """Runs publishers in one process; returns the time of each message."""
    command = [sys.executable, "-c", PUBLISHERS, str(first), str(runs), args.durability]
    command += [str(value) for value in (args.poll, args.settle, args.keep_alive, args.times, args.points)]
    env = {**os.environ, "ROS_DOMAIN_ID": str(domain_id)}
    text = subprocess.run(command, env=env, check=True, stdout=subprocess.PIPE, text=True).stdout
    return {int(number): float(at) for number, at in map(str.split, text.splitlines())}


def publish_to_a_node_yet_to_start(args: argparse.Namespace, number: int) -> bool:
    """Starts a publisher, then the node; returns true if the message arrived."""
    domain = DomainId()
    try:
        with ThreadPoolExecutor(1) as pool:
            sent = pool.submit(publish, args, number, 1, domain.value)
            time.sleep(1.5)
            with Node(["-p", "time:=real"], domain_id=domain.value) as process:
                sent.result()
                with AxesClient(process=process) as drive:
                    # Results are transient local.
                    time.sleep(1.0)
                    return any(result.joint == f"once_{number}" for result in drive.results())
    finally:
        domain.release()


def main() -> int:
    """Runs the measurement; the exit status is 0 if all messages arrived exactly as often as they were sent."""
    args = arguments()
    if args.node_last:
        arrived = sum(publish_to_a_node_yet_to_start(args, number) for number in range(args.runs))
        print(f"{arrived} of {args.runs} arrived")
        return int(arrived != args.runs)
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(args.load)]
    sent: dict[int, float] = {}
    try:
        log_level = ["--log-level", args.log_level] if args.log_level else []
        with Node(["-p", "time:=real", *log_level]) as process, AxesClient(process=process) as drive:
            print(f"domain {process.domain_id}", flush=True)
            while len(sent) < args.runs:
                runs = min(args.per_process, args.runs - len(sent))
                sent |= publish(args, len(sent), runs, process.domain_id)
            time.sleep(3.0)
            arrivals = Counter(result.joint for result in drive.results())
            if args.output is not None:
                args.output.write_text(process.output())
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()
    lost = [number for number in sent if not arrivals[f"once_{number}"]]
    for number in lost:
        print(f"lost: once_{number}, sent at {sent[number]:.6f}")
    more = sum(max(0, arrivals[f"once_{number}"] - args.times) for number in sent)
    print(f"{len(sent) - len(lost)} of {len(sent)} arrived, {more} more often than sent")
    return int(bool(lost or more))


if __name__ == "__main__":
    sys.exit(main())
