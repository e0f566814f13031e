"""Acceptance of JointTrajectory: start time and resulting motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import TrajectoryResult as R

from motion import assert_psec, go_home, on_grid, start_swing, swing
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, to_ns

SPEED_LIMIT_X = 0.5
ACCELERATION_LIMIT_X = 2.5


@pytest.fixture
def home(real: AxesClient) -> Iterator[AxesClient]:
    """Yields axes at rest at home."""
    go_home(real)
    yield real


def psec_of(drive: AxesClient, joint: str, first: int, last: int) -> np.ndarray:
    """Returns psec of a joint from `first` to `last`, ns."""
    drive.wait_until(last, 30)
    return drive.record(first, last).states["psec", joint]


def test_stamp_zero_starts_at_the_next_position_period(home: AxesClient):
    """The start is on the grid, at most one cycle after the decision."""
    accepted, start, plan = start_swing(home, duration=1.2)
    assert accepted.source == R.SOURCE_TOPIC and accepted.code == R.NONE
    assert 0 < start - to_ns(accepted.header.stamp) <= TSP_NS
    assert (start - home.now()) % TSP_NS == 0
    assert_psec(home, start, plan)
    ended = home.end(accepted.sequence_number, 10)
    assert ended.status == R.COMPLETED, ended.text
    assert ended.name and len(ended.peak_current) == len(ended.name)


def test_points_on_the_grid_are_published_unchanged(home: AxesClient):
    """Irregular points are published bit for bit."""
    noise = np.cumsum(np.random.default_rng(1).uniform(-1e-5, 1e-5, 400))
    noise[0] = 0.0
    recording = home.run(joint_trajectory(["z"], np.arange(400) * 0.006, noise))
    assert_psec(home, recording.start, {"z": noise})


def test_stamp_in_the_future_waits_while_the_active_motion_continues(home: AxesClient):
    """The active motion is followed until the start, the new one from the start on."""
    _, start, plan = start_swing(home, duration=1.8)
    end = start + (len(plan["x"]) - 1) * TSP_NS
    time, position = swing(0.6, amplitude=0.01)
    later = home.accept(joint_trajectory(["x"], time, position, stamp=end + 10 * TSP_NS))
    assert to_ns(later.start) == end + 10 * TSP_NS
    assert_psec(home, start, plan)
    assert_psec(home, to_ns(later.start), {"x": position})


def test_start_between_two_periods_is_the_later_one(home: AxesClient):
    """Points on the trajectory's own grid stay on it."""
    time, position = swing(0.6)
    stamp = home.now() + NANOSECONDS + 1_234_567
    accepted = home.accept(joint_trajectory(["x"], time, position, stamp=stamp))
    assert to_ns(accepted.start) == on_grid(home, stamp)
    assert_psec(home, to_ns(accepted.start), {"x": position})


def test_stamp_in_the_past_joins_in_with_a_warning(home: AxesClient):
    """The two motions meet at rest, so no jump occurs; points in the past are skipped."""
    time, position = swing(1.2, rest=1.8)
    stamp = on_grid(home, home.now() - NANOSECONDS // 2)
    accepted = home.accept(joint_trajectory(["x"], time, position, stamp=stamp))
    assert to_ns(accepted.start) == stamp
    assert accepted.code == R.NONE and accepted.text, "no warning"
    assert_psec(home, stamp, {"x": position}, first=to_ns(accepted.header.stamp) + TSP_NS)


@pytest.mark.parametrize(
    ("fields", "quarter"),
    [
        ({}, 1 / 4),
        ({"velocities": [[0.0]]}, 3 / 16 - 2 / 64),
        ({"velocities": [[0.0]], "accelerations": [[0.0]]}, 10 / 64 - 15 / 256 + 6 / 1024),
    ],
    ids=["linear", "cubic", "quintic"],
)
def test_first_point_later_than_zero_is_moved_to(home: AxesClient, fields: dict, quarter: float):
    """The approach starts at the commanded state and is interpolated by the given fields."""
    way = 0.01
    accepted = home.accept(joint_trajectory(["x"], [1.2], [[way]], **fields))
    start = to_ns(accepted.start)
    psec = psec_of(home, "x", start, start + 200 * TSP_NS)
    assert psec[0] == pytest.approx(0, abs=1e-12)
    assert psec[50] == pytest.approx(quarter * way, abs=1e-12)
    assert psec[100] == pytest.approx(way / 2, abs=1e-12)
    assert psec[200] == way


@pytest.mark.parametrize(
    ("fields", "quarter"),
    [
        ({}, 1 / 4),
        ({"velocities": [[0.0], [0.0]]}, 3 / 16 - 2 / 64),
        ({"velocities": [[0.0]] * 2, "accelerations": [[0.0]] * 2}, 10 / 64 - 15 / 256 + 6 / 1024),
    ],
    ids=["linear", "cubic", "quintic"],
)
def test_between_points_the_fields_decide(home: AxesClient, fields: dict, quarter: float):
    """Linear with positions, cubic with velocities, quintic with accelerations."""
    way = 0.01
    recording = home.run(joint_trajectory(["y"], [0.0, 1.2], [[0.0], [way]], **fields))
    psec = recording.states["psec", "y"]
    assert psec[50] == pytest.approx(quarter * way, abs=1e-12)
    assert psec[200] == way


def test_a_new_trajectory_preempts_the_active_one(home: AxesClient):
    """The transition starts at the commanded state without a jump; the result of the old one is PREEMPTED."""
    first, start, plan = start_swing(home, duration=6.0)
    home.wait_until(start + 150 * TSP_NS, 5)
    second = home.accept(joint_trajectory(["x"], [1.2], [[0.02]], [[0.0]]))
    switch = to_ns(second.start)
    assert_psec(home, start, plan, last=switch - TSP_NS)
    psec = psec_of(home, "x", switch - 2 * TSP_NS, switch + 200 * TSP_NS)
    assert np.abs(np.diff(psec)).max() <= SPEED_LIMIT_X * 0.006
    # A cubic starts with the commanded velocity: no step beyond that of the swing itself.
    assert np.abs(np.diff(psec, 2)).max() <= ACCELERATION_LIMIT_X * 0.006**2
    assert psec[-1] == 0.02
    assert home.end(first.sequence_number, 5).status == R.PREEMPTED
    assert home.end(second.sequence_number, 10).status == R.COMPLETED


def test_chunks_of_a_long_path_join_without_a_gap(home: AxesClient):
    """The stamp of each chunk is its absolute start; psec is the whole path."""
    time, position = swing(4.8)
    size = 200
    origin = on_grid(home, home.now() + NANOSECONDS)
    accepted = []
    for begin in range(0, len(time), size):
        part = slice(begin, begin + size)
        stamp = origin + begin * TSP_NS
        accepted.append(home.accept(joint_trajectory(["x"], time[part] - time[begin], position[part], stamp=stamp)))
        assert to_ns(accepted[-1].start) == stamp
    assert len(accepted) == 5
    assert_psec(home, origin, {"x": position})
    ends = [home.end(result.sequence_number, 10) for result in accepted]
    assert [end.status for end in ends] == [R.COMPLETED] * 5, [end.text for end in ends]


@pytest.mark.parametrize("names", [[], ["x", "y", "z", "a", "c"]], ids=["no joints", "all joints"])
def test_no_points_is_a_controlled_stop(home: AxesClient, names: list[str]):
    """The setpoint comes to rest within the limits of the axis, short of its destination."""
    first, start, _ = start_swing(home, duration=3.0, amplitude=0.2)
    home.wait_until(start + 125 * TSP_NS, 5)
    home.accept(JointTrajectory(joint_names=names))
    ended = home.end(first.sequence_number, 5)
    assert ended.status == R.STOPPED
    now = home.now()
    psec = psec_of(home, "x", start, now + 200 * TSP_NS)
    assert np.abs(np.diff(psec, 2)).max() <= ACCELERATION_LIMIT_X * 0.006**2 * (1 + 1e-6)
    assert np.abs(np.diff(psec)).max() <= SPEED_LIMIT_X * 0.006
    assert np.ptp(psec[-50:]) == 0
    assert 0.01 < psec[-1] < 0.2


def test_joints_that_a_trajectory_omits_continue_their_motion(home: AxesClient):
    """x continues its swing while z moves."""
    _, start, plan = start_swing(home, duration=2.4)
    time, position = swing(0.6, amplitude=0.01)
    accepted = home.accept(joint_trajectory(["z"], time, position))
    assert_psec(home, to_ns(accepted.start), {"z": position})
    assert_psec(home, start, plan)
    assert home.end(accepted.sequence_number, 5).status == R.COMPLETED


def test_order_of_the_joints_is_the_senders(home: AxesClient):
    """Columns are assigned by name."""
    time, position = swing(0.6, amplitude=0.01)
    rows = np.column_stack([position, 2 * position, 0 * position])
    recording = home.run(joint_trajectory(["c", "x", "a"], time, rows))
    assert_psec(home, recording.start, {"c": position, "x": 2 * position, "a": 0 * position})


def test_an_unlimited_rotary_axis_turns_on(home: AxesClient):
    """C has no travel limits: more than a full turn is accepted."""
    home.accept(joint_trajectory(["c"], [30.0], [[7.0]]))


def test_100_000_points_arrive_and_are_executed(fast: AxesClient):
    """Points at 1 ms; those on the position grid are published bit for bit."""
    time = np.arange(100_000) / 1000
    position = np.column_stack([0.1 * np.sin(time / 5), 0.1 * (1 - np.cos(time / 5))])
    position *= np.minimum(1, time / 5)[:, None]
    go_home(fast)
    accepted = fast.accept(joint_trajectory(["x", "y"], time, position), timeout=30)
    ended = fast.end(accepted.sequence_number, 180)
    assert ended.status == R.COMPLETED, ended.text
    on_period = position[::6]
    # The axes finish in seconds; rclpy needs far longer to deliver 50 000 samples.
    assert_psec(fast, to_ns(accepted.start), {"x": on_period[:, 0], "y": on_period[:, 1]}, timeout=240)
