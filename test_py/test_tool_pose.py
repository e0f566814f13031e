"""The tool in the workpiece frame: `~/tool_pose`, `~/tool_path` and `~/tool_path_setpoint`."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path

from node_process import Node
from reference_kinematics import OFFSETS, tool_pose
from virtual_axes_py.ros import DEEP_QOS, TSP_NS, AxesClient, ballbar, joint_trajectory, to_ns

JOINTS = ["x", "y", "z", "a", "c"]
LENGTH = 850
"""Maximum number of poses of a path: more than 64 kB."""
SPACING = 1e-4
"""Minimum distance between poses of a path, m."""


class Tool:
    """Messages of a node about its tool."""

    def __init__(self, drive: AxesClient):
        """Subscribes with the node of a drive, in its executor."""
        self.drive = drive
        self.poses: dict[int, PoseStamped] = {}
        self.paths: dict[str, list[Path]] = {"tool_path": [], "tool_path_setpoint": []}
        self._lock = threading.Lock()
        node, target = drive.node, drive.target
        self._subscriptions = [
            node.create_subscription(PoseStamped, f"{target}/tool_pose", self._take_pose, DEEP_QOS)
        ] + [
            # Depth 1: rclpy takes long to deserialize a path.
            node.create_subscription(Path, f"{target}/{name}", store.append, 1)
            for name, store in self.paths.items()
        ]
        drive.wait_for(lambda: self.poses and all(self.paths.values()), 20, "pose and paths of the tool")

    def _take_pose(self, pose: PoseStamped) -> None:
        with self._lock:
            self.poses[to_ns(pose.header.stamp)] = pose

    def paths_with(self, condition: Callable[[Path], bool], what: str) -> tuple[Path, Path]:
        """Waits for the newest actual path that satisfies `condition`, and the setpoint path of the same poses."""

        def pair() -> tuple[Path, Path] | None:
            for actual in reversed(self.paths["tool_path"][-5:]):
                for setpoint in reversed(self.paths["tool_path_setpoint"][-5:]):
                    if condition(actual) and stamps(actual) == stamps(setpoint):
                        return actual, setpoint
            return None

        return self.drive.wait_for(pair, 20, what)


def stamps(path: Path) -> list[int]:
    """Returns the times of the poses, ns."""
    return [to_ns(pose.header.stamp) for pose in path.poses]


def tips(path: Path) -> np.ndarray:
    """Returns the tips of the poses, m."""
    points = [pose.pose.position for pose in path.poses]
    return np.array([[p.x, p.y, p.z] for p in points])


def quaternion(pose: PoseStamped) -> np.ndarray:
    """Returns x, y, z, w."""
    q = pose.pose.orientation
    return np.array([q.x, q.y, q.z, q.w])


def matrix_of(q: np.ndarray) -> np.ndarray:
    """Returns the rotation matrix of a unit quaternion x, y, z, w."""
    v, w = q[:3], q[3]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * cross


@pytest.fixture(scope="module")
def tool() -> Iterator[Tool]:
    """Yields a machine with all offsets in `fast`, whose paths have at most LENGTH poses."""
    offsets = [text for key, value in OFFSETS.items() for text in ("-p", f"kinematics.{key}_mm:={value}")]
    arguments = ["-p", "time:=fast", "-p", "tool_path_rate:=10.0", "-p", "workpiece_frame:=left/workpiece"]
    arguments += ["-p", f"tool_path_length:={LENGTH}"]
    with Node([*arguments, *offsets]) as process, AxesClient(process=process) as drive:
        yield Tool(drive)


def test_the_pose_is_the_kinematics_of_the_joint_states(tool: Tool):
    """All five axes move, C by most of a turn: tip and orientation at each stamp, quaternion sign continuous."""
    times = np.arange(0, 4.8, 0.012)
    s = (1 - np.cos(np.pi * times / times[-1])) / 2
    plan = np.column_stack([0.1 * s, -0.08 * s, 0.05 * s, 0.7 * s, 0.9 * 2 * math.pi * s])
    recording = tool.drive.run(joint_trajectory(JOINTS, times, plan), settle=0.2)
    last = int(recording.joints.stamp[-1])
    tool.drive.wait_for(lambda: max(tool.poses) >= last, 10, "the last pose")
    before = None
    largest = 0.0
    for row, stamp in enumerate(recording.joints.stamp.tolist()):
        pose = tool.poses[stamp]
        tip, orientation = tool_pose(*(recording.joints["position", joint][row] for joint in JOINTS))
        point = pose.pose.position
        q = quaternion(pose)
        largest = max(largest, np.abs(tip - [point.x, point.y, point.z]).max())
        assert matrix_of(q) == pytest.approx(orientation, abs=1e-9)
        assert q @ q == pytest.approx(1.0, abs=1e-12)
        assert before is None or q @ before > 0.99, "the quaternion jumps"
        before = q
    assert largest < 1e-9
    assert pose.header.frame_id == "left/workpiece"


def test_a_reset_clears_the_paths(tool: Tool):
    """Earlier poses are gone; the paths begin at the present tool position."""
    tool.drive.run(joint_trajectory(["x"], [0.5], [[0.05]]), settle=0.1)
    tool.drive.reset()
    now = tool.drive.now()
    actual, _ = tool.paths_with(lambda path: stamps(path)[-1] > now and len(path.poses) <= 2, "empty paths")
    assert stamps(actual)[0] > now - 100 * TSP_NS


def test_the_paths_show_the_contour_error_of_the_ballbar(fast: AxesClient):
    """Actual against setpoint: 49 um outside on average, 48 at least; setpoints on the circle itself."""
    tool = Tool(fast)
    path = ballbar(turns=1.0)
    recording = fast.run(joint_trajectory(["x", "y"], path.time, np.column_stack([path.x, path.y])), settle=0.2)
    end = recording.start + round(path.time[-1] * 1e9)
    actual, setpoint = tool.paths_with(lambda path: stamps(path)[-1] > end, "paths of the whole ballbar")
    assert len(actual.poses) <= 2000
    assert (actual.header.frame_id, actual.poses[0].header.frame_id) == ("workpiece", "workpiece")

    def radial(points: np.ndarray) -> np.ndarray:
        return np.hypot(points[:, 0] - path.center[0], points[:, 1] - path.center[1]) - path.radius

    when = (np.array(stamps(actual)) - recording.start) * 1e-9
    steady = (when >= path.steady[0]) & (when <= path.steady[1])
    assert steady.sum() > 400
    outside = radial(tips(actual))[steady]
    # The setpoint is delayed by one and a half cycles: the delay is one or two cycles.
    assert np.abs(radial(tips(setpoint)[steady])).max() < 1e-9
    # Radial deviation of the recorded positions at the same instants, and the specified figure.
    expected = recording.radial_deviation(path.center, path.radius)
    by_stamp = dict(zip(recording.joints.stamp.tolist(), expected))
    assert outside == pytest.approx([by_stamp[s] for s in np.array(stamps(actual))[steady].tolist()], abs=1e-9)
    assert 1e6 * outside.mean() == pytest.approx(49.0, abs=1.0)
    # Both paths have the same instants: the distance at equal indices is the delay-compensated following error.
    assert np.linalg.norm(tips(actual) - tips(setpoint), axis=1).max() < 150e-6


def test_a_long_path_keeps_its_newest_poses(tool: Tool):
    """The reader gets all poses, at most the configured number, at least the spacing apart."""
    times = np.arange(0, 6.001, 0.006)
    x = 0.1 * np.sin(2 * np.pi * times / 2) * np.clip(np.minimum(times, 6 - times), 0, 1)
    recording = tool.drive.run(joint_trajectory(["x"], times, x[:, None]), settle=0.2)
    end = recording.start + 6_000_000_000
    actual, setpoint = tool.paths_with(lambda path: stamps(path)[-1] > end, "the end of the path")
    assert len(actual.poses) == len(setpoint.poses)
    assert LENGTH - 1 <= len(actual.poses) <= LENGTH
    assert np.diff(stamps(actual)).min() > 0
    steps = [np.linalg.norm(np.diff(tips(path), axis=0), axis=1)[:-1] for path in (actual, setpoint)]
    assert np.maximum(*steps).min() >= SPACING * (1 - 1e-9)


def test_a_rate_of_zero_publishes_no_path(start: Callable[..., AxesClient]):
    """The pose is still published."""
    drive = start("-p", "time:=fast", "-p", "tool_path_rate:=0.0")
    seen: list[object] = []
    subscriptions = [
        drive.node.create_subscription(PoseStamped, f"{drive.target}/tool_pose", seen.append, DEEP_QOS),
        drive.node.create_subscription(Path, f"{drive.target}/tool_path", seen.append, DEEP_QOS),
    ]
    drive.wait_for(lambda: len(seen) > 20, 20, "poses")
    assert subscriptions[1].get_publisher_count() == 1
    assert not any(isinstance(message, Path) for message in seen)
