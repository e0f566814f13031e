"""Recordings, read and written by an independent library from PyPI; no node, no network."""

from __future__ import annotations

import csv
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

from node_process import node_binary
from virtual_axes_py.ros import NANOSECONDS, TSP_NS

JOINTS = ["x", "y", "z", "a", "c"]
TRACE_TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/virtual_axes/motor_currents": "virtual_axes/msg/MotorCurrents",
    "/virtual_axes/drive_states": "virtual_axes/msg/DriveStates",
}
COLUMNS = {
    "psec": ("/virtual_axes/drive_states", "psec"),
    "position": ("/joint_states", "position"),
    "velocity": ("/joint_states", "velocity"),
    "current": ("/virtual_axes/motor_currents", "current"),
    "current_setpoint": ("/virtual_axes/motor_currents", "current_setpoint"),
    "voltage": ("/virtual_axes/drive_states", "voltage"),
    "friction_current": ("/virtual_axes/motor_currents", "friction"),
}
"""Field of a recording for each column of a CSV trace."""
TRAJECTORY_DEFINITION = """std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint[] points
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
================================================================================
MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
"""


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs the command beside the node."""
    command = node_binary().with_name("virtual_axes")
    return subprocess.run([command, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)


def psec() -> list[list[float]]:
    """Returns rows of time, x and c on the position grid: x there and back by 4 mm, c by 0.3 rad."""
    rows = []
    for k in range(101):
        way = (1 - math.cos(2 * math.pi * k / 100)) / 2
        rows.append([k * TSP_NS / NANOSECONDS, 0.004 * way, -0.3 * way])
    return rows


def write_csv(path: Path, rows: list[list[float]]) -> Path:
    path.write_text("time,x,c\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows))
    return path


def read_csv(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


@pytest.fixture(scope="module")
def traces(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Returns the trace of one run as CSV and as MCAP."""
    folder = tmp_path_factory.mktemp("traces")
    points = write_csv(folder / "psec.csv", psec())
    for name in ("trace.csv", "trace.mcap"):
        done = run("run", points, "--trace", folder / name)
        assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["psec.csv", "trace.csv", "trace.mcap"]
    return folder / "trace.csv", folder / "trace.mcap"


def test_a_recorded_trace_is_the_csv_trace_field_by_field(traces: tuple[Path, Path]):
    """Every number of the CSV is in the recording, bit for bit, at its time; the other fields are consistent."""
    table = read_csv(traces[0])
    found: dict[str, list] = {topic: [] for topic in TRACE_TYPES}
    with traces[1].open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema.name == TRACE_TYPES[channel.topic]
            stamp = decoded.header.stamp.sec * NANOSECONDS + decoded.header.stamp.nanosec
            assert message.log_time == message.publish_time == stamp
            assert message.sequence == len(found[channel.topic])
            assert list(decoded.name) == JOINTS
            found[channel.topic].append((stamp, decoded))

    times = np.round(table["time"] * NANOSECONDS).astype(np.int64)
    assert len(times) > 101
    for topic, messages in found.items():
        assert [stamp for stamp, _ in messages] == times.tolist(), topic
    for index, joint in enumerate(JOINTS):
        for column, (topic, field) in COLUMNS.items():
            values = np.array([getattr(message, field)[index] for _, message in found[topic]])
            assert values.tobytes() == table[f"{joint}.{column}"].tobytes(), f"{joint}.{column}"
    assert np.ptp(table["x.position"]) > 0.0039 and np.ptp(table["c.position"]) > 0.29

    # Fields that CSV does not have are consistent with those that it has.
    for (_, state), (_, current), (_, drive) in zip(*(found[topic] for topic in TRACE_TYPES), strict=True):
        assert list(drive.position) == list(state.position)
        assert list(drive.velocity) == list(state.velocity)
        assert list(drive.controller) == ["cascade"] * len(JOINTS)
        np.testing.assert_array_equal(drive.tracking_error, np.subtract(drive.psec, drive.position))
        assert len(state.effort) == len(current.gravity) == len(current.load) == len(current.saturated) == len(JOINTS)
        assert not any(current.saturated) and not any(current.load)
    # Effort is the motor's force: Kt i / r, one ratio per axis.
    for index in (0, 4):
        efforts = np.array([state.effort[index] for _, state in found["/joint_states"]])
        currents = np.array([current.current[index] for _, current in found["/virtual_axes/motor_currents"]])
        moving = np.abs(currents) > 0.1
        assert moving.sum() > 50
        ratio = efforts[moving] / currents[moving]
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)


def test_a_recording_has_the_format_of_rosbag2(traces: tuple[Path, Path]):
    """Profile, encodings, counts, indexes, and the quality of service that `ros2 bag play` reads."""
    with traces[1].open("rb") as file:
        reader = make_reader(file)
        header, summary = reader.get_header(), reader.get_summary()
    assert header.profile == "ros2"
    assert summary is not None and summary.statistics is not None
    channels = summary.channels.values()
    assert {channel.topic: summary.schemas[channel.schema_id].name for channel in channels} == TRACE_TYPES
    counts = summary.statistics.channel_message_counts
    assert len({counts[channel.id] for channel in channels}) == 1
    assert summary.statistics.message_count == sum(counts.values())
    assert all(index.message_index_offsets for index in summary.chunk_indexes)
    for channel in channels:
        assert channel.message_encoding == "cdr"
        assert summary.schemas[channel.schema_id].encoding == "ros2msg"
        [profile] = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        forever = {"sec": 9223372036, "nsec": 854775807}
        assert profile == {
            "history": "keep_last",
            "depth": 10,
            "reliability": "reliable",
            "durability": "volatile",
            "deadline": forever,
            "lifespan": forever,
            "liveliness": "automatic",
            "liveliness_lease_duration": forever,
            "avoid_ros_namespace_conventions": False,
        }


def trajectory(rows: list[list[float]]) -> dict:
    """Returns a message in the form of the writer and `ros2 topic pub`."""
    points = []
    for time, *positions in rows:
        sec, nanosec = divmod(round(time * NANOSECONDS), NANOSECONDS)
        points.append({"positions": positions, "time_from_start": {"sec": sec, "nanosec": nanosec}})
    return {"joint_names": ["x", "c"], "points": points}


@pytest.mark.parametrize("compression", CompressionType)
def test_setpoints_from_a_foreign_recording_equal_those_from_csv(
    tmp_path: Path, traces: tuple[Path, Path], compression: CompressionType
):
    """A JointTrajectory recorded by another program gives the same trace, byte by byte."""
    recording = tmp_path / "psec.mcap"
    message = trajectory(psec())
    message["header"] = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    for point in message["points"]:
        point.update(velocities=[], accelerations=[], effort=[])
    with recording.open("wb") as file:
        writer = Writer(file, compression=compression)
        schema = writer.register_msgdef("trajectory_msgs/msg/JointTrajectory", TRAJECTORY_DEFINITION)
        writer.write_message("/mill/psec", schema, message, log_time=5, publish_time=5)
        writer.finish()
    done = run("run", recording, "--trace", tmp_path / "trace.csv")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "trace.csv").read_bytes() == traces[0].read_bytes()


def test_setpoints_as_yaml_equal_those_from_csv(tmp_path: Path, traces: tuple[Path, Path]):
    """YAML written by PyYAML gives the same trace."""
    for flow in (True, False):
        file = tmp_path / "psec.yaml"
        file.write_text(yaml.safe_dump(trajectory(psec()), default_flow_style=flow))
        done = run("run", file, "--trace", tmp_path / "trace.csv")
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "trace.csv").read_bytes() == traces[0].read_bytes()


def test_a_damaged_recording_is_rejected(tmp_path: Path, traces: tuple[Path, Path]):
    """The message names the file, and no partial output is left."""
    whole = traces[1].read_bytes()
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(whole[: len(whole) // 2])
    for file, words in ((damaged, "middle of a record"), (traces[1], "no message trajectory_msgs/msg/JointTrajectory")):
        done = run("run", file, "--trace", tmp_path / "trace.mcap")
        assert done.returncode == 2 and not done.stdout
        assert file.name in done.stderr and words in done.stderr
        assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["damaged.mcap"]
