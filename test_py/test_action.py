"""The action `~/follow_joint_trajectory` and `~/controller_state`, by rclpy's own ActionClient."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Duration, Time
from control_msgs.msg import JointComponentTolerance, JointTolerance, JointTrajectoryControllerState
from rclpy.action import get_action_server_names_and_types_by_node
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory
from virtual_axes.msg import TrajectoryResult

from action import Follow, Result, Sent, goal
from drive import DEEP_QOS, NANOSECONDS, TSP_NS, Drive, Node, joint_trajectory, to_ns, to_time

TSP = TSP_NS / NANOSECONDS
FEED = 10 / 60
"""10 m/min"""
MONITOR_HZ = 50


@pytest.fixture(scope="module")
def shared() -> Iterator[Follow]:
    """A node and a client, shared by the module."""
    args = ["-p", "time:=fast", "-p", f"action_monitor_rate:={MONITOR_HZ}"]
    with Node(args) as process, Drive(process=process) as drive, Follow(drive) as follow:
        yield follow


@pytest.fixture
def follow(shared: Follow) -> Follow:
    """The same, with the axes at rest at home."""
    shared.drive.reset()
    shared.drive.forget()
    return shared


def line(names: list[str], to: list[float], duration: float) -> JointTrajectory:
    """From home to `to` by a quintic, at rest at both ends."""
    rest = [[0.0] * len(names)] * 2
    return joint_trajectory(names, [0, duration], [[0.0] * len(names), to], rest, rest)


def wave(duration: float = 600.0, joint: str = "x") -> JointTrajectory:
    """A long motion there and back, at most 0.15 m/s and 0.225 m/s²."""
    time = np.arange(0, duration + 0.05, 0.1)
    # Rises over the first 2 s, so that it begins at rest.
    phase = 1.5 * time
    size = 0.1 * np.clip(time / 2, 0, 1) ** 2
    rate = 0.1 * np.where(time < 2, time / 2, 0)
    positions = size * np.sin(phase)
    velocities = rate * np.sin(phase) + 1.5 * size * np.cos(phase)
    velocities[-1] = 0.0
    return joint_trajectory([joint], time, positions, velocities)


def results_of(follow: Follow, sent: Sent) -> list[TrajectoryResult]:
    return [result for result in follow.drive.results() if bytes(result.goal_id) == sent.id]


def ending(follow: Follow, sent: Sent) -> TrajectoryResult:
    """The last word on `~/trajectory_result`."""
    return follow.drive.wait_for(
        lambda: [r for r in results_of(follow, sent) if r.status != TrajectoryResult.ACCEPTED], 10, "its result"
    )[0]


# ---- a goal that succeeds


def test_the_action_is_in_the_graph_with_its_type(follow: Follow) -> None:
    name, namespace = follow.drive.target.rsplit("/", 1)[1], "/"
    found = get_action_server_names_and_types_by_node(follow.drive.node, name, namespace)
    assert found == [(follow.name, ["control_msgs/action/FollowJointTrajectory"])]
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
    accepted, completed = results_of(follow, sent)
    assert [accepted.status, completed.status] == [TrajectoryResult.ACCEPTED, TrajectoryResult.COMPLETED]
    assert accepted.source == completed.source == TrajectoryResult.SOURCE_ACTION
    assert (completed.sequence_number, bytes(completed.publisher_gid)) == (0, bytes(16))

    feedback = sent.feedback
    assert all(list(message.joint_names) == ["y", "x"] for message in feedback)
    stamps = np.array([to_ns(message.header.stamp) for message in feedback])
    # 50 Hz on a grid of 6 ms: every third period.
    assert set(np.diff(stamps)) == {3 * TSP_NS}
    start = to_ns(accepted.start)
    assert [to_ns(message.desired.time_from_start) for message in feedback] == list(stamps - start)
    # At most the first few are missing, which were over before the node's ROS side knew the start.
    assert len(feedback) > 50
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
        asked = np.array([message.desired.velocities[column] for message in feedback])
        # Of a quintic from rest to rest over T: 15/8 of the mean speed in the middle.
        peak = 15 / 8 * (0.02 if joint == "y" else 0.05) / 2.0
        assert asked.max() == pytest.approx(peak, rel=2e-3)


def test_every_field_crosses_the_wire(follow: Follow) -> None:
    # Strings of odd lengths put what follows them at every alignment.
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


# ---- goals that are refused


def tolerance(name: str, **values: float) -> list[JointTolerance]:
    return [JointTolerance(name=name, **values)]


REFUSED = {
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
    "outside the stroke": (
        lambda g: g.trajectory.points[1].positions.__setitem__(0, 9.0),
        Result.INVALID_GOAL,
        "OUTSIDE_STROKE",
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
    "tolerance of another joint": (
        lambda g: setattr(g, "path_tolerance", tolerance("z", position=0.1)),
        Result.INVALID_GOAL,
        "INVALID_TOLERANCE",
        "joint z",
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


def test_a_goal_that_cannot_be_run_is_aborted_with_the_reason_and_disturbs_nothing(follow: Follow) -> None:
    running = follow.send(goal(wave(joint="z")))
    running.wait_for_feedback()
    for case, (spoil, code, name, words) in REFUSED.items():
        message = goal(line(["x", "y"], [0.05, 0.02], 1.0))
        spoil(message)
        sent = follow.send(message)
        assert sent.handle.accepted, case
        ended = sent.ended()
        assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, code), (case, ended.result)
        assert ended.result.error_string.startswith(f"{name}: "), (case, ended.result)
        assert words in ended.result.error_string, (case, ended.result)
        told = ending(follow, sent)
        assert told.status == TrajectoryResult.REJECTED and told.text in ended.result.error_string
        assert told.code == getattr(TrajectoryResult, name)
    count = len(running.feedback)
    running.wait_for_feedback(count + 5)
    assert follow.status_of(running.id) == GoalStatus.STATUS_EXECUTING


def test_only_an_id_that_is_in_use_is_rejected(follow: Follow) -> None:
    first = follow.send(goal(wave()), uuid=bytes([9] * 16))
    assert first.handle.accepted
    assert not follow.send(goal(wave()), uuid=bytes([9] * 16)).handle.accepted
    first.wait_for_feedback(5)


# ---- tolerances


def constant(feed: float, distance: float) -> JointTrajectory:
    """X at constant feed after a ramp of 0.2 s, and the same down."""
    ramp = 0.2
    cruise = distance / feed - ramp
    time = [0.0, ramp, ramp + cruise, 2 * ramp + cruise]
    positions = [0.0, feed * ramp / 2, distance - feed * ramp / 2, distance]
    return joint_trajectory(["x"], time, positions, [[0.0], [feed], [feed], [0.0]])


@pytest.fixture
def without_feedforward(follow: Follow) -> Iterator[Follow]:
    """Without feedforward X trails its set-point by V/Kp."""
    before = follow.drive.get_parameters(["x.feedforward.velocity", "x.feedforward.torque_kg_m2"])
    follow.drive.set_parameters_atomically(dict.fromkeys(before, 0.0))
    yield follow
    follow.drive.set_parameters_atomically(before)


def test_path_tolerances_are_kept_on_the_way_and_end_the_goal_when_not(without_feedforward: Follow) -> None:
    follow = without_feedforward
    gain = follow.drive.get_parameters(["x.position_loop.gain"])["x.position_loop.gain"]
    trailing = 10 / gain * 1e-3  # m: Kp is in (m/min)/mm
    kept = follow.send(goal(constant(FEED, 0.15), path={"x": 1.05 * trailing})).ended()
    assert kept.status == GoalStatus.STATUS_SUCCEEDED, kept.result.error_string

    follow.drive.reset()
    broken = follow.send(goal(constant(FEED, 0.15), path={"x": 0.95 * trailing})).ended()
    assert (broken.status, broken.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.PATH_TOLERANCE_VIOLATED)
    text = broken.result.error_string
    assert text.startswith("joint x: position error ") and f"path tolerance {0.95 * trailing}" in text
    error = float(text.split("error ")[1].split(" m ")[0])
    assert 0.95 * trailing < error < trailing


def test_default_tolerances_are_parameters_and_minus_one_lifts_them(without_feedforward: Follow) -> None:
    follow = without_feedforward
    try:
        follow.drive.set_parameters({"x.tolerances.path_mm": 3.0})
        code = follow.send(goal(constant(FEED, 0.15))).result().error_code
        assert code == Result.PATH_TOLERANCE_VIOLATED
        follow.drive.reset()
        code = follow.send(goal(constant(FEED, 0.15), path={"x": -1.0})).result().error_code
        assert code == Result.SUCCESSFUL
    finally:
        follow.drive.set_parameters({"x.tolerances.path_mm": 0.0})


def test_a_goal_tolerance_is_waited_for_as_long_as_the_goal_allows(without_feedforward: Follow) -> None:
    follow = without_feedforward
    # 6 m/min: 4 mm behind when the set-point stops; that falls by 1/e every 40 ms, to 0.1 mm in 0.15 s.
    trajectory = joint_trajectory(["x"], [0, 1.0], [0, 0.1])
    late = follow.send(goal(trajectory, end={"x": 1e-4}, end_time=0.02)).ended()
    assert (late.status, late.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.GOAL_TOLERANCE_VIOLATED)
    assert late.result.error_string.startswith("joint x: position error ")
    assert "exceeds the goal tolerance 0.0001 m" in late.result.error_string
    for end_time in (0.6, -1.0):
        follow.drive.reset()
        in_time = follow.send(goal(trajectory, end={"x": 1e-4}, end_time=end_time))
        assert in_time.status() == GoalStatus.STATUS_SUCCEEDED, (end_time, in_time.result().error_string)


# ---- cancelling and displacing


def test_cancelling_stops_the_axes_within_their_limits(follow: Follow) -> None:
    sent = follow.send(goal(wave()))
    sent.wait_for_feedback(150)
    answer = sent.cancel()
    assert answer.return_code == CancelGoal.Response.ERROR_NONE
    assert [bytes(info.goal_id.uuid) for info in answer.goals_canceling] == [sent.id]
    ended = sent.ended()
    assert ended.status == GoalStatus.STATUS_CANCELED, ended.result
    follow.drive.wait_for(lambda: follow.status_of(sent.id) == GoalStatus.STATUS_CANCELED, 5, "its status")
    told = ending(follow, sent)
    end = to_ns(told.header.stamp)
    # The stop takes 0.13 s at most; the wave before it is past its first 2 s, whose end is a kink.
    before, rest = 60, 20
    follow.drive.wait_until(end + rest * TSP_NS, 20)
    psec = follow.drive.record(end - before * TSP_NS, end + rest * TSP_NS).states["psec", "x"]
    limits = follow.drive.get_parameters(["x.limits.acceleration_m_s2", "x.limits.jerk_m_s3"])
    acceleration = np.diff(psec, 2) / TSP**2
    jerk = np.diff(psec, 3) / TSP**3
    assert np.ptp(psec[-rest:]) < 1e-12, "at rest when it is over"
    assert np.abs(np.diff(psec)).max() > 0.0, "it moved before"
    assert np.abs(acceleration).max() <= limits["x.limits.acceleration_m_s2"] * (1 + 1e-6)
    assert np.abs(jerk).max() <= limits["x.limits.jerk_m_s3"] * (1 + 1e-6)


def test_cancelling_what_is_over_or_unknown_says_so(follow: Follow) -> None:
    over = follow.send(goal(line(["x"], [0.001], 0.1)))
    assert over.status() == GoalStatus.STATUS_SUCCEEDED
    assert follow.cancel(over.id).return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED
    assert follow.cancel(bytes([3] * 16)).return_code == CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID


def test_cancelling_all_and_by_time(follow: Follow) -> None:
    first = follow.send(goal(wave(joint="x")))
    first.wait_for_feedback(5)
    second = follow.send(goal(wave(joint="y")))
    second.wait_for_feedback(5)
    answer = follow.cancel(stamp=first.handle.stamp)
    assert [bytes(info.goal_id.uuid) for info in answer.goals_canceling] == [first.id]
    assert first.status() == GoalStatus.STATUS_CANCELED
    third = follow.send(goal(wave(joint="z")))
    third.wait_for_feedback(5)
    answer = follow.cancel()
    assert {bytes(info.goal_id.uuid) for info in answer.goals_canceling} == {second.id, third.id}
    assert second.status() == third.status() == GoalStatus.STATUS_CANCELED


def test_a_newer_goal_or_trajectory_displaces_and_both_are_told(follow: Follow) -> None:
    drive = follow.drive
    first = follow.send(goal(wave()))
    first.wait_for_feedback(10)
    # Starts where X is commanded to be then: the way to a first point that is later is the node's.
    onward = joint_trajectory(["x"], [2.0, 600.0], [0.0, 0.1], [[0.0], [0.0]])
    second = follow.send(goal(onward))
    ended = first.ended()
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert ended.result.error_string == f"axes were taken over by goal {second.id.hex()}"
    assert ending(follow, first).status == TrajectoryResult.DISPLACED

    second.wait_for_feedback(5)
    number = drive.accept(onward).sequence_number
    ended = second.ended()
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert f"trajectory {number} of psec" in ended.result.error_string

    third = follow.send(goal(onward))
    told = drive.end(number, 20)
    assert told.status == TrajectoryResult.DISPLACED and f"goal {third.id.hex()}" in told.text
    third.wait_for_feedback(1)
    drive.stop()
    ended = third.ended()
    assert (ended.status, "stop" in ended.result.error_string) == (GoalStatus.STATUS_ABORTED, True)


def test_a_reset_aborts_a_goal(follow: Follow) -> None:
    sent = follow.send(goal(wave()))
    sent.wait_for_feedback(1)
    follow.drive.reset()
    ended = sent.ended()
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert "reset" in ended.result.error_string


# ---- clients


def test_a_result_can_be_asked_for_late_and_by_several_clients(follow: Follow) -> None:
    with Drive(process=follow.drive.process) as other, Follow(other) as second:
        mine = follow.send(goal(line(["x"], [0.01], 0.5)))
        theirs = second.send(goal(line(["y"], [0.01], 0.5)))
        assert mine.status() == theirs.status() == GoalStatus.STATUS_SUCCEEDED
        # Again, long after the end.
        assert mine.status() == GoalStatus.STATUS_SUCCEEDED
        # Whoever joins later learns of both by the status topic.
        second.drive.wait_for(lambda: second.status_of(mine.id) == GoalStatus.STATUS_SUCCEEDED, 10, "its status")


def test_a_goal_can_start_later(follow: Follow) -> None:
    drive = follow.drive
    trajectory = line(["x"], [0.01], 0.6)
    start = (drive.now() // TSP_NS + 500) * TSP_NS
    trajectory.header.stamp = to_time(start)
    sent = follow.send(goal(trajectory))
    assert sent.status() == GoalStatus.STATUS_SUCCEEDED
    assert to_ns(sent.feedback[0].header.stamp) >= start
    assert to_ns(results_of(follow, sent)[0].start) == start


def test_controller_state_compares_the_axes_with_their_set_points(follow: Follow) -> None:
    drive, messages = follow.drive, []
    topic = f"{drive.target}/controller_state"
    subscription = drive.node.create_subscription(JointTrajectoryControllerState, topic, messages.append, DEEP_QOS)
    drive.wait_for(lambda: messages, 10, topic)
    drive.run(line(["x", "c"], [0.05, 0.5], 1.0))
    drive.wait_for(lambda: to_ns(messages[-1].header.stamp) >= drive.now(), 10, topic)
    drive.node.destroy_subscription(subscription)
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


def test_a_goal_under_way_is_aborted_when_the_node_ends(start: Callable[..., Drive]) -> None:
    drive = start("-p", "time:=real", "-r", "~/follow_joint_trajectory:=/cell/move")
    with Follow(drive, name="/cell/move") as follow:
        sent = follow.send(goal(wave(60)))
        sent.wait_for_feedback(1)
        waiting = sent.handle.get_result_async()
        # The request has reached the node long before that.
        sent.wait_for_feedback(len(sent.feedback) + 10)
        assert follow.status_of(sent.id) == GoalStatus.STATUS_EXECUTING
        process = drive.process
        drive.process = None
        assert process.stop() == 0
        drive.wait_for(waiting.done, 10, "its result")
        ended = waiting.result()
        assert (ended.status, ended.result.error_string) == (GoalStatus.STATUS_ABORTED, "the node is shutting down")
