"""Early ends of goals of the action: tolerances, cancellation and preemption."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import TrajectoryResult

from action import Follow, Result, ending, goal, line, wave
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, joint_trajectory, to_ns

TSP = TSP_NS / NANOSECONDS
FEED = 10 / 60
"""10 m/min"""


# ---- tolerances


def constant(feed: float, distance: float) -> JointTrajectory:
    """Returns a motion of X at constant feed after a ramp of 0.2 s, and the same ramp down."""
    ramp = 0.2
    cruise = distance / feed - ramp
    time = [0.0, ramp, ramp + cruise, 2 * ramp + cruise]
    positions = [0.0, feed * ramp / 2, distance - feed * ramp / 2, distance]
    return joint_trajectory(["x"], time, positions, [[0.0], [feed], [feed], [0.0]])


@pytest.fixture
def without_feedforward(follow: Follow) -> Iterator[Follow]:
    """Switches feedforward off: X trails its setpoint by V/Kp."""
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
    assert text.startswith("joint x: position error ") and f"path tolerance {0.95 * trailing:.6g}" in text
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
    # 6 m/min: 4 mm following error when the setpoint stops; it decays by 1/e every 40 ms, to 0.1 mm in 0.15 s.
    trajectory = joint_trajectory(["x"], [0, 1.0], [0, 0.1])
    late = follow.send(goal(trajectory, end={"x": 1e-4}, end_time=0.02)).ended()
    assert (late.status, late.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.GOAL_TOLERANCE_VIOLATED)
    assert late.result.error_string.startswith("joint x: position error ")
    assert "exceeds the goal tolerance 0.0001 m" in late.result.error_string
    for end_time in (0.6, -1.0):
        follow.drive.reset()
        in_time = follow.send(goal(trajectory, end={"x": 1e-4}, end_time=end_time))
        assert in_time.status() == GoalStatus.STATUS_SUCCEEDED, (end_time, in_time.result().error_string)


# ---- cancellation and preemption


def test_canceling_stops_the_axes_within_their_limits(follow: Follow) -> None:
    sent = follow.send(goal(wave()))
    sent.wait_for_feedback(150)
    answer = sent.cancel()
    assert answer.return_code == CancelGoal.Response.ERROR_NONE
    assert [bytes(info.goal_id.uuid) for info in answer.goals_canceling] == [sent.id]
    ended = sent.ended()
    assert ended.status == GoalStatus.STATUS_CANCELED, ended.result
    follow.drive.wait_for(lambda: follow.status_of(sent.id) == GoalStatus.STATUS_CANCELED, 5, "its status")
    reported = ending(follow, sent)
    end = to_ns(reported.header.stamp)
    # The stop takes 0.13 s at most; the wave is past its first 2 s, which end in a kink.
    before, rest = 60, 20
    follow.drive.wait_until(end + rest * TSP_NS, 20)
    psec = follow.drive.record(end - before * TSP_NS, end + rest * TSP_NS).states["psec", "x"]
    limits = follow.drive.get_parameters(["x.limits.acceleration_m_s2", "x.limits.jerk_m_s3"])
    acceleration = np.diff(psec, 2) / TSP**2
    jerk = np.diff(psec, 3) / TSP**3
    assert np.ptp(psec[-rest:]) < 1e-12, "at rest at the end"
    assert np.abs(np.diff(psec)).max() > 0.0, "in motion before the stop"
    assert np.abs(acceleration).max() <= limits["x.limits.acceleration_m_s2"] * (1 + 1e-6)
    assert np.abs(jerk).max() <= limits["x.limits.jerk_m_s3"] * (1 + 1e-6)


def test_canceling_a_finished_or_unknown_goal_returns_its_code(follow: Follow) -> None:
    over = follow.send(goal(line(["x"], [0.001], 0.1)))
    assert over.status() == GoalStatus.STATUS_SUCCEEDED
    assert follow.cancel(over.id).return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED
    assert follow.cancel(bytes([3] * 16)).return_code == CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID


def test_canceling_all_and_by_time(follow: Follow) -> None:
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


def test_a_newer_goal_or_trajectory_preempts_and_both_get_results(follow: Follow) -> None:
    drive = follow.drive
    first = follow.send(goal(wave()))
    first.wait_for_feedback(10)
    # Starts at the commanded position of X at that time; the node adds the approach to a later first point.
    onward = joint_trajectory(["x"], [2.0, 600.0], [0.0, 0.1], [[0.0], [0.0]])
    second = follow.send(goal(onward))
    ended = first.ended()
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert ended.result.error_string == f"preempted by goal {second.id.hex()}"
    assert ending(follow, first).status == TrajectoryResult.PREEMPTED

    second.wait_for_feedback(5)
    number = drive.accept(onward).sequence_number
    ended = second.ended()
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert f"trajectory {number} of psec" in ended.result.error_string

    third = follow.send(goal(onward))
    reported = drive.end(number, 20)
    assert reported.status == TrajectoryResult.PREEMPTED and f"goal {third.id.hex()}" in reported.text
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
