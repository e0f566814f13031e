"""Smoke test of the installed package, the test that `colcon test` runs.

smoke.py PREFIX RESULT.xml     (in an environment with rclpy and the messages of PREFIX)

Checks programs, shared files and messages, starts the installed node in a domain of its own and submits a trajectory.
The result is a file in JUnit's format, which `colcon test-result` reads.
"""

from __future__ import annotations

import glob
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

PREFIX = Path(sys.argv[1])
RESULT = Path(sys.argv[2])
PROGRAMS = PREFIX / "lib" / "virtual_axes"
SHARE = PREFIX / "share" / "virtual_axes"
SHARED = (
    "package.xml",
    "config/mikron_ucp710.yaml",
    "config/scenarios/ballbar.yaml",
    "launch/virtual_axes.launch.py",
    "launch/two_machines.launch.py",
    "urdf/mikron_ucp710.urdf",
    "rviz/virtual_axes.rviz",
    "layouts/*",
)
DISCOVERY_S, MOTION_S, STOP_S = 20.0, 20.0, 10.0
"""Longest times for the node's discovery, a motion of 0.5 s, and the node's end."""


def programs() -> None:
    """Runs both installed programs with --version."""
    for name in ("virtual_axes_node", "virtual_axes"):
        done = subprocess.run([PROGRAMS / name, "--version"], capture_output=True, text=True, timeout=20, check=True)
        assert done.stdout.strip(), f"{name} --version: no output"


def shared_files() -> None:
    """Finds every folder's files in share."""
    missing = [name for name in SHARED if not glob.glob(str(SHARE / name))]
    assert not missing, f"not in {SHARE}: {', '.join(missing)}"


def messages() -> None:
    """Imports the generated messages from the installed package."""
    import virtual_axes.msg as generated

    assert Path(generated.__file__).is_relative_to(PREFIX), f"{generated.__file__} is not below {PREFIX}"
    for name in ("DriveStates", "MotorCurrents", "TrajectoryResult"):
        getattr(generated, name)()


def trajectory() -> None:
    """Starts the installed node, submits a trajectory and waits for its result."""
    # Not at the top: the module is not installed.
    from node_process import Node

    # Not the user's domain, nor one of another test; nothing leaves the machine.
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    for variable in ("ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY"):
        os.environ.pop(variable, None)
    with Node(binary=PROGRAMS / "virtual_axes_node") as node:
        os.environ["ROS_DOMAIN_ID"] = str(node.domain_id)
        submit(node.poll)
        status = node.stop(signal.SIGTERM, STOP_S)
    assert status == 0, f"the node ended with status {status}"


def submit(poll: Callable[[], int | None]) -> None:
    """Submits a motion of X over the topic psec and checks the first result."""
    import rclpy
    from builtin_interfaces.msg import Duration
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
    from virtual_axes.msg import TrajectoryResult

    rclpy.init()
    try:
        client = rclpy.create_node("smoke")
        results: list[TrajectoryResult] = []
        client.create_subscription(TrajectoryResult, "/virtual_axes/trajectory_result", results.append, 10)
        publisher = client.create_publisher(JointTrajectory, "/psec", 10)

        def wait(until: Callable[[], object], limit: float, what: str) -> None:
            end = time.monotonic() + limit
            while not until():
                assert poll() is None, f"the node ended with status {poll()}"
                assert time.monotonic() < end, f"no {what} within {limit:g} s"
                rclpy.spin_once(client, timeout_sec=0.1)

        wait(publisher.get_subscription_count, DISCOVERY_S, "subscription of psec")
        wait(lambda: client.count_publishers("/virtual_axes/trajectory_result"), DISCOVERY_S, "publisher of results")
        point = JointTrajectoryPoint(positions=[0.001], time_from_start=Duration(nanosec=500_000_000))
        publisher.publish(JointTrajectory(joint_names=["x"], points=[point]))
        wait(lambda: results, MOTION_S, "trajectory result")
        assert results[0].status == TrajectoryResult.ACCEPTED, results[0]
    finally:
        rclpy.try_shutdown()


def main() -> int:
    """Runs the checks and writes the result file."""
    cases, failures = [], 0
    for check in (programs, shared_files, messages, trajectory):
        began, failure = time.monotonic(), ""
        try:
            check()
        except Exception:
            text = traceback.format_exc()
            print(text, file=sys.stderr)
            failure = f"<failure message={quoteattr(text.splitlines()[-1])}>{escape(text)}</failure>"
            failures += 1
        seconds = time.monotonic() - began
        print(f"{check.__name__}: {'failed' if failure else 'ok'}, {seconds:.1f} s")
        cases.append(f'<testcase classname="smoke" name="{check.__name__}" time="{seconds:.3f}">{failure}</testcase>')
    RESULT.parent.mkdir(parents=True, exist_ok=True)
    suite = f'<testsuite name="smoke" tests="{len(cases)}" failures="{failures}" errors="0" skipped="0">'
    RESULT.write_text(f'<?xml version="1.0" encoding="UTF-8"?>\n{suite}{"".join(cases)}</testsuite>\n')
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
