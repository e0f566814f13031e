"""Nodes and an rclpy process whose participants are created at the same time.

`Trial` starts both and compares the endpoints that the process discovers with those of `expected_endpoints`.
`tools/measure.py simultaneous-start` runs many trials, a test a few. The process is this file as a program:

    python test_py/simultaneous_start.py

It reads a line with the domain id, the number of nodes, the delay of its participant in s, the expected number of
endpoints of a node (0: that of the first report) and a timeout in s, and writes one line of JSON.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import time
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass

from line_process import LineProcess
from node_process import DomainId, Node, separate_output

RUSTDDS = bytes([0x01, 0x12])
"""Vendor id of the nodes, in front of their GUIDs."""
PORT_TIMEOUT_S = 30.0
"""Timeout for the first participant of the nodes, s."""
TIMEOUT_S = 15.0
"""Time after which undiscovered endpoints count as lost, s: more than the 10 s between two announcements of a node."""
SETTLE_S = 2.0
"""Time in which a process that starts after a node discovers all endpoints, s."""


@dataclass
class Discovered:
    """Endpoints that the process has discovered."""

    endpoints: dict[str, int]
    """Number of endpoints by participant of a node."""
    publishing: int
    """Number of nodes of which a sample of joint_states arrived."""


@dataclass
class Trial:
    """Start of `nodes` nodes and of a process whose participant follows the first of them by `delay` s."""

    nodes: int
    delay: float
    expected: int
    """Endpoints of a node."""

    def run(self) -> Discovered:
        """Runs the trial."""
        domain = DomainId()
        try:
            with ExitStack() as stack:
                observer = stack.enter_context(observing())
                observer.go_on(domain.value, self.nodes, self.delay, self.expected, TIMEOUT_S)
                for number in range(self.nodes):
                    stack.enter_context(Node(["-r", f"__ns:=/n{number}"], domain_id=domain.value))
                return discovered_by(observer)
        finally:
            domain.release()

    def faults(self, found: Discovered) -> list[str]:
        """Returns the differences from complete discovery."""
        counts = sorted(found.endpoints.values(), reverse=True)
        counts += [0] * (self.nodes - len(counts))
        faults = [f"{count} of {self.expected} endpoints of a node" for count in counts if count != self.expected]
        if found.publishing != self.nodes:
            faults.append(f"joint_states of {found.publishing} of {self.nodes} nodes")
        return faults


def expected_endpoints() -> int:
    """Returns the number of endpoints of a node, as discovered by a process that starts after it."""
    domain = DomainId()
    try:
        with observing() as observer, Node(["-r", "__ns:=/n0"], domain_id=domain.value):
            observer.go_on(domain.value, 1, SETTLE_S, 0, SETTLE_S)
            [count] = discovered_by(observer).endpoints.values()
            return count
    finally:
        domain.release()


def observing() -> LineProcess:
    """Starts the process and waits until rclpy is loaded; its participant has not been created yet."""
    observer = LineProcess(__file__)
    observer.read_line()
    return observer


def discovered_by(observer: LineProcess) -> Discovered:
    """Returns the result of the observation."""
    return Discovered(**json.loads(observer.read_line()))


# ---------------------------------------------------------------------------------------------------- the process


def wait_for_participant(domain_id: int) -> None:
    """Waits until the first participant of a domain has opened its discovery port."""
    port = 7400 + 250 * domain_id + 10
    deadline = time.monotonic() + PORT_TIMEOUT_S
    while time.monotonic() < deadline:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", port))
            except OSError:
                return
        time.sleep(0.0002)
    raise TimeoutError(f"no participant in domain {domain_id}")


def main() -> None:
    """Creates a participant at the given time and reports the endpoints that it discovers."""
    import rclpy
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import JointState

    separate_output()
    print("ready", flush=True)
    domain_id, nodes, delay, expected, timeout = map(float, sys.stdin.readline().split())
    os.environ["ROS_DOMAIN_ID"] = str(int(domain_id))
    wait_for_participant(int(domain_id))
    time.sleep(delay)
    rclpy.init()
    began = time.monotonic()
    node = rclpy.create_node("observer")
    publishing: set[int] = set()
    for number in range(int(nodes)):

        def note(_: JointState, number: int = number) -> None:
            publishing.add(number)

        node.create_subscription(JointState, f"/n{number}/joint_states", note, qos_profile_sensor_data)

    def discovered() -> Counter[str]:
        found: Counter[str] = Counter()
        for topic, _ in node.get_topic_names_and_types(no_demangle=True):
            of_topic = [
                *node.get_publishers_info_by_topic(topic, no_mangle=True),
                *node.get_subscriptions_info_by_topic(topic, no_mangle=True),
            ]
            gids = [bytes(info.endpoint_gid) for info in of_topic]
            found.update(gid[:12].hex() for gid in gids if gid[:2] == RUSTDDS)
        return found

    def is_complete() -> bool:
        counts = list(discovered().values())
        return expected > 0 and counts == [expected] * int(nodes) and len(publishing) == nodes

    while time.monotonic() < began + timeout and not is_complete():
        next_poll = time.monotonic() + 0.1
        while (left := next_poll - time.monotonic()) > 0:
            rclpy.spin_once(node, timeout_sec=left)
    print(json.dumps({"endpoints": discovered(), "publishing": len(publishing)}), flush=True)


if __name__ == "__main__":
    main()
