"""`use_sim_time`: the axes follow an external /clock through pauses, changes of speed and jumps."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from rclpy.qos import ReliabilityPolicy
from virtual_axes.msg import TrajectoryResult

from action import Follow, goal, line
from motion import assert_psec, swing
from node_process import Node
from sim_clock import SimClock
from virtual_axes_py.ros import (
    NANOSECONDS,
    TSP_NS,
    AxesClient,
    ParameterRejected,
    joint_trajectory,
    stamp_of,
    status_values,
    to_ns,
)

BEGIN = 1_000 * NANOSECONDS + 1_234_567
"""Position cycle, ns."""


@pytest.fixture(scope="module")
def clock() -> Iterator[SimClock]:
    """Yields axes that follow a clock under test control, shared by the module."""
    with (
        Node(["-p", "use_sim_time:=true"]) as process,
        AxesClient(process=process, connect=False) as drive,
    ):
        clock = SimClock(drive, BEGIN)
        clock.connect()
        yield clock


def state_of(drive: AxesClient, wanted: str, timeout: float = 8.0) -> dict[str, str]:
    """Returns the values of the node's diagnostics once its state is the expected one."""
    seen = len(drive.diagnostics())

    def found() -> dict[str, str] | None:
        for array in drive.diagnostics()[seen:]:
            values = status_values(array.status[0])
            if values.get("state") == wanted:
                return values
        return None

    return drive.wait_for(found, timeout, f"diagnostics with the state {wanted}")


def begin_anew(clock: SimClock, first: int) -> None:
    """Jumps to a position cycle and drops all earlier samples."""
    clock.set(first)
    samples = clock.drive._samples.values()
    clock.drive.wait_for(lambda: all(stamp_of(s[-1]) == first for s in samples), 5, f"samples of {first}")
    clock.drive.drop_samples()


def stamps_since(drive: AxesClient, begin: int, end: int) -> np.ndarray:
    """Returns the stamps of all joint states between two times, ns."""
    return drive.record(begin, end).joints.stamp


def test_before_the_first_message_the_axes_wait(start: Callable[..., AxesClient]):
    """The node publishes nothing, services respond, and a trajectory waits for the clock."""
    drive = start("-p", "use_sim_time:=true", connect=False)
    drive.wait_for(lambda: drive._psec.get_subscription_count() > 0, 10, "subscription of psec")
    values = state_of(drive, "waiting for /clock")
    assert (values["time"], values["clock"], values["position_periods"]) == ("sim", "none", "0")
    drive.reset()
    drive.set_parameters({"x.velocity_loop.gain": 4.9})
    begin = BEGIN + 3 * NANOSECONDS
    times, position = swing(0.6)
    soon = drive.send(joint_trajectory(["y"], times, position))
    later = drive.send(joint_trajectory(["x"], times, position, stamp=begin))
    past = drive.send(joint_trajectory(["x"], times, position, stamp=BEGIN - NANOSECONDS))
    drive.stop()
    assert drive.results() == [] and not any(drive._samples.values())
    clock = SimClock(drive, BEGIN, ReliabilityPolicy.RELIABLE)
    drive.wait_for(lambda: clock._publisher.get_subscription_count() > 0, 10, "subscription of /clock")

    def decided() -> bool:
        # The message right after matching can be lost.
        clock.set(BEGIN)
        return bool(drive.results(soon))

    drive.wait_for(decided, 5, "result of a trajectory that waited for the clock")
    first = -(-BEGIN // TSP_NS) * TSP_NS
    assert to_ns(drive.decision(soon).start) == first
    assert to_ns(drive.decision(later).start) == -(-begin // TSP_NS) * TSP_NS
    assert drive.decision(past).code == 10, "ended in the past"
    # The newest stop is executed first.
    clock.connect()
    clock.advance(0.1, 0.006)
    assert drive.end(soon, 5).status == TrajectoryResult.STOPPED


def test_canceling_a_goal_before_the_first_message_keeps_other_goals(start: Callable[..., AxesClient]):
    """The goal ends at once; the other goal begins with the first clock message."""
    drive = start("-p", "use_sim_time:=true", connect=False)
    with Follow(drive) as follow:
        kept, gone = (follow.send(goal(line([joint], [0.01], 0.5))) for joint in ("y", "x"))
        assert kept.handle.accepted and gone.handle.accepted
        gone.cancel()
        assert gone.status() == GoalStatus.STATUS_CANCELED
        clock = SimClock(drive, BEGIN, ReliabilityPolicy.RELIABLE)
        clock.connect()
        clock.advance(1.0, 0.006)
        assert kept.status() == GoalStatus.STATUS_SUCCEEDED


@pytest.mark.parametrize("step", [0.1, 0.001, 0.0137, 2.0], ids=lambda step: f"{1e3 * step:g} ms")
def test_the_grid_is_unbroken_at_any_clock_step(clock: SimClock, step: float):
    """Every position cycle up to the clock is published at any clock step, and none after it."""
    begin = clock.now
    clock.advance(max(0.3, 2 * step), step)
    stamps = stamps_since(clock.drive, begin, clock.now + NANOSECONDS)
    assert np.array_equal(stamps, np.arange(-(-begin // TSP_NS) * TSP_NS, clock.now + 1, TSP_NS))


def test_a_motion_has_the_same_bits_at_any_speed(clock: SimClock, fast: AxesClient):
    """Slow, ten times faster, in leaps and with a pause, compared with another node in `fast`."""
    drive = clock.drive
    drive.set_parameters({"x.velocity_loop.gain": 5.0})
    drive.reset()
    times, position = swing(3.0)
    motion = joint_trajectory(["x", "c"], times, np.column_stack([position, 3 * position]))
    sent = drive.send(motion)
    drive.decision(sent)
    clock.advance(0.1, 0.001)
    clock.advance(0.5, 0.01)
    time.sleep(0.2)
    for _ in range(5):
        clock.set(clock.now)
    clock.advance(0.5, 0.1)
    clock.advance(0.6, 0.25)
    clock.advance(2.0, 0.05)
    end = drive.end(sent, 10)
    assert end.status == TrajectoryResult.COMPLETED
    followed = drive.record(to_ns(end.start), to_ns(end.start) + 3 * NANOSECONDS)
    fast.reset()
    free = fast.run(motion)
    assert len(followed.joints) == len(free.joints) == len(times)
    for kind, field in [
        ("joints", "position"),
        ("joints", "velocity"),
        ("states", "psec"),
        ("currents", "current"),
        ("states", "voltage"),
    ]:
        np.testing.assert_array_equal(getattr(followed, kind)[field], getattr(free, kind)[field], err_msg=field)
    assert end.max_tracking_error == free.result.max_tracking_error


def test_with_a_paused_clock_the_axes_rest_and_services_respond(clock: SimClock):
    """Also more trajectories than the queue holds: each gets a result."""
    drive = clock.drive
    drive.reset()
    clock.advance(0.06, 0.006)
    times, position = swing(1.2)
    sent = drive.send(joint_trajectory(["x"], times, position))
    drive.decision(sent)
    clock.advance(0.3, 0.006)
    stood_at = drive.now()
    values = state_of(drive, "paused")
    assert values["clock"] == "followed" and values["behind_clock_ms"] == "0"
    drive.set_parameters({"x.velocity_loop.gain": 4.5})
    assert drive.get_parameters(["x.velocity_loop.gain"]) == {"x.velocity_loop.gain": 4.5}
    # One swing each, one after the other, on another joint.
    begin = stood_at + NANOSECONDS
    many = [
        drive.send(joint_trajectory(["y"], times[:11], 0 * times[:11], stamp=begin + n * NANOSECONDS))
        for n in range(200)
    ]
    decided = [drive.decision(number).status for number in many]
    assert decided == [TrajectoryResult.ACCEPTED] * len(many)
    assert drive.stop() and drive.now() == stood_at
    drive.reset()
    assert drive.end(sent, 5).status == TrajectoryResult.ABORTED
    assert {drive.end(number, 5).status for number in many} <= {TrajectoryResult.ABORTED, TrajectoryResult.STOPPED}
    assert drive.now() == stood_at
    # The axes continue where they were, at rest at home.
    clock.advance(0.06, 0.006)
    stamps = stamps_since(drive, stood_at, clock.now)
    assert set(np.diff(stamps)) == {TSP_NS}
    assert drive.latest("position")["x"] == 0.0


@pytest.mark.parametrize(
    ("to", "what"),
    [
        (lambda now: now - NANOSECONDS, "back"),
        (lambda now: now + 60 * NANOSECONDS, "far ahead"),
        (lambda _: 0, "back to zero"),
        (lambda _: BEGIN, "where it was"),
    ],
    ids=["back", "far-ahead", "to-zero", "to-where-it-was"],
)
def test_a_jump_stops_the_motion_and_starts_a_new_grid(clock: SimClock, to: Callable[[int], int], what: str):
    """The axes come to rest within their limits, and accept trajectories by the new time."""
    drive = clock.drive
    times, position = swing(2.0)
    sent = drive.send(joint_trajectory(["x"], times, position + drive.latest("psec")["x"]))
    assert drive.decision(sent).status == TrajectoryResult.ACCEPTED
    clock.advance(0.5, 0.006)
    drive.stream(["z"], [0.001])
    before, target = clock.now, to(clock.now)
    first = -(-target // TSP_NS) * TSP_NS
    clock.set(target)
    end = drive.end(sent, 5)
    assert end.status == TrajectoryResult.ABORTED
    assert end.text == f"the clock jumped from {before // TSP_NS * TSP_NS / 1e9:.3f} s to {first / 1e9:.3f} s"
    assert "the clock jumped from" in drive.process.output()
    begin_anew(clock, first)
    # Longer than the axis needs to stop.
    clock.advance(1.0, 0.02)
    series = drive.record(first, clock.now)
    assert np.array_equal(series.joints.stamp, np.arange(first, clock.now + 1, TSP_NS)), what
    assert abs(drive.latest("velocity")["x"]) < 1e-4
    psec = series.states["psec", "x"]
    assert np.all(psec[-20:] == psec[-1])
    begin = clock.now + NANOSECONDS // 2
    again = drive.accept(joint_trajectory(["x"], [0.0, 0.06], [[psec[-1]]] * 2, stamp=begin))
    clock.advance(1.0, 0.02)
    assert drive.end(again.sequence_number, 5).status == TrajectoryResult.COMPLETED


def test_the_clock_is_changed_while_the_node_runs(start: Callable[..., AxesClient]):
    """A motion is aborted; the positions continue on the other clock, without a sample before its first message."""
    drive = start()
    times, position = swing(2.0)
    for _ in range(2):
        moved = drive.accept(joint_trajectory(["x"], times, position + drive.latest("psec")["x"])).sequence_number
        drive.wait_for(lambda: abs(drive.latest("velocity")["x"]) > 1e-3, 5, "motion")
        drive.set_parameters({"use_sim_time": True})
        values = state_of(drive, "waiting for /clock")
        assert (values["time"], values["clock"]) == ("sim", "none")
        # Without waiting for the clock: a client waits for the result of its goal.
        ended = drive.end(moved, 5)
        assert (ended.status, ended.text) == (
            TrajectoryResult.ABORTED,
            "use_sim_time was set: the time is that of /clock",
        )
        last = drive.latest("position")["x"]
        drive.drop_samples()
        clock = SimClock(drive, BEGIN)
        drive.wait_for(lambda: clock._publisher.get_subscription_count() > 0, 10, "subscription of /clock")

        def follows() -> bool:
            # A best-effort message is lost if the subscription does not know the publisher yet.
            clock.set(clock.now + TSP_NS)
            return stamp_of(drive._samples["states"][-1]) < time.time_ns() // 2

        drive.wait_for(follows, 10, "samples by /clock")
        first = clock.now
        clock.advance(1.0, 0.02)
        assert np.array_equal(
            stamps_since(drive, first, clock.now), np.arange(-(-first // TSP_NS) * TSP_NS, clock.now + 1, TSP_NS)
        )
        # The axis comes to rest within its limits, on less than 0.1 m.
        assert 0.0 < abs(drive.latest("position")["x"] - last) < 0.1
        rest = drive.latest("psec")["x"]
        begin = clock.now + NANOSECONDS // 2
        done = drive.accept(joint_trajectory(["x"], [0.0, 0.6], [[rest], [rest]], stamp=begin)).sequence_number
        drive.set_parameters({"use_sim_time": False})
        assert drive.end(done, 5).status == TrajectoryResult.ABORTED
        drive.wait_for(lambda: abs(drive.now() - time.time_ns()) < NANOSECONDS, 5, "stamps of the wall clock")
        assert drive.latest("psec")["x"] == pytest.approx(rest, abs=1e-12)
        drive.node.destroy_publisher(clock._publisher)
    assert drive.get_parameters(["use_sim_time"]) == {"use_sim_time": False}


def test_fast_time_keeps_its_clock(fast: AxesClient):
    """It publishes `/clock` and cannot follow it."""
    with pytest.raises(ParameterRejected, match="time = fast publishes /clock"):
        fast.set_parameters({"use_sim_time": True})


def test_jumps_are_counted(clock: SimClock):
    """A step of nine seconds is not a jump: it is simulated."""
    drive = clock.drive
    jumps = int(state_of(drive, "paused")["clock_jumps"])
    begin = clock.now
    clock.reach(begin + 9 * NANOSECONDS)
    stamps = stamps_since(drive, begin, clock.now)
    assert len(stamps) == 9 * NANOSECONDS // TSP_NS and set(np.diff(stamps)) == {TSP_NS}
    assert int(state_of(drive, "paused")["clock_jumps"]) == jumps
    begin_anew(clock, begin // TSP_NS * TSP_NS)
    drive.wait_for(
        lambda: int(status_values(drive.diagnostics()[-1].status[0])["clock_jumps"]) == jumps + 1,
        5,
        "count of the jump",
    )
    assert any("the clock jumped" in array.status[0].message for array in drive.diagnostics()[-3:])


def test_a_stamp_of_the_wall_clock_is_rejected(clock: SimClock):
    """Such a trajectory would wait for decades."""
    drive = clock.drive
    motion = joint_trajectory(["y"], [0.0, 0.1], [[0.0], [0.0]], stamp=time.time_ns())
    decision = drive.decision(drive.send(motion))
    assert decision.status == TrajectoryResult.REJECTED
    assert "use_sim_time" in decision.text


def test_a_chunk_by_absolute_times_is_followed_by_the_clock(clock: SimClock):
    """The stamps of trajectories are times of the followed clock."""
    drive = clock.drive
    drive.reset()
    clock.advance(0.06, 0.006)
    times, position = swing(0.6)
    begin = -(-(clock.now + NANOSECONDS) // TSP_NS) * TSP_NS
    accepted = drive.accept(joint_trajectory(["x"], times, position, stamp=begin))
    assert to_ns(accepted.start) == begin
    clock.advance(2.0, 0.05)
    assert_psec(drive, begin, {"x": position})
