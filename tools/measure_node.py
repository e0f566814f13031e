#!/usr/bin/env python3
"""Measures the node's cost in real time: CPU share, memory and open files.

    cargo build --release && source .build/env.sh
    tools/measure_node.py --seconds 20 --minutes 10
    cargo build --release --example minimal_publisher
    tools/measure_node.py --seconds 20 --minutes 0 --compare

The CPU share is user and system time of all threads of the process over wall-clock time, of one core: at rest and in
motion, alone and with subscribers (rclpy, reliable, raw). The number of wake-ups of its threads per position cycle
depends less on the machine and its load than the share does. Each span is checked: the node still runs at its end, its
diagnostics report no missed cycle, and all subscribers have received all samples.

With --compare, only the node with a subscriber of joint_states is measured, and at the same time, in another domain, a
program that publishes the same messages and does nothing else (examples/minimal_publisher.rs), also with a subscriber:
the ratio of the two does not depend on the speed of the machine.

Memory: resident set and open files during successive trajectories and a subscription to joint_states, for --minutes
(0: skipped). First, as many trajectories are sent as the middleware stores for psec (64), so that bounded histories
are full.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from control_msgs.msg import JointTrajectoryControllerState
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path as PathMessage
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import DriveStates, MotorCurrents

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from node_process import Node, node_binary, status_of  # noqa: E402
from virtual_axes_py.ros import (  # noqa: E402
    DEEP_QOS,
    PSEC_QOS,
    SETTLE_S,
    STREAM_QOS,
    TSP_NS,
    ballbar,
    joint_trajectory,
    stamp_of,
)

JOINTS = {"/joint_states": JointState}
ALL = JOINTS | {
    "/virtual_axes/motor_currents": MotorCurrents,
    "/virtual_axes/drive_states": DriveStates,
    "/virtual_axes/controller_state": JointTrajectoryControllerState,
    "/virtual_axes/tool_pose": PoseStamped,
    "/virtual_axes/tool_path": PathMessage,
    "/virtual_axes/tool_path_setpoint": PathMessage,
    "/diagnostics": DiagnosticArray,
}
STARTED_S = 2.0
"""Time from start to complete discovery, with a margin, s."""
LOOK_S = 5.0
"""Interval between samples of the memory, s."""
KEPT = 64
"""Trajectories that the middleware stores: depth of psec."""
TICKS = os.sysconf("SC_CLK_TCK")


class Client:
    """Client node that subscribes and can send setpoints."""

    def __init__(self, process: Node, topics: dict[str, Any], sends: bool = True):
        """Subscribes to `topics`; if `sends`, waits for the subscription of setpoints."""
        self.process = process
        self.stamps: list[int] = []
        self._context = Context()
        rclpy.init(context=self._context, domain_id=process.domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node(
            "client", context=self._context, enable_rosout=False, start_parameter_services=False
        )
        for topic, kind in topics.items():
            keep = self._keep if topic == "/joint_states" else lambda _: None
            self.node.create_subscription(kind, topic, keep, DEEP_QOS, raw=True)
        self.psec = self.node.create_publisher(JointTrajectory, "/psec", PSEC_QOS)
        self.psec_stream = self.node.create_publisher(JointState, "/psec_stream", STREAM_QOS)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        self._wait_for(lambda: self.stamps and (not sends or self.psec.get_subscription_count()), "joint_states")
        time.sleep(SETTLE_S)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass

    def _keep(self, message: bytes) -> None:
        self.stamps.append(stamp_of(message))

    def _wait_for(self, condition: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + 20
        while not condition():
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise SystemExit(f"no {what}; the node's output:\n{self.process.output()}")
            time.sleep(0.02)

    def close(self) -> None:
        """Leaves the graph."""
        self._executor.shutdown(timeout_sec=2.0)
        self._thread.join(timeout=2.0)
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


def cpu_seconds(pid: int) -> float:
    """Returns user and system time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def wakeups(pid: int) -> int:
    """Returns the number of voluntary context switches of all threads of a process so far."""
    label = "voluntary_ctxt_switches:"
    lines = (line for status in Path(f"/proc/{pid}/task").glob("*/status") for line in status.open())
    return sum(int(line.removeprefix(label)) for line in lines if line.startswith(label))


def open_files(pid: int) -> int:
    """Returns the number of file descriptors of a process."""
    return len(os.listdir(f"/proc/{pid}/fd"))


class Motion:
    """Repeated motion commands of a client."""

    def __init__(self, client: Client, kind: str):
        """Sets `kind`: rest, trajectory or stream."""
        self.client, self.kind = client, kind
        circle = ballbar()
        self._circle = joint_trajectory(["x", "y"], circle.time, np.column_stack([circle.x, circle.y]))
        self._duration = circle.time[-1]
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        start = time.monotonic()
        while not self._end.is_set():
            if self.kind == "trajectory":
                self.client.psec.publish(self._circle)
                self._end.wait(self._duration + 0.1)
            else:
                phase = 2 * np.pi * 0.5 * (time.monotonic() - start)
                position = [0.01 * np.sin(phase), 0.01 * (1 - np.cos(phase))]
                self.client.psec_stream.publish(JointState(name=["x", "y"], position=position))
                self._end.wait(TSP_NS / 1e9)

    def fill(self) -> None:
        """Sends as many trajectories as the middleware stores, and stops."""
        for _ in range(2 * KEPT):
            self.client.psec.publish(self._circle)
            time.sleep(0.1)
        self.client.psec.publish(JointTrajectory())
        time.sleep(1.0)

    def __enter__(self) -> Motion:
        """Starts the motion."""
        if self.kind != "rest":
            self._thread.start()
            time.sleep(1.0)
        return self

    def __exit__(self, *_: object) -> None:
        """Stops, and waits until the axes are at rest."""
        self._end.set()
        if self.kind != "rest":
            self._thread.join(timeout=5.0)
            self.client.psec.publish(JointTrajectory())
            time.sleep(1.0)


def check(process: Node, stamps: Iterable[int] | None, seconds: float) -> None:
    """Exits with an error unless the node runs and all samples of the span have arrived."""
    if process.poll() is not None:
        raise SystemExit(f"the node ended; its output:\n{process.output()}")
    if stamps is None:
        return
    grid = np.diff(np.array(list(stamps)))
    lost = int(np.sum(grid // TSP_NS - 1))
    if len(grid) < 0.98 * seconds * 1e9 / TSP_NS or lost:
        raise SystemExit(f"{len(grid) + 1} samples in {seconds:.1f} s, {lost} lost")


def share(process: Node, client: Client | None, seconds: float) -> str:
    """Returns the share of a core over a span, and the wake-ups per position cycle."""
    first = len(client.stamps) if client else 0
    before, slept, start = cpu_seconds(process.pid), wakeups(process.pid), time.monotonic()
    time.sleep(seconds)
    used, took = cpu_seconds(process.pid) - before, time.monotonic() - start
    slept = wakeups(process.pid) - slept
    check(process, client.stamps[first:] if client else None, took)
    return f"{used / took:6.2%}{slept * TSP_NS / 1e9 / took:6.1f} wake-ups per cycle"


def compare(seconds: float) -> None:
    """Prints the shares of the node and of a minimal publisher over the same spans, and their ratio."""
    minimal = node_binary().parent / "examples" / "minimal_publisher"
    if not minimal.exists():
        raise SystemExit(f"no program {minimal}: cargo build --release --example minimal_publisher")
    with Node(["-p", "time:=real"]) as process, Node(binary=minimal, name="/minimal_publisher") as publisher:
        time.sleep(STARTED_S)
        clients = Client(process, JOINTS), Client(publisher, JOINTS, sends=False)
        both = process, publisher
        print(f"share of one core, and ratio to a minimal publisher at the same time, spans of {seconds:g} s:")
        for kind in ("rest", "trajectory", "stream"):
            with Motion(clients[0], kind):
                first = [len(client.stamps) for client in clients]
                before, start = [cpu_seconds(one.pid) for one in both], time.monotonic()
                time.sleep(seconds)
                took = time.monotonic() - start
                used = [(cpu_seconds(one.pid) - at) / took for one, at in zip(both, before)]
                for one, client, count in zip(both, clients, first):
                    check(one, client.stamps[count:], took)
            print(
                f"  {kind:<12}node {used[0]:6.2%}  publisher {used[1]:6.2%}  ratio {used[0] / used[1]:.2f}", flush=True
            )
        for client in clients:
            client.close()


def memory(process: Node, client: Client, minutes: float) -> None:
    """Prints memory and open files while the axes move."""
    looks: list[tuple[float, int, int]] = []
    motion = Motion(client, "trajectory")
    motion.fill()
    start = time.monotonic()
    with motion:
        while (passed := time.monotonic() - start) < minutes * 60:
            looks.append((passed, status_of(process.pid, "VmRSS"), open_files(process.pid)))
            first = len(client.stamps)
            time.sleep(LOOK_S)
            check(process, client.stamps[first:], LOOK_S)
    passed, resident, files = np.array(looks).T
    print(f"memory over {minutes:g} minutes of motion, {len(looks)} samples:")
    span = f"{resident.min():.0f} to {resident.max():.0f}"
    print(f"  resident: {resident[0]:.0f} kB initially, {span}, {resident[-1]:.0f} finally")
    half = passed > minutes * 30
    if half.sum() > 2:
        slope = np.polyfit(passed[half] / 60, resident[half], 1)[0]
        print(f"  growth over the second half: {slope:+.1f} kB per minute")
    print(f"  open files: {files[0]:.0f} initially, at most {files.max():.0f}, {files[-1]:.0f} finally")


def main() -> int:
    """Runs the measurement and prints the result."""
    parser = options.parser(__doc__)
    parser.add_argument("--seconds", type=options.positive, default=20, help="duration of each span, s (20)")
    parser.add_argument(
        "--minutes", type=options.from_zero, default=10, help="duration of the memory measurement, min (10)"
    )
    parser.add_argument("--compare", action="store_true", help="compare with a minimal publisher")
    args = parser.parse_args()
    if args.compare:
        compare(args.seconds)
        return 0
    with Node(["-p", "time:=real"]) as process:
        time.sleep(STARTED_S)
        print(f"share of one core in real time, position cycle {TSP_NS / 1e6:g} ms, spans of {args.seconds:g} s:")
        print(f"  {'at rest, no subscriber':<44}{share(process, None, args.seconds)}", flush=True)
        for topics, who in ((JOINTS, "joint_states"), (ALL, f"{len(ALL)} topics")):
            client = Client(process, topics)
            for kind in ("rest", "trajectory", "stream"):
                with Motion(client, kind):
                    found = share(process, client, args.seconds)
                print(f"  {f'{kind}, a subscriber of {who}':<44}{found}", flush=True)
            client.close()
        if args.minutes > 0:
            client = Client(process, JOINTS)
            memory(process, client, args.minutes)
            client.close()
        check(process, None, 0)
        if process.stop() != 0:
            raise SystemExit(f"the node ended with status {process.poll()}; its output:\n{process.output()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
