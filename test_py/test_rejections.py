"""All rejections of a JointTrajectory: code, joint, point, value and limit; the active motion continues."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import TrajectoryResult as R

from motion import assert_psec, go_home, swing
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, to_ns

ANY = object()


@dataclass
class Case:
    """A trajectory and the expected result; `ANY` is not compared."""

    code: int
    make: Callable[[AxesClient], JointTrajectory]
    joint: Any = ""
    index: Any = -1
    value: Any = ANY
    limit: Any = ANY


def line(joint: str, *points: tuple[float, float], **options: Any) -> JointTrajectory:
    """Returns a trajectory of one joint from (time, position) pairs."""
    return joint_trajectory([joint], [t for t, _ in points], [[p] for _, p in points], **options)


def edit(trajectory: JointTrajectory, point: int, **fields: Any) -> JointTrajectory:
    """Returns the trajectory with other arrays in one of its points."""
    for name, value in fields.items():
        setattr(trajectory.points[point], name, value)
    return trajectory


def with_nanosec(trajectory: JointTrajectory, point: int | None) -> JointTrajectory:
    """Returns the trajectory with 1e9 ns in the stamp or in the time of a point."""
    time = trajectory.header.stamp if point is None else trajectory.points[point].time_from_start
    time.nanosec = NANOSECONDS
    return trajectory


def two(*rows: tuple[float, float]) -> JointTrajectory:
    """Returns a trajectory of joints y and z, one second per row."""
    return joint_trajectory(["y", "z"], np.arange(1, len(rows) + 1), rows)


REST = ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
TRAVEL_MIN_A = math.radians(-30)

# y, z, a and c rest at 0 while x swings.
CASES = {
    "unknown joint": Case(R.UNKNOWN_JOINT, lambda d: joint_trajectory(["y", "w"], [1], [[0, 0]]), joint="w"),
    "duplicate joint": Case(R.DUPLICATE_JOINT, lambda d: joint_trajectory(["y", "y"], [1], [[0, 0]]), joint="y"),
    "too few positions": Case(R.WRONG_SIZE, lambda d: edit(two(*REST), 1, positions=[0.0]), index=1, value=1, limit=2),
    "too many positions": Case(
        R.WRONG_SIZE, lambda d: edit(two(*REST), 2, positions=[0.0] * 3), index=2, value=3, limit=2
    ),
    "no positions": Case(R.WRONG_SIZE, lambda d: edit(two(*REST), 0, positions=[]), index=0, value=0, limit=2),
    "too few velocities": Case(
        R.WRONG_SIZE, lambda d: edit(two(*REST), 1, velocities=[0.0]), index=ANY, value=ANY, limit=2
    ),
    "too many accelerations": Case(
        R.WRONG_SIZE,
        lambda d: edit(
            joint_trajectory(["y", "z"], [1, 2], np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2))),
            1,
            accelerations=[0.0] * 3,
        ),
        index=1,
        value=3,
        limit=2,
    ),
    "equal times": Case(R.TIMES_NOT_INCREASING, lambda d: line("z", (1, 0), (2, 0), (2, 0)), index=2, value=2, limit=2),
    "decreasing times": Case(
        R.TIMES_NOT_INCREASING, lambda d: line("z", (1, 0), (3, 0), (2.5, 0)), index=2, value=2.5, limit=3
    ),
    "negative first time": Case(R.NEGATIVE_TIME, lambda d: line("z", (-0.5, 0), (1, 0)), index=0, value=-0.5, limit=0),
    "NaN position": Case(R.NOT_FINITE, lambda d: two((0, 0), (0, math.nan)), joint="z", index=1, value=math.nan),
    "infinite position": Case(R.NOT_FINITE, lambda d: two((0, 0), (-math.inf, 0)), joint="y", index=1, value=-math.inf),
    "NaN velocity": Case(
        R.NOT_FINITE,
        lambda d: joint_trajectory(["z"], [1, 2], [[0], [0]], [[math.nan], [0]]),
        joint="z",
        index=0,
        value=math.nan,
    ),
    "infinite acceleration": Case(
        R.NOT_FINITE,
        lambda d: joint_trajectory(["z"], [1, 2], [[0], [0]], [[0], [0]], [[0], [math.inf]]),
        joint="z",
        index=1,
        value=math.inf,
    ),
    "above the travel limits": Case(
        R.OUTSIDE_TRAVEL_LIMITS, lambda d: line("y", (0, 0), (20, 0.3)), joint="y", index=1, value=0.3, limit=0.275
    ),
    "below the travel limits": Case(
        R.OUTSIDE_TRAVEL_LIMITS,
        lambda d: line("a", (0, 0), (20, math.radians(-31))),
        joint="a",
        index=1,
        value=math.radians(-31),
        limit=TRAVEL_MIN_A,
    ),
    "jump to the first point": Case(R.JUMP, lambda d: line("z", (0, 0.1), (1, 0.1)), joint="z", index=0, value=0.1),
    "jump at a start in the past": Case(
        R.JUMP,
        lambda d: line("z", (0, 0), (10, 0.2), stamp=d.now() - 5 * NANOSECONDS),
        joint="z",
        index=ANY,
    ),
    "too fast between points": Case(
        R.SPEED, lambda d: line("z", (1, 0), (1.1, 0.1)), joint="z", index=1, value=1.0, limit=0.5
    ),
    "too fast to the first point": Case(
        R.SPEED, lambda d: line("z", (0.1, 0.2), (1, 0.2)), joint="z", index=0, value=2.0, limit=0.5
    ),
    "velocity above the limit": Case(
        R.SPEED,
        lambda d: joint_trajectory(["z"], [1, 2, 3], [[0], [0.1], [0.2]], [[0], [0.6], [0]]),
        joint="z",
        index=ANY,
        limit=0.5,
    ),
    "ended in the past": Case(
        R.ENDED_IN_THE_PAST, lambda d: line("z", (0, 0), (1, 0), stamp=d.now() - 10 * NANOSECONDS)
    ),
    "too many points": Case(
        R.TOO_MANY_POINTS,
        lambda d: joint_trajectory(["z"], np.arange(20_001) * 0.006, np.zeros(20_001)),
        index=ANY,
        value=20_001,
        limit=20_000,
    ),
    "velocity at the end": Case(
        R.VELOCITY_AT_END,
        lambda d: joint_trajectory(["z"], [1, 2], [[0], [0.01]], [[0], [0.1]]),
        joint="z",
        index=1,
        value=0.1,
    ),
    "invalid stamp": Case(R.INVALID_TIME, lambda d: with_nanosec(line("z", (0, 0), (1, 0)), None)),
    "invalid time of a point": Case(
        R.INVALID_TIME, lambda d: with_nanosec(line("z", (0, 0), (1, 0)), 1), index=1, value=NANOSECONDS
    ),
}


@dataclass
class Motion:
    """A long active swing of x."""

    drive: AxesClient
    start: int
    plan: dict[str, np.ndarray]


@pytest.fixture(scope="module")
def motion(real: AxesClient) -> Iterator[Motion]:
    """Yields a swing of x of a minute; asserts at its end that no rejection has changed psec."""
    go_home(real)
    time, position = swing(60.0)
    accepted = real.accept(joint_trajectory(["x"], time, position))
    start = to_ns(accepted.start)
    yield Motion(real, start, {"x": position})
    last = min(real.now(), start + (len(time) - 1) * TSP_NS)
    assert_psec(real, start, {"x": position}, last=last)
    assert [r.status for r in real.results(accepted.sequence_number)][:1] == [R.ACCEPTED]


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_rejected_with_its_reason(motion: Motion, case: Case):
    """The result names the error; psec stays the plan of the active motion, bit for bit."""
    drive = motion.drive
    before = drive.now()
    trajectory = case.make(drive)
    result = drive.decision(drive.send(trajectory))

    assert result.status == R.REJECTED, result.text
    assert result.code == case.code, result.text
    assert result.text
    assert result.trajectory_stamp == trajectory.header.stamp
    assert to_ns(result.start) == 0
    if case.joint is not ANY:
        assert result.joint == case.joint
    if case.index is not ANY:
        assert result.point_index == case.index
    if case.value is not ANY:
        assert result.value == pytest.approx(case.value, rel=1e-9, nan_ok=True)
    if case.limit is not ANY:
        assert result.limit == pytest.approx(case.limit, rel=1e-9)

    # Samples may be older than the acceptance: the plan may not have begun at their stamps.
    after = max(drive.now(), motion.start) + 3 * TSP_NS
    rest = np.zeros_like(motion.plan["x"])
    plan = {**motion.plan, "y": rest, "z": rest, "a": rest, "c": rest}
    assert assert_psec(drive, motion.start, plan, max(before, motion.start), after) >= 3


@pytest.mark.parametrize(("residual", "is_accepted"), [(1e-6, True), (-1e-6, True), (1.1e-6, False)])
def test_a_residual_velocity_of_a_planner_is_taken_as_zero(fast: AxesClient, residual: float, is_accepted: bool):
    """At most 1e-6 m/s: the axis comes to rest at the last point."""
    go_home(fast)
    sent = fast.send(joint_trajectory(["x"], [1.0], [[0.05]], [[residual]]))
    if not is_accepted:
        assert fast.decision(sent).code == R.VELOCITY_AT_END
        return
    end = fast.end(sent, 10)
    assert end.status == R.COMPLETED
    fast.wait_until(to_ns(end.header.stamp) + NANOSECONDS, 10)
    assert fast.latest("psec")["x"] == pytest.approx(0.05, abs=1e-12)


def test_axes_at_rest_do_not_move_on_a_rejection(start: Callable[..., AxesClient]):
    """A rejection without an active motion moves no axis."""
    drive = start()
    before = drive.latest("position")
    result = drive.decision(drive.send(line("q", (1, 0.1))))
    assert (result.status, result.code, result.joint) == (R.REJECTED, R.UNKNOWN_JOINT, "q")
    drive.wait_until(drive.now() + 20 * TSP_NS, 5)
    assert drive.latest("position") == before


def test_results_reach_a_late_subscriber(start: Callable[..., AxesClient]):
    """~/trajectory_result is transient local: a late subscriber receives the results."""
    drive = start()
    result = drive.decision(drive.send(line("q", (1, 0.1))))
    with AxesClient(node=drive.target, domain_id=drive.process.domain_id) as late:
        seen = late.wait_for(late.results, 5, "old results")
        assert bytes(seen[0].publisher_gid) == bytes(result.publisher_gid) == drive.gid
        assert seen[0].sequence_number == result.sequence_number == 1
