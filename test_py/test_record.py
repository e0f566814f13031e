"""The node's own recording (parameter `record`), read by an independent library."""

from __future__ import annotations

import signal
import stat
import subprocess
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from control_msgs.msg import JointTrajectoryControllerState, SpeedScalingFactor
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from nav_msgs.msg import Path as ToolPath
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import DriveStates, MotorCurrents, TrajectoryResult

from node_process import Node, node_binary
from virtual_axes_py.ros import (
    DEEP_QOS,
    NANOSECONDS,
    RECORDING_KEYS,
    RESULT_QOS,
    TSP_NS,
    AxesClient,
    joint_trajectory,
    status_values,
)

MEGABYTE = 1_000_000
STATES, CURRENTS, DRIVES = "/joint_states", "/virtual_axes/motor_currents", "/virtual_axes/drive_states"
RESULTS = "/virtual_axes/trajectory_result"
SCALING = "/virtual_axes/speed_scaling_input"
KINDS = {
    "/psec": JointTrajectory,
    SCALING: SpeedScalingFactor,
    CURRENTS: MotorCurrents,
    DRIVES: DriveStates,
    RESULTS: TrajectoryResult,
    "/diagnostics": DiagnosticArray,
    "/rosout": Log,
    "/virtual_axes/controller_state": JointTrajectoryControllerState,
    "/virtual_axes/tool_pose": PoseStamped,
    "/virtual_axes/tool_path": ToolPath,
    "/virtual_axes/tool_path_setpoint": ToolPath,
}
"""Message types other than sensor_msgs/JointState."""
NOT_RECORDED = {"/parameter_events"}
"""Topics of the parameter services, which every node has."""


@dataclass
class Entry:
    """Message of a recording."""

    log: int
    publish: int
    data: bytes


def read(path: Path, whole: bool = True) -> tuple[dict[str, list[Entry]], dict[str, Any], dict[str, Any]]:
    """Returns messages, channels and types by topic, with decoding; an incomplete file is read up to its end."""
    messages: dict[str, list[Entry]] = defaultdict(list)
    channels: dict[str, Any] = {}
    types: dict[str, str] = {}
    decoded = 0
    decoders = DecoderFactory()
    with path.open("rb") as file:
        reader = NonSeekingReader(file, validate_crcs=True, decoder_factories=[decoders])
        try:
            for schema, channel, message, value in reader.iter_decoded_messages(log_time_order=False):
                channels[channel.topic], types[channel.topic] = channel, schema.name
                assert message.sequence == len(messages[channel.topic])
                messages[channel.topic].append(Entry(message.log_time, message.publish_time, message.data))
                decoded += value is not None
        except EndOfFile:
            assert not whole
        else:
            assert whole
    assert decoded == sum(map(len, messages.values()))
    if whole:
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            summary = reader.get_summary()
            assert reader.get_header().profile == "ros2"
        assert summary.statistics.message_count == decoded
        channels = {channel.topic: channel for channel in summary.channels.values()}
        types = {channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()}
    return messages, channels, types


def text(topic: str, data: bytes) -> str:
    """Returns all values of a message, each float to its last bit, without CDR padding."""
    return repr(deserialize_message(data, KINDS.get(topic, JointState)))


def stamps(entries: list[Entry]) -> np.ndarray:
    """Returns publish times, ns."""
    return np.array([entry.publish for entry in entries], dtype=np.int64)


def recording_status(drive: AxesClient) -> DiagnosticStatus | None:
    """Returns the newest diagnostics of the recording."""
    for message in reversed(drive.diagnostics()):
        for status in message.status:
            if status.name == f"{drive.target}: recording":
                return status
    return None


@dataclass
class Session:
    """Recording of all topics, with the messages sent and received meanwhile."""

    path: Path
    sent: dict[str, list[bytes]]
    received_messages: dict[str, list[bytes]]
    offered: dict[str, tuple[str, ReliabilityPolicy, DurabilityPolicy]]
    """Type and profile of each topic in the graph."""
    status: DiagnosticStatus
    exit: int
    output: str


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    """Yields a recording of a real-time node that is moved, streamed to, loaded, and ended by SIGTERM."""
    path = tmp_path_factory.mktemp("record") / "session.mcap"
    with Node(["-p", f"record:={path}", "-p", "qos.drive_states.depth:=7"]) as process:
        drive = AxesClient(process=process)
        received_messages: dict[str, list[bytes]] = {
            topic: [] for topic in KINDS if topic not in ("/psec", SCALING, CURRENTS, DRIVES)
        }
        for topic, store in received_messages.items():
            profile = RESULT_QOS if topic in (RESULTS, "/rosout") else DEEP_QOS
            drive.node.create_subscription(KINDS[topic], topic, drive._keep(store), profile, raw=True)
        sent: dict[str, list[bytes]] = {"/psec": [], "/psec_stream": [], "/load": []}
        trajectory = joint_trajectory(["x", "c"], [0.0, 0.4], [[0.0, 0.0], [0.004, 0.1]])
        drive.run(trajectory, settle=0.1)
        sent["/psec"].append(serialize_message(trajectory))
        scaling = drive.in_executor(lambda: drive.node.create_publisher(SpeedScalingFactor, SCALING, 10))
        drive.wait_for(scaling.get_subscription_count, 20, SCALING)
        sent[SCALING] = []
        for k in range(20):
            # More than one: the subscription can find its publisher later than the publisher finds it.
            scaling.publish(SpeedScalingFactor(factor=0.5))
            sent[SCALING].append(serialize_message(SpeedScalingFactor(factor=0.5)))
            drive.stream(["x"], [0.004 + 1e-6 * k])
            sent["/psec_stream"].append(serialize_message(JointState(name=["x"], position=[0.004 + 1e-6 * k])))
            drive.load({"y": float(k)})
            sent["/load"].append(serialize_message(JointState(name=["y"], effort=[float(k)])))
            time.sleep(0.01)
        drive.wait_for(lambda: all(received_messages.values()), 10, "every topic")
        status = drive.wait_for(lambda: recording_status(drive), 10, "diagnostics of the recording")
        offered = {}
        name, namespace = drive.target.rsplit("/", 1)[1], drive.target.rsplit("/", 1)[0] or "/"
        for of_node, infos in (
            (drive.node.get_publisher_names_and_types_by_node, drive.node.get_publishers_info_by_topic),
            (drive.node.get_subscriber_names_and_types_by_node, drive.node.get_subscriptions_info_by_topic),
        ):
            for topic, (kind, *_) in of_node(name, namespace):
                # The action's topics are hidden: its result is on `~/trajectory_result`.
                if topic in NOT_RECORDED or "/_action/" in topic:
                    continue
                profiles_found = [info.qos_profile for info in infos(topic) if info.node_name == name]
                # The feed override is received from publishers of both durabilities.
                of_topic = {(qos.reliability, qos.durability) for qos in profiles_found}
                assert len(of_topic) == (2 if topic.endswith("/speed_scaling_input") else 1), topic
                offered[topic] = (kind, *min(of_topic, key=lambda profile: profile[1] != DurabilityPolicy.VOLATILE))
        drive.process = None
        exit_status = process.stop(signal.SIGTERM)
        drive.wait_for(lambda: not drive.is_in_graph(), 5, "dispose")
        for topic, key in ((STATES, "joints"), (CURRENTS, "currents"), (DRIVES, "states")):
            received_messages[topic] = list(drive._samples[key])
        drive.close()
        yield Session(path, sent, received_messages, offered, status, exit_status, process.output())


def test_every_topic_is_recorded_with_its_type_and_profile(session: Session):
    """Recorded topics equal the node's topics in the graph."""
    assert session.exit == 0, session.output
    messages, channels, types = read(session.path)
    wanted = session.offered
    assert len(wanted) >= 9
    assert types == {topic: kind for topic, (kind, *_) in wanted.items()}
    for topic, (_, reliability, durability) in wanted.items():
        (profile,) = yaml.safe_load(channels[topic].metadata["offered_qos_profiles"])
        assert profile["reliability"] == reliability.name.lower(), topic
        assert profile["durability"] == durability.name.lower(), topic
        assert profile["history"] == "keep_last" and profile["depth"] >= 1
    assert not [topic for topic in wanted if not messages[topic]]
    (profile,) = yaml.safe_load(channels[DRIVES].metadata["offered_qos_profiles"])
    assert profile["depth"] == 7


def test_published_messages_are_recorded_bit_for_bit(session: Session):
    """A subscriber's samples are in the recording, in order, without gaps."""
    messages, _, _ = read(session.path)
    assert set(session.received_messages) | set(session.sent) == set(messages)
    for topic, received in session.received_messages.items():
        received = [text(topic, data) for data in received]
        recorded = [text(topic, entry.data) for entry in messages[topic]]
        # A transient local publisher may send old samples first.
        first = recorded.index(received[0])
        assert recorded[first : first + len(received)] == received, topic
        assert len(received) > 0
    assert len(session.received_messages[DRIVES]) > 100


def test_received_messages_are_recorded_bit_for_bit(session: Session):
    """Received messages are recorded bit for bit, at the node's time of receipt."""
    messages, _, _ = read(session.path)
    for topic, sent in session.sent.items():
        received = messages[topic]
        sent = [text(topic, data) for data in sent]
        found = [text(topic, entry.data) for entry in received]
        if topic == "/psec":
            assert found == sent
        else:  # Best effort, or reliable with a depth of one.
            remaining = iter(sent)
            assert found and all(message in remaining for message in found), topic
        assert all(entry.publish == entry.log for entry in received), "the messages had no stamps"
    began, ended = (messages[DRIVES][index].log for index in (0, -1))
    assert all(began <= entry.log <= ended for topic in session.sent for entry in messages[topic])


def test_publish_times_are_the_stamps(session: Session):
    """Publish times are stamps, not after the log times; the grid of position cycles is unbroken."""
    messages, _, _ = read(session.path)
    for topic in (STATES, CURRENTS, DRIVES):
        times = stamps(messages[topic])
        assert set(np.diff(times)) == {TSP_NS}
        assert all(entry.log >= entry.publish for entry in messages[topic])
        assert to_ns_of(messages[topic][0].data) == times[0]


def to_ns_of(data: bytes) -> int:
    """Returns the stamp of a message with a header (CDR, little endian)."""
    return int.from_bytes(data[4:8], "little") * NANOSECONDS + int.from_bytes(data[8:12], "little")


def test_the_diagnostics_and_the_log_report_the_recording(session: Session):
    """They report the file, and that nothing is missing."""
    found = status_values(session.status)
    assert session.status.level == DiagnosticStatus.OK and found["recording"] == "true"
    assert list(found) == RECORDING_KEYS
    assert found["file"] == str(session.path) and found["left_out"] == "0"
    messages, _, _ = read(session.path)
    assert f"{sum(map(len, messages.values()))} messages, 0 left out" in session.output


def test_the_command_reads_setpoints_from_the_recording(session: Session):
    """`virtual_axes run` accepts the recording."""
    command = node_binary().with_name("virtual_axes")
    done = subprocess.run([command, "run", session.path], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


def test_a_recording_of_a_killed_node_is_readable_up_to_its_last_chunk(
    start: Callable[..., AxesClient], tmp_path: Path
):
    """SIGKILL: all messages up to it, unbroken; identify reads them and reports the truncation."""
    path = tmp_path / "killed.mcap"
    drive = start("-p", f"record:={path}")
    until = drive.now()

    def is_written() -> bool:
        return any(entry.publish >= until for entry in read(path, whole=False)[0][DRIVES])

    drive.wait_for(is_written, 20, "chunk on the disk")
    process, drive.process = drive.process, None
    process.stop(signal.SIGKILL)
    messages, _, _ = read(path, whole=False)
    for topic in (STATES, CURRENTS, DRIVES):
        times = stamps(messages[topic])
        assert times[-1] >= until - TSP_NS and set(np.diff(times)) == {TSP_NS}
    command = [node_binary().with_name("virtual_axes"), "identify", path, "--axis", "x"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert "its writer was terminated" in done.stdout + done.stderr


def test_a_recording_ends_at_its_maximum_size_and_the_axes_continue(start: Callable[..., AxesClient], tmp_path: Path):
    """At 1 MB the file is closed, complete and reported; in `fast` no earlier message is missing."""
    path = tmp_path / "bounded.mcap"
    drive = start("-p", f"record:={path}", "-p", "record_max_mb:=1", "-p", "time:=fast")
    # Setpoints with little compressibility.
    noise = np.random.default_rng(1).uniform(-1e-4, 1e-4, (4000, 2))
    times = np.arange(1, len(noise) + 1) * (2 * TSP_NS / NANOSECONDS)
    drive.run(joint_trajectory(["x", "y"], times, noise), timeout=120)
    ended = drive.wait_for(
        lambda: (status := recording_status(drive)) and status_values(status)["recording"] == "false" and status,
        20,
        "end of the recording",
    )
    assert ended.level == DiagnosticStatus.WARN
    assert ended.message == "recording has ended: it has reached 1 MB"

    def left_out(status: DiagnosticStatus) -> int:
        return int(status_values(status)["left_out"])

    drive.wait_for(lambda: left_out(recording_status(drive)) > left_out(ended), 10, "more")
    assert 0.9 * MEGABYTE < path.stat().st_size <= MEGABYTE
    messages, _, types = read(path)
    assert types["/clock"] == "rosgraph_msgs/msg/Clock" and len(messages["/clock"]) > 100
    last = [stamps(messages[topic])[-1] for topic in (STATES, CURRENTS, DRIVES)]
    assert all(set(np.diff(stamps(messages[topic]))) == {TSP_NS} for topic in (STATES, CURRENTS, DRIVES, "/clock"))
    assert max(last) - min(last) <= TSP_NS
    assert str(sum(map(len, messages.values()))) == status_values(ended)["messages"]
    assert drive.process.output().count("has ended: it has reached 1 MB; the axes go on") == 1


def test_a_failed_write_ends_the_recording_but_not_the_node(tmp_path: Path):
    """A file size limit of 1000 KiB, more than one chunk, acts like a full disk: the data before stay readable.

    One log line reports it, and the next recording is complete.
    """
    path, binary = tmp_path / "full.mcap", tmp_path / "limited.sh"
    binary.write_text(f'#!/bin/bash\ntrap "" XFSZ\nulimit -f 1000\nexec {node_binary()} "$@"\n')
    binary.chmod(binary.stat().st_mode | stat.S_IXUSR)
    ros_args = ["-p", f"record:={path}", "-p", "time:=fast"]
    with Node(ros_args, binary=binary) as process, AxesClient(process=process) as drive:
        noise = np.random.default_rng(1).uniform(-1e-4, 1e-4, (3000, 2))
        times = np.arange(1, len(noise) + 1) * (2 * TSP_NS / NANOSECONDS)
        result = drive.run(joint_trajectory(["x", "y"], times, noise), timeout=120).result
        assert result.status == TrajectoryResult.COMPLETED
        ended = drive.wait_for(
            lambda: (status := recording_status(drive)) and status_values(status)["recording"] == "false" and status,
            20,
            "end of the recording",
        )
        assert "too large" in ended.message and ended.level == DiagnosticStatus.WARN
        last = drive.now()
        drive.wait_until(last + 10 * TSP_NS, 10)
        assert process.stop(signal.SIGTERM) == 0
        assert process.output().count("the axes go on") == 1
    assert path.stat().st_size <= 1000 * 1024
    messages, _, _ = read(path, whole=False)
    assert len(messages[DRIVES]) > 0 and set(np.diff(stamps(messages[DRIVES]))) <= {TSP_NS}
    again = tmp_path / "again.mcap"
    with (
        Node(["-p", f"record:={again}", "-p", "time:=fast"], binary=binary) as process,
        AxesClient(process=process) as drive,
    ):
        drive.wait_until(drive.now() + 100 * TSP_NS, 20)
        assert process.stop(signal.SIGTERM) == 0
    assert len(read(again)[0][DRIVES]) > 100


def rejection(record: object) -> str:
    """Starts a node that must reject the recording path: returns its output, with status 2."""
    with Node(["-p", f"record:={record}"]) as process:
        assert process.wait(10) == 2, process.output()
        return process.output()


def test_an_invalid_recording_path_is_rejected(tmp_path: Path):
    """An existing file stays unchanged; a missing or read-only folder is named."""
    existing = tmp_path / "old.mcap"
    existing.write_text("kept")
    assert f"record: {existing} exists already" in rejection(existing)
    assert existing.read_text() == "kept"
    missing = tmp_path / "missing" / "new.mcap"
    assert f"in the folder {missing.parent}: No such file" in rejection(missing)
    assert f"in the folder {existing}: Not a directory" in rejection(existing / "new.mcap")
    # A folder in which no file can be created.
    assert "in the folder /proc: " in rejection("/proc/new.mcap")
    assert f"record: {tmp_path / 'new.csv'}: a recording is an MCAP file" in rejection(tmp_path / "new.csv")
    assert list(tmp_path.iterdir()) == [existing]
