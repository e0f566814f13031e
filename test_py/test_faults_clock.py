"""Invalid clocks: two contending clocks an hour apart, and invalid times."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.qos import ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from virtual_axes.msg import TrajectoryResult as R

from motion import assert_psec, swing
from node_process import Node
from sim_clock import SimClock
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, to_ns

BEGIN = 1_000 * NANOSECONDS
APART = 3_600 * NANOSECONDS
MESSAGES = 300
LINES_A_SECOND = 55
"""Maximum number of log lines of one kind: 50, plus the notice of suppression."""


@pytest.fixture(scope="module")
def clock() -> Iterator[SimClock]:
    """Yields axes that follow a clock under test control, shared by the module."""
    with Node(["-p", "use_sim_time:=true"]) as process, AxesClient(process=process, connect=False) as drive:
        clock = SimClock(drive, BEGIN, ReliabilityPolicy.RELIABLE)
        clock.connect()
        yield clock


def jumps(drive: AxesClient) -> int:
    """Returns the number of jumps that the node has counted, from the next diagnostics."""
    return int(drive.next_status()["clock_jumps"])


def runs_as_before(clock: SimClock) -> None:
    """Asserts that a trajectory on the clock is followed bit for bit, on an unbroken grid."""
    drive = clock.drive
    drive.reset()
    clock.advance(0.06, 0.006)
    time_s, position = swing(0.6)
    begin = -(-(clock.now + NANOSECONDS) // TSP_NS) * TSP_NS
    accepted = drive.accept(joint_trajectory(["x"], time_s, position, stamp=begin))
    clock.advance(2.0, 0.05)
    assert_psec(drive, to_ns(accepted.start), {"x": position})


def test_two_contending_clocks_are_counted_as_jumps_with_a_limited_log(clock: SimClock):
    """Each change between the clocks stops the motion; after one clock has left, the other is followed normally."""
    drive = clock.drive
    time_s, position = swing(6.0)
    moving = drive.accept(joint_trajectory(["y"], time_s, position))
    clock.advance(0.3, 0.006)
    before, logged_before = jumps(drive), len(drive.process.output())
    other = SimClock(drive, clock.now + APART, ReliabilityPolicy.RELIABLE)
    drive.wait_for(lambda: other._publisher.get_subscription_count() > 0, 10, "match of another clock")
    begin = time.monotonic()
    for _ in range(MESSAGES):
        clock.set(clock.now + TSP_NS)
        other.set(other.now + TSP_NS)
        time.sleep(0.001)
    assert drive.end(moving.sequence_number, 10).status == R.ABORTED
    counted = jumps(drive) - before
    lines = drive.process.output()[logged_before:].count("the clock jumped")
    seconds = time.monotonic() - begin
    # The clock is best effort: a message that is not taken in time is overwritten.
    assert 2 <= counted <= 2 * MESSAGES
    assert 1 <= lines <= LINES_A_SECOND * (seconds + 1)
    cause = f"/clock: 2 publishers, of /{drive.name}, /{drive.name}; each change between their times is a jump"
    drive.wait_for(lambda: cause in drive.process.output(), 5, "the cause of the jumps")
    assert drive.process.output().count(cause) == 1
    other.close()
    clock.advance(0.3, 0.006)
    runs_as_before(clock)


def test_invalid_times_are_ignored_and_logged_once(clock: SimClock):
    """Times before the epoch or with more than 1e9 nanoseconds are ignored; the largest valid time is a jump."""
    drive = clock.drive
    clock.advance(0.06, 0.006)
    stood_at = drive.now()
    logged_before = len(drive.process.output())
    for _ in range(100):
        clock._publisher.publish(Clock(clock=Time(sec=-1, nanosec=0)))
        clock._publisher.publish(Clock(clock=Time(sec=1, nanosec=4_000_000_000)))
    drive.wait_for(lambda: "invalid time" in drive.process.output()[logged_before:], 10, "log of an invalid time")
    time.sleep(0.2)
    assert drive.now() == stood_at
    assert drive.process.output()[logged_before:].count("invalid time") == 1
    back, last = clock.now, (2**31 - 1) * NANOSECONDS // TSP_NS * TSP_NS
    for _ in range(3):
        clock.reach(last)
        clock.set(back)
        drive.wait_for(lambda: drive.now() <= back + TSP_NS, 10, "jump back")
    assert np.isfinite(list(drive.latest("position").values())).all()
    runs_as_before(clock)
