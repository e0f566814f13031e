"""The action `~/follow_joint_trajectory` and `~/controller_state`, by rclpy's own ActionClient."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration, Time
from control_msgs.msg import JointComponentTolerance, JointTolerance, JointTrajectoryControllerState
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.subscription import Subscription
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory
from virtual_axes.msg import TrajectoryResult

from action import Follow, Result, ending, goal, line, results_of, wave
from virtual_axes_py.ros import DEEP_QOS, NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, to_ns, to_time

TSP = TSP_NS / NANOSECONDS


# ---- a goal that succeeds


def test_the_action_is_in_the_graph_with_its_type(follow: Follow) -> None:
    name, namespace = follow.drive.target.rsplit("/", 1)[1], "/"
    found = get_action_server_names_and_types_by_node(follow.drive.node, name, namespace)
    assert (follow.name, ["control_msgs/action/FollowJointTrajectory"]) in found
    services = dict(follow.drive.node.get_service_names_and_types_by_node(name, namespace))
    types = {part: services[f"{follow.name}/_action/{part}"] for part in ("send_goal", "cancel_goal", "get_result")}
    assert types == {
        "send_goal": ["control_msgs/action/FollowJointTrajectory_SendGoal"],
        "cancel_goal": ["action_msgs/srv/CancelGoal"],
        "get_result": ["control_msgs/action/FollowJointTrajectory_GetResult"],
    }


def test_a_goal_is_followed_with_feedback_to_success(follow: Follow) -> None:
    trajectory = line(["y", "x"], [0.02, 0.05], 2.0)
    sent = follow.send(goal(trajectory))
    ended = sent.ended()
    assert (ended.status, ended.result.error_code, ended.result.error_string) == (GoalStatus.STATUS_SUCCEEDED, 0, "")

    follow.drive.wait_for(lambda: follow.status_of(sent.id) == GoalStatus.STATUS_SUCCEEDED, 5, "its status")
    completed = ending(follow, sent)
    accepted = results_of(follow, sent)[0]
    assert [accepted.status, completed.status] == [TrajectoryResult.ACCEPTED, TrajectoryResult.COMPLETED]
    assert accepted.source == completed.source == TrajectoryResult.SOURCE_ACTION
    assert (completed.sequence_number, bytes(completed.publisher_gid)) == (0, bytes(16))

    end = to_ns(completed.header.stamp)
    follow.drive.wait_for(
        lambda: sent.feedback and to_ns(sent.feedback[-1].header.stamp) > end - 3 * TSP_NS, 10, "all of its feedback"
    )
    feedback = sent.feedback
    assert all(list(message.joint_names) == ["y", "x"] for message in feedback)
    stamps = np.array([to_ns(message.header.stamp) for message in feedback])
    # 50 Hz on a grid of 6 ms: every third cycle, from the first to the last.
    assert set(np.diff(stamps)) == {3 * TSP_NS}
    start = to_ns(accepted.start)
    assert start <= stamps[0] < start + 3 * TSP_NS and end - 3 * TSP_NS < stamps[-1] <= end
    assert [to_ns(message.desired.time_from_start) for message in feedback] == list(stamps - start)
    follow.drive.wait_until(int(stamps[-1]), 10)
    recording = follow.drive.record(start, int(stamps[-1]), completed)
    states = recording.states
    rows = [int(np.flatnonzero(states.stamp == stamp)[0]) for stamp in stamps]
    for column, joint in enumerate(["y", "x"]):
        desired, actual, error = (
            np.array([getattr(message, field).positions[column] for message in feedback])
            for field in ("desired", "actual", "error")
        )
        assert np.array_equal(actual, states["position", joint][rows])
        assert np.array_equal(error, states["synchronized_tracking_error", joint][rows])
        assert np.allclose(desired - actual, error, rtol=0, atol=1e-15)
        velocity = np.array([message.actual.velocities[column] for message in feedback])
        assert np.array_equal(velocity, states["velocity", joint][rows])
        velocities = np.array([message.desired.velocities[column] for message in feedback])
        # Quintic from rest to rest over T: 15/8 of the mean speed in the middle.
        peak = 15 / 8 * (0.02 if joint == "y" else 0.05) / 2.0
        assert velocities.max() == pytest.approx(peak, rel=2e-3)


def test_every_field_crosses_the_wire(follow: Follow) -> None:
    # Strings of odd lengths put the following fields at all alignments.
    trajectory = line(["x", "y", "z"], [0.01, 0.01, -0.01], 0.6)
    trajectory.header.frame_id = "machine"
    message = goal(trajectory, path={"x": 0.5}, end={"z": 0.5, "x": -1.0}, end_time=2.5)
    message.path_tolerance.append(JointTolerance(name="y", position=0.0, velocity=-1.0, acceleration=1e6))
    message.multi_dof_trajectory.header.frame_id = "no"
    assert follow.send(message, uuid=bytes(range(1, 17))).result().error_code == Result.SUCCESSFUL
    assert follow.status_of(bytes(range(1, 17))) is not None


def test_a_goal_of_20_000_points(follow: Follow) -> None:
    count = 20_000
    time = np.arange(count) * TSP
    positions = np.outer(np.sin(2 * math.pi * np.arange(count) / (count - 1)), [0.05, 0.02, -0.02, 0.1, 0.2])
    sent = follow.send(goal(joint_trajectory(["x", "y", "z", "a", "c"], time, positions)))
    assert sent.handle.accepted
    feedback = sent.wait_for_feedback(3, timeout=30)
    assert len(feedback.desired.positions) == 5
    sent.cancel()
    assert sent.status(60) == GoalStatus.STATUS_CANCELED


def test_a_goal_without_points_is_a_controlled_stop(follow: Follow) -> None:
    moving = follow.send(goal(wave()))
    moving.wait_for_feedback(10)
    stop = follow.send(goal(JointTrajectory()))
    assert stop.status() == GoalStatus.STATUS_SUCCEEDED
    ended = moving.ended()
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert "stop" in ended.result.error_string


# ---- rejected goals


def tolerance(name: str, **values: float) -> list[JointTolerance]:
    return [JointTolerance(name=name, **values)]


REJECTED_GOALS = {
    "unknown joint": (
        lambda g: g.trajectory.joint_names.__setitem__(0, "q"),
        Result.INVALID_JOINTS,
        "UNKNOWN_JOINT",
        "q",
    ),
    "joint twice": (
        lambda g: g.trajectory.joint_names.__setitem__(0, "y"),
        Result.INVALID_JOINTS,
        "DUPLICATE_JOINT",
        "y",
    ),
    "in the past": (
        lambda g: setattr(g.trajectory.header, "stamp", Time(sec=5)),
        Result.OLD_HEADER_TIMESTAMP,
        "ENDED_IN_THE_PAST",
        "",
    ),
    "outside the travel limits": (
        lambda g: g.trajectory.points[1].positions.__setitem__(0, 9.0),
        Result.INVALID_GOAL,
        "OUTSIDE_TRAVEL_LIMITS",
        "point 1",
    ),
    "jump": (lambda g: g.trajectory.points[0].positions.__setitem__(1, 0.1), Result.INVALID_GOAL, "JUMP", "y"),
    "times not increasing": (
        lambda g: setattr(g.trajectory.points[1].time_from_start, "sec", 0),
        Result.INVALID_GOAL,
        "TIMES_NOT_INCREASING",
        "point 1",
    ),
    "too fast": (
        lambda g: setattr(g.trajectory.points[1], "time_from_start", Duration(nanosec=10_000_000)),
        Result.INVALID_GOAL,
        "SPEED",
        "x",
    ),
    "not finite": (
        lambda g: g.trajectory.points[1].positions.__setitem__(0, math.nan),
        Result.INVALID_GOAL,
        "NOT_FINITE",
        "x",
    ),
    "several degrees of freedom": (
        lambda g: setattr(g, "multi_dof_trajectory", MultiDOFJointTrajectory(joint_names=["base"])),
        Result.INVALID_GOAL,
        "MULTI_DOF",
        "multi_dof_trajectory",
    ),
    "tolerance of a component": (
        lambda g: setattr(g, "component_goal_tolerance", [JointComponentTolerance(joint_name="x", component=1)]),
        Result.INVALID_GOAL,
        "MULTI_DOF",
        "component_goal_tolerance",
    ),
    "tolerance of an unknown joint": (
        lambda g: setattr(g, "path_tolerance", tolerance("q", position=0.1)),
        Result.INVALID_GOAL,
        "INVALID_TOLERANCE",
        "joint q",
    ),
    "tolerance twice": (
        lambda g: setattr(g, "goal_tolerance", 2 * tolerance("x", position=0.1)),
        Result.INVALID_GOAL,
        "INVALID_TOLERANCE",
        "goal_tolerance[1], joint x",
    ),
    "negative tolerance": (
        lambda g: setattr(g, "path_tolerance", tolerance("x", velocity=-0.5)),
        Result.INVALID_GOAL,
        "INVALID_TOLERANCE",
        "velocity is -0.5",
    ),
    "tolerance of NaN": (
        lambda g: setattr(g, "path_tolerance", tolerance("x", acceleration=math.nan)),
        Result.INVALID_GOAL,
        "INVALID_TOLERANCE",
        "acceleration is NaN",
    ),
}


def test_an_invalid_goal_is_aborted_with_the_reason_and_the_motion_continues(follow: Follow) -> None:
    running = follow.send(goal(wave(joint="z")))
    running.wait_for_feedback()
    for case, (spoil, code, name, words) in REJECTED_GOALS.items():
        message = goal(line(["x", "y"], [0.05, 0.02], 1.0))
        spoil(message)
        sent = follow.send(message)
        assert sent.handle.accepted, case
        ended = sent.ended()
        assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, code), (case, ended.result)
        assert ended.result.error_string.startswith(f"{name}: "), (case, ended.result)
        assert words in ended.result.error_string, (case, ended.result)
        reported = ending(follow, sent)
        assert reported.status == TrajectoryResult.REJECTED and reported.text in ended.result.error_string
        assert reported.code == getattr(TrajectoryResult, name)
    count = len(running.feedback)
    running.wait_for_feedback(count + 5)
    assert follow.status_of(running.id) == GoalStatus.STATUS_EXECUTING


def test_only_an_id_that_is_in_use_is_rejected(follow: Follow) -> None:
    first = follow.send(goal(wave()), uuid=bytes([9] * 16))
    assert first.handle.accepted
    assert not follow.send(goal(wave()), uuid=bytes([9] * 16)).handle.accepted
    first.wait_for_feedback(5)


# ---- clients


def test_a_result_can_be_requested_late_and_by_several_clients(follow: Follow) -> None:
    with AxesClient(process=follow.drive.process) as other, Follow(other) as second:
        mine = follow.send(goal(line(["x"], [0.01], 0.5)))
        theirs = second.send(goal(line(["y"], [0.01], 0.5)))
        assert mine.status() == theirs.status() == GoalStatus.STATUS_SUCCEEDED
        # Again, long after the end.
        assert mine.status() == GoalStatus.STATUS_SUCCEEDED
        # A late subscriber receives both results on the status topic.
        second.drive.wait_for(lambda: second.status_of(mine.id) == GoalStatus.STATUS_SUCCEEDED, 10, "its status")


def test_a_goal_can_start_later(follow: Follow) -> None:
    drive = follow.drive
    trajectory = line(["x"], [0.01], 0.6)
    start = (drive.now() // TSP_NS + 500) * TSP_NS
    trajectory.header.stamp = to_time(start)
    sent = follow.send(goal(trajectory))
    assert sent.status() == GoalStatus.STATUS_SUCCEEDED
    sent.wait_for_feedback()
    assert to_ns(sent.feedback[0].header.stamp) >= start
    assert to_ns(ending(follow, sent).start) == start


def test_controller_state_compares_the_axes_with_their_setpoints(follow: Follow) -> None:
    drive, messages = follow.drive, []
    topic = f"{drive.target}/controller_state"

    def listen() -> Subscription:
        return drive.node.create_subscription(JointTrajectoryControllerState, topic, messages.append, DEEP_QOS)

    subscription = drive.in_executor(listen)
    drive.wait_for(lambda: messages, 10, topic)
    drive.run(line(["x", "c"], [0.05, 0.5], 1.0))
    drive.wait_for(lambda: to_ns(messages[-1].header.stamp) >= drive.now(), 10, topic)
    drive.in_executor(lambda: drive.node.destroy_subscription(subscription))
    drive.wait_until(to_ns(messages[-1].header.stamp), 10)
    recording = drive.record(to_ns(messages[0].header.stamp), to_ns(messages[-1].header.stamp))
    assert [to_ns(message.header.stamp) for message in messages] == list(recording.joints.stamp)
    assert list(messages[0].joint_names) == recording.joints.name
    assert messages[0].speed_scaling_factor == 1.0

    def table(point: str, field: str) -> np.ndarray:
        return np.array([getattr(getattr(message, point), field) for message in messages])

    joints, states = recording.joints, recording.states
    assert np.array_equal(table("feedback", "positions"), joints["position"])
    assert np.array_equal(table("feedback", "velocities"), joints["velocity"])
    assert np.array_equal(table("output", "effort"), joints["effort"])
    assert np.array_equal(table("error", "positions"), states["synchronized_tracking_error"])
    reference = table("reference", "positions")
    assert np.abs(reference - joints["position"] - table("error", "positions")).max() < 1e-15
    velocity = table("reference", "velocities")
    assert np.abs(velocity[1:] - np.diff(reference, axis=0) / TSP).max() < 1e-9


# ---- life of the node


def test_a_goal_under_way_is_aborted_when_the_node_ends(start: Callable[..., AxesClient]) -> None:
    drive = start("-p", "time:=real", "-r", "~/follow_joint_trajectory:=/cell/move")
    with Follow(drive, name="/cell/move") as follow:
        sent = follow.send(goal(wave(60)))
        sent.wait_for_feedback(1)
        waiting = sent.ask()
        # The request has reached the node long before that.
        sent.wait_for_feedback(len(sent.feedback) + 10)
        assert follow.status_of(sent.id) == GoalStatus.STATUS_EXECUTING
        process = drive.process
        drive.process = None
        assert process.stop() == 0
        drive.wait_for(waiting.done, 10, "its result")
        ended = waiting.result()
        assert (ended.status, ended.result.error_string) == (GoalStatus.STATUS_ABORTED, "the node is shutting down")
