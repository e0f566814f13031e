"""Simulated clock under test control: `/clock` for a node with use_sim_time."""

from __future__ import annotations

import time

import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from virtual_axes_py.ros import TSP_NS, AxesClient, to_time

REPEAT_S = 0.1
"""Timeout for a response, s. The clock is best effort: after it the time is published again."""


class SimClock:
    """Publisher of `/clock` through a AxesClient's node, best effort like rosbag2, or reliable."""

    def __init__(self, drive: AxesClient, now: int, reliability: ReliabilityPolicy = ReliabilityPolicy.BEST_EFFORT):
        """Creates the publisher; the clock will begin at `now`, ns."""
        self.drive = drive
        self.now = now
        self._publisher = drive.node.create_publisher(Clock, "/clock", QoSProfile(depth=10, reliability=reliability))

    def set(self, now: int) -> None:
        """Publishes the time `now`, ns."""
        self.now = now
        self._publisher.publish(Clock(clock=to_time(now)))

    def connect(self, timeout: float = 20.0) -> None:
        """Waits until the clock is matched in both directions."""
        deadline = time.monotonic() + timeout
        while self._publisher.get_subscription_count() == 0 and time.monotonic() < deadline:
            time.sleep(0.01)
        while True:
            self.set(self.now + TSP_NS)
            try:
                self.drive.connect(timeout=0.05)
                return
            except TimeoutError:
                if time.monotonic() > deadline:
                    raise

    def reach(self, now: int, timeout: float = 20.0) -> None:
        """Sets the clock to `now` (ns) and waits for the axes."""
        self.set(now)
        last = now // TSP_NS * TSP_NS
        deadline = time.monotonic() + timeout
        while True:
            try:
                self.drive.wait_until(last, REPEAT_S)
                return
            except TimeoutError:
                if time.monotonic() > deadline:
                    raise
                self.set(now)

    def advance(self, duration: float, step: float, timeout: float = 20.0) -> None:
        """Advances by `duration` in steps of `step` s, as fast as possible, and waits for the axes."""
        end = self.now + round(duration * 1e9)
        for instant in np.arange(self.now, end, round(step * 1e9)).tolist()[1:]:
            self.set(instant)
            # Yields the processor to other subscribers on this machine.
            time.sleep(0.0005)
        self.reach(end, timeout)

    def close(self) -> None:
        """Destroys the publisher."""
        self.drive.in_executor(lambda: self.drive.node.destroy_publisher(self._publisher))
