"""Log on stderr and on /rosout, in the format of ROS nodes, without messages of the middleware."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import DescribeParameters
from rclpy.qos import DurabilityPolicy, QoSProfile

from node_process import Node
from virtual_axes_py.ros import AxesClient, joint_trajectory

ROSOUT_QOS = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PIPE_BYTES = 4096
"""Maximum size of an atomic write to a pipe on Linux."""
IN_THE_CELL = ("-r", "__ns:=/cell", "-r", "__node:=mill")
LINE = re.compile(r"\[(?P<level>[A-Z]+)\] \[(?P<stamp>\d+\.\d{9})\] \[(?P<logger>[\w.]+)\]: (?P<text>.*)")


def rosout(drive: AxesClient) -> list[Log]:
    """Returns the messages on /rosout from now on, and those kept for late joiners."""
    found: list[Log] = []
    drive.node.create_subscription(Log, "/rosout", found.append, ROSOUT_QOS)
    return found


def reject_one(drive: AxesClient) -> None:
    """Sends a trajectory that is rejected, which is logged as a warning."""
    result = drive.decision(drive.send(joint_trajectory(["no_such_joint"], [1.0], [[0.0]])))
    assert result.code != 0


def lines(process: Node) -> list[re.Match[str]]:
    """Returns the log on the terminal; no other output may follow the start screen."""
    text = process.output()
    log = text[text.index("stop with Ctrl-C") :].splitlines()[1:]
    found = [LINE.fullmatch(line) for line in log]
    assert None not in found, text
    return [match for match in found if match]


def test_levels_logger_and_time(start: Callable[..., AxesClient]):
    """INFO 20, WARN 30, ERROR 40, with the logger name that rclpy uses for this node, also for late joiners."""
    began = time.time()
    drive = start(*IN_THE_CELL, name="/cell/mill")
    process = drive.process
    drive.reset()
    reject_one(drive)
    names = (drive.list_parameters() * 4)[:1000]
    with pytest.raises(TimeoutError):
        drive.call(DescribeParameters, "describe_parameters", DescribeParameters.Request(names=names), timeout=0.5)
    # Late joiner: all three messages are history.
    found = rosout(drive)
    drive.wait_for(lambda: len(found) >= 3, 5, "messages on /rosout")
    words = ("at rest at home", "no_such_joint", "no response of")
    logged = {(message.level, word) for message in found for word in words if word in message.msg}
    assert logged == {(20, "at rest at home"), (30, "no_such_joint"), (40, "no response of")}
    assert (Log.INFO, Log.WARN, Log.ERROR) == (20, 30, 40)
    # The terminal has the same texts.
    shown = {match["text"]: (match["level"], match["logger"]) for match in lines(process)}
    level_names = {20: "INFO", 30: "WARN", 40: "ERROR"}
    assert shown == {message.msg: (level_names[message.level], message.name) for message in found}
    # Logger name of such a node in rclpy; from here on both nodes log a duplicate node name.
    twin = rclpy.create_node("mill", namespace="/cell", context=drive.node.context, start_parameter_services=False)
    try:
        assert {message.name for message in found} == {twin.get_logger().name}
    finally:
        twin.destroy_node()
    for message in found:
        stamp = message.stamp.sec + message.stamp.nanosec / 1e9
        assert began - 1 <= stamp <= time.time()


def test_level_of_one_logger(start: Callable[..., AxesClient]):
    """--log-level name:=level applies to the terminal and to /rosout."""
    drive = start(*IN_THE_CELL, "--log-level", "cell.mill:=error", name="/cell/mill")
    found = rosout(drive)
    drive.wait_for(lambda: drive.node.count_publishers("/rosout") > 0, 5, "publisher of /rosout")
    reject_one(drive)
    time.sleep(0.3)
    assert found == [] and lines(drive.process) == []


def test_a_duplicate_node_name_is_logged(start: Callable[..., AxesClient]):
    """Each of the two logs it once, and only if the namespace is equal, too."""
    first = start(*IN_THE_CELL, name="/cell/mill")
    domain = first.process.domain_id
    start(*IN_THE_CELL[2:], name="/mill", domain_id=domain)
    assert "named /" not in first.process.output()
    second = start(*IN_THE_CELL, name="/cell/mill", domain_id=domain, connect=False)
    for drive in (first, second):
        drive.wait_for(lambda drive=drive: "named /cell/mill" in drive.process.output(), 5, "warning")
        warnings = [match["text"] for match in lines(drive.process) if match["level"] == "WARN"]
        assert len(warnings) == 1, warnings


# ------------------------------------------------------------------------------------------- noise

# A participant whose lease expires 1 s after its last announcement, not after the usual 20 s.
SHORT_LEASE = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="short" is_default_profile="true"><rtps><builtin><discovery_config>
    <leaseDuration><sec>1</sec></leaseDuration>
    <leaseAnnouncement><sec>0</sec><nanosec>300000000</nanosec></leaseAnnouncement>
  </discovery_config></builtin></rtps></participant>
</profiles>
"""
# A node that publishes and subscribes until it is killed.
GUEST = """
import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

rclpy.init()
node = rclpy.create_node("participant")
psec = node.create_publisher(JointTrajectory, "/psec", 10)
node.create_publisher(JointState, "/psec_stream", 10)
node.create_subscription(JointState, "/joint_states", lambda _: psec.publish(JointTrajectory()), 10)
rclpy.spin_once(node)
print("matched", flush=True)
rclpy.spin(node)
"""


def killed_participant(domain_id: int, profile: Path, failures: list[Any]) -> None:
    """Starts participants that are killed, without dispose or unregister."""
    env = {**os.environ, "ROS_DOMAIN_ID": str(domain_id), "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile)}
    with subprocess.Popen([sys.executable, "-c", GUEST], env=env, stdout=subprocess.PIPE, text=True) as participant:
        bounded = threading.Timer(20, participant.kill)
        bounded.start()
        ready = participant.stdout.readline() if participant.stdout else ""
        bounded.cancel()
        participant.kill()
    if ready != "matched\n":
        failures.append(ready)


def test_the_middleware_is_quiet(start: Callable[..., AxesClient], tmp_path: Path):
    """From start to end, while participants join, leave, and are killed."""
    drive = start()
    process = drive.process
    found = rosout(drive)
    profile = tmp_path / "profile.xml"
    profile.write_text(SHORT_LEASE)
    failures: list[Any] = []
    participants = [
        threading.Thread(target=killed_participant, args=(process.domain_id, profile, failures)) for _ in range(2)
    ]
    for participant in participants:
        participant.start()
    for _ in range(3):
        with AxesClient(process=process) as other:
            other.list_parameters()
    for participant in participants:
        participant.join(30)
    assert not failures
    # Wait for the expiry of their leases.
    drive.wait_for(lambda: drive.node.count_subscribers("/joint_states") == 1, 10, "end of the participants")
    time.sleep(1.0)
    drive.process = None
    assert process.stop() == 0
    # Only INFO messages of the node's own logger: requests of the participants and the end.
    logged = lines(process)
    assert {(match["level"], match["logger"]) for match in logged} == {("INFO", "virtual_axes")}, [m[0] for m in logged]
    assert {(message.level, message.name) for message in found} == {(20, "virtual_axes")}, [m.msg for m in found]


@contextmanager
def full_pipe() -> Iterator[tuple[int, int]]:
    """Yields both ends of a pipe that is full until it is read."""
    read, write = os.pipe()
    try:
        os.set_blocking(write, False)
        with pytest.raises(BlockingIOError):
            while True:
                os.write(write, b"\n" * PIPE_BYTES)
        os.set_blocking(write, True)
        yield read, write
    finally:
        os.close(write)
        os.close(read)


def test_a_full_stderr_pipe_does_not_stop_the_node():
    """stderr is a full pipe; a later reader finds the messages of the meantime."""
    with full_pipe() as (read, write):
        os.set_blocking(read, False)
        with Node(stderr=write) as process, AxesClient(process=process) as drive:
            reject_one(drive)
            # The axes thread itself logs that it was late.
            os.kill(process.pid, signal.SIGSTOP)
            time.sleep(1.3)
            os.kill(process.pid, signal.SIGCONT)
            accepted = drive.accept(joint_trajectory(["x"], [0.5], [[0.001]], [[0.0]]))
            assert drive.end(accepted.sequence_number, 20).status == 2
            text = ""

            def is_logged() -> bool:
                nonlocal text
                try:
                    text += os.read(read, PIPE_BYTES).decode()
                except BlockingIOError:
                    pass
                return "no_such_joint" in text and "the node stalled" in text

            drive.wait_for(is_logged, 10, "log")
            assert process.stop() == 0


def test_a_full_stderr_pipe_does_not_delay_the_end_of_the_node():
    """The node waits for a reader only for a short time."""
    with full_pipe() as (_, write):
        with Node(stderr=write) as process, AxesClient(process=process):
            assert process.stop() == 0
