"""Two hosts: network namespaces with a link between them, the node in one and rclpy in the other.

`Link` creates and removes both. The rclpy side is this file as a program, in the second namespace:

    python test_py/two_hosts.py NODE COMMAND

    watch SECONDS      receives joint_states
    move POINTS        executes a trajectory of a second, then submits one of POINTS points, which is accepted
    silence SECONDS    receives joint_states, waits for a line on standard input, and receives them again

It writes one line of JSON for each step. Needs root, iproute2 and iptables.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from line_process import PATIENCE_S, LineProcess  # noqa: E402
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, to_ns  # noqa: E402

NODE_ADDRESS, CLIENT_ADDRESS = "10.79.0.1", "10.79.0.2"
DISCOVERY_S = 60.0
"""Timeout for discovery, s: with 20 % of the datagrams lost it takes several announcements."""
ACCEPTANCE_S = 120.0
"""Timeout for the acceptance of a long trajectory, s."""


def run(*words: object) -> None:
    """Runs a command; raises CalledProcessError with its output."""
    subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True)


def reason_to_skip() -> str | None:
    """Returns the reason for which namespaces cannot be created, or None."""
    missing = [program for program in ("ip", "iptables") if shutil.which(program) is None]
    if missing:
        return f"not installed: {', '.join(missing)}"
    name = f"va{os.getpid()}t"
    try:
        run("ip", "netns", "add", name)
    except subprocess.CalledProcessError as error:
        return f"ip netns add: {error.stderr.strip()}"
    run("ip", "netns", "delete", name)
    return None


class Link:
    """Two namespaces, connected by a veth pair."""

    def __init__(self, loss: float = 0.0, multicast: bool = True):
        """Sets the share of datagrams that each side drops, and if multicast passes."""
        self.loss, self.multicast = loss, multicast
        self.names = (f"va{os.getpid()}a", f"va{os.getpid()}b")

    def __enter__(self) -> Link:
        """Creates the namespaces."""
        first, second = self.names
        for name in self.names:
            run("ip", "netns", "add", name)
        run("ip", "link", "add", first, "netns", first, "type", "veth", "peer", "name", second, "netns", second)
        for name, address in zip(self.names, (NODE_ADDRESS, CLIENT_ADDRESS)):
            self._ip(name, "address", "add", f"{address}/24", "dev", name)
            self._ip(name, "link", "set", "lo", "up")
            self._ip(name, "link", "set", name, "up")
            self._ip(name, "route", "add", "224.0.0.0/4", "dev", name)
            if not self.multicast:
                self._drop(name, "-d", "224.0.0.0/4")
            if self.loss:
                # In INPUT, fragments of a datagram have been joined: whole datagrams are dropped.
                self._drop(name, "-m", "statistic", "--mode", "random", "--probability", self.loss)
        return self

    def __exit__(self, *_: object) -> None:
        """Deletes the namespaces, with the link."""
        for name in self.names:
            subprocess.run(["ip", "netns", "delete", name], check=False, capture_output=True)

    @property
    def node_prefix(self) -> list[str]:
        """Returns the command that executes a program on the first host."""
        return ["ip", "netns", "exec", self.names[0]]

    def set_up(self, is_up: bool) -> None:
        """Takes the link down or up again."""
        self._ip(self.names[0], "link", "set", self.names[0], "up" if is_up else "down")
        if is_up:
            # The kernel has removed it with the link.
            self._ip(self.names[0], "route", "replace", "224.0.0.0/4", "dev", self.names[0])

    def client(self, domain_id: int, node: str, *words: object, env: dict[str, str] | None = None) -> LineProcess:
        """Starts the rclpy process on the second host."""
        settings = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_DOMAIN_ID": str(domain_id), **(env or {})}
        return LineProcess(__file__, node, *words, env=settings, prefix=["ip", "netns", "exec", self.names[1]])

    def _ip(self, name: str, *words: object) -> None:
        run("ip", "-n", name, *words)

    def _drop(self, name: str, *match: object) -> None:
        run("ip", "netns", "exec", name, "iptables", "-A", "INPUT", "-i", name, *match, "-j", "DROP")


# ----------------------------------------------------------------------------------------------------- the client


def write(**result: object) -> None:
    """Writes the result of a step."""
    print(json.dumps(result), flush=True)


def watch(drive: AxesClient, seconds: float) -> dict[str, int]:
    """Receives samples for `seconds`; returns their number and that of the missing ones."""
    start = drive.now()
    end = start + round(seconds * NANOSECONDS)
    drive.wait_until(end, seconds + PATIENCE_S / 2)
    stamps = drive.record(start, end).joints.stamp
    return {"received": len(stamps), "missing": round((stamps[-1] - stamps[0]) / TSP_NS) + 1 - len(stamps)}


def move(drive: AxesClient, points: int) -> None:
    """Executes a short trajectory; then submits one of `points` points, at 0.5 s each, and stops it."""
    # The node sends its decision again when it has discovered the client's reader, which takes longer if datagrams are
    # lost.
    accepted = drive.accept(joint_trajectory(["x"], [0.0, 1.0], [[0.0], [0.01]]), ACCEPTANCE_S)
    drive.end(accepted.sequence_number, PATIENCE_S / 2)
    start = to_ns(accepted.start)
    end = start + round(1.5 * NANOSECONDS)
    drive.wait_until(end, PATIENCE_S / 2)
    recording = drive.record(start, end)
    gaps = [gap for gap in recording.joints.stamp[1:] - recording.joints.stamp[:-1] if gap != TSP_NS]
    write(position=drive.latest()["x"], gaps=len(gaps))
    began = time.monotonic()
    times = [0.5 * index for index in range(points)]
    drive.accept(joint_trajectory(["y"], times, [[0.0]] * points), ACCEPTANCE_S)
    seconds = time.monotonic() - began
    stop(drive)
    write(seconds=seconds)


def stop(drive: AxesClient) -> None:
    """Stops the axes; repeats the request up to twice.

    The node sends a response after a second even if it has not discovered the client's reader for it, which takes
    longer if datagrams are lost. By the next request, it has.
    """
    for _ in range(2):
        with contextlib.suppress(TimeoutError):
            drive.stop(10.0)
            return
    drive.stop(10.0)


def main() -> None:
    """Runs the command."""
    node, command, value = sys.argv[1:]
    began = time.monotonic()
    with AxesClient(node, timeout=DISCOVERY_S) as drive:
        write(discovered_s=time.monotonic() - began)
        if command == "move":
            move(drive, int(value))
            return
        write(**watch(drive, float(value)))
        if command == "silence":
            sys.stdin.readline()
            drive.wait_until(drive.now() + NANOSECONDS, PATIENCE_S)
            write(**watch(drive, float(value)))


if __name__ == "__main__":
    main()
