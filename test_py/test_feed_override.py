"""Feed override (~/speed_scaling_input), feed hold and cycle start of trajectories."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import rclpy
from control_msgs.msg import JointTrajectoryControllerState, SpeedScalingFactor
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger
from virtual_axes.msg import TrajectoryResult as R

from motion import TSP, go_home, swing
from node_process import DomainId, Node
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, to_ns

ACCELERATION, JERK = 2.5, 50.0
"""Limits of x and y of the default machine, m/s² and m/s³."""


class Feed:
    """Feed override of a node."""

    def __init__(self, drive: AxesClient):
        """Waits for the node's subscription and services."""
        self.drive = drive
        self.rates: list[tuple[int, float]] = []
        topic = f"{drive.target}/speed_scaling_input"
        self._publisher = drive.in_executor(lambda: drive.node.create_publisher(SpeedScalingFactor, topic, 10))
        drive.in_executor(
            lambda: drive.node.create_subscription(
                JointTrajectoryControllerState, f"{drive.target}/controller_state", self._keep, 1000
            )
        )
        drive.wait_for(lambda: self._publisher.get_subscription_count() and self.rates, 20, topic)

    def _keep(self, message: JointTrajectoryControllerState) -> None:
        self.rates.append((to_ns(message.header.stamp), message.speed_scaling_factor))

    def publish(self, factor: float) -> None:
        """Publishes a feed override."""
        self._publisher.publish(SpeedScalingFactor(factor=factor))

    def wait_for_rate(self, rate: float) -> int:
        """Waits until the feed override in effect is `rate`; returns the time, ns."""
        self.drive.wait_for(lambda: self.rates[-1][1] == rate, 20, f"feed override {rate}")
        return self.rates[-1][0]

    def call(self, service: str) -> None:
        """Calls ~/feed_hold or ~/cycle_start."""
        response = self.drive.call(Trigger, service, Trigger.Request())
        assert response.success, response.message


@pytest.fixture(scope="module")
def feed(fast: AxesClient) -> Feed:
    return Feed(fast)


@pytest.fixture(autouse=True)
def at_home(feed: Feed) -> None:
    """Sets the feed override to 1 and moves the axes home."""
    feed.publish(1.0)
    go_home(feed.drive)
    feed.wait_for_rate(1.0)


def diagonal(duration: float, amplitude: float = 0.1):
    """Returns a trajectory of x and y along y = x / 2, and its setpoints of x."""
    time, x = swing(duration, amplitude)
    return joint_trajectory(["x", "y"], time, np.column_stack([x, x / 2])), x


def execute(drive: AxesClient, trajectory):
    """Executes a trajectory to its end; returns the drive states from before its start to its end."""
    accepted = drive.accept(trajectory)
    ended = drive.end(accepted.sequence_number, 60)
    assert ended.status == R.COMPLETED
    end = to_ns(ended.header.stamp)
    drive.wait_until(end, 20)
    return drive.record(to_ns(accepted.start) - 4 * TSP_NS, end).states


def assert_on_path_within_limits(states) -> None:
    x, y = states["psec", "x"], states["psec", "y"]
    assert np.abs(y - x / 2).max() <= 1e-9
    for psec in (x, y):
        assert np.abs(np.diff(psec, 2)).max() / TSP**2 <= ACCELERATION * (1 + 1e-6)
        assert np.abs(np.diff(psec, 3)).max() / TSP**3 <= JERK * (1 + 1e-6)


@pytest.mark.parametrize("factor", [0.5, 0.25])
def test_a_constant_override_stretches_a_trajectory(feed: Feed, factor: float) -> None:
    feed.publish(factor)
    feed.wait_for_rate(factor)
    trajectory, x = diagonal(4.0)
    states = execute(feed.drive, trajectory)
    every = round(1 / factor)
    psec = states["psec", "x"]
    # Each second or fourth setpoint is one of the plan.
    start = np.flatnonzero(psec > 0)[0]
    for first in range(start, start + every):
        found = psec[first : first + every * (len(x) - 1) : every]
        if abs(found[0] - x[1]) <= 1e-12:
            break
    assert np.abs(found - x[1 : 1 + len(found)]).max() <= 1e-12
    assert len(found) >= len(x) - 2
    assert_on_path_within_limits(states)


def test_an_override_of_200_percent_is_limited_by_the_axes_only(feed: Feed) -> None:
    feed.publish(2.0)
    trajectory, x = diagonal(8.0)
    states = execute(feed.drive, trajectory)
    moving = np.count_nonzero(np.diff(states["psec", "x"]))
    # Far within the limits: almost half of the time, with a ramp at the start.
    assert 0.5 * len(x) <= moving <= 0.55 * len(x)
    assert_on_path_within_limits(states)
    assert states["psec", "x"][-1] == x[-1]


def test_a_feed_hold_stops_on_the_path_and_cycle_start_continues(feed: Feed) -> None:
    drive = feed.drive
    trajectory, x = diagonal(60.0, amplitude=0.3)
    accepted = drive.accept(trajectory)
    start = to_ns(accepted.start)
    drive.wait_for(lambda: drive.latest("psec")["x"] > 0.01, 20, "motion")
    feed.call("feed_hold")
    stopped = feed.wait_for_rate(0.0)
    assert drive.next_status()["state"] == "feed hold"
    drive.wait_until(stopped + NANOSECONDS // 2, 20)
    held = drive.record(stopped + 2 * TSP_NS, stopped + NANOSECONDS // 2).states["psec", "x"]
    assert np.ptp(held) == 0 and 0 < held[0] < 0.3
    feed.call("cycle_start")
    ended = drive.end(accepted.sequence_number, 60)
    assert ended.status == R.COMPLETED
    end = to_ns(ended.header.stamp)
    drive.wait_until(end, 20)
    states = drive.record(start - 4 * TSP_NS, end).states
    assert_on_path_within_limits(states)
    assert states["psec", "x"][-1] == x[-1]
    assert end - start >= 60 * NANOSECONDS + (NANOSECONDS // 2)


def test_a_trajectory_during_a_feed_hold_waits_for_cycle_start(feed: Feed) -> None:
    drive = feed.drive
    feed.call("feed_hold")
    feed.wait_for_rate(0.0)
    trajectory, x = diagonal(2.0)
    accepted = drive.accept(trajectory)
    drive.wait_until(drive.now() + NANOSECONDS // 2, 20)
    assert drive.latest("psec")["x"] == 0
    feed.call("cycle_start")
    ended = drive.end(accepted.sequence_number, 30)
    assert ended.status == R.COMPLETED
    drive.wait_until(to_ns(ended.header.stamp), 20)
    assert drive.latest("psec")["x"] == x[-1]


def test_a_controlled_stop_ends_a_trajectory_in_a_feed_hold(feed: Feed) -> None:
    drive = feed.drive
    accepted = drive.accept(diagonal(60.0)[0])
    drive.wait_for(lambda: drive.latest("psec")["x"] > 0.01, 20, "motion")
    feed.call("feed_hold")
    feed.wait_for_rate(0.0)
    drive.stop()
    assert drive.end(accepted.sequence_number, 10).status == R.STOPPED
    feed.call("cycle_start")
    feed.wait_for_rate(1.0)


@pytest.mark.parametrize("factor", [-0.5, 2.5, math.nan, math.inf])
def test_an_invalid_override_is_ignored_with_a_warning(start: Callable[..., AxesClient], factor: float) -> None:
    drive = start("-p", "time:=fast")
    feed = Feed(drive)
    feed.publish(0.5)
    feed.wait_for_rate(0.5)
    feed.publish(factor)
    value = {math.inf: "inf", 2.5: "2.5", -0.5: "-0.5"}.get(factor, "NaN")
    text = f"speed_scaling_input message ignored: feed override {value} must be a number from 0 to 2 (200 %)"
    drive.wait_for(lambda: text in drive.process.output(), 10, "warning")
    drive.wait_until(drive.now() + 10 * TSP_NS, 10)
    assert feed.rates[-1][1] == 0.5


def test_a_latched_feed_override_is_received_at_the_start() -> None:
    """As joint_trajectory_controller, which subscribes with transient-local durability."""
    domain = DomainId()
    context = Context()
    try:
        rclpy.init(context=context, domain_id=domain.value)
        pendant = rclpy.create_node("pendant", context=context)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher = pendant.create_publisher(SpeedScalingFactor, "/virtual_axes/speed_scaling_input", latched)
        publisher.publish(SpeedScalingFactor(factor=0.25))
        with Node(["-p", "time:=fast"], domain_id=domain.value) as process, AxesClient(process=process) as drive:
            feed = Feed(drive)
            feed.wait_for_rate(0.25)
            # Another publisher, without durability, and the first one again.
            feed.publish(0.5)
            feed.wait_for_rate(0.5)
            publisher.publish(SpeedScalingFactor(factor=0.75))
            feed.wait_for_rate(0.75)
        pendant.destroy_node()
    finally:
        rclpy.try_shutdown(context=context)
        domain.release()
