"""Ten seconds in real time: no instant is missing or duplicated."""

from __future__ import annotations

import time

import numpy as np
from sensor_msgs.msg import JointState

from virtual_axes_py.ros import DEEP_QOS, NANOSECONDS, TSP_NS, AxesClient, to_ns


def test_ten_seconds_are_an_unbroken_grid(real: AxesClient):
    """Stamps are exactly 6 ms apart; their latency is printed and not asserted."""
    arrivals: list[tuple[int, int]] = []

    def keep(message: JointState) -> None:
        arrivals.append((to_ns(message.header.stamp), time.time_ns()))

    subscription = real.in_executor(lambda: real.node.create_subscription(JointState, "/joint_states", keep, DEEP_QOS))
    try:
        begin = real.now()
        real.wait_until(begin + 10 * NANOSECONDS, 20)
    finally:
        real.in_executor(lambda: real.node.destroy_subscription(subscription))
    recording = real.record(begin, begin + 10 * NANOSECONDS)
    for series in (recording.joints, recording.currents, recording.states):
        assert len(series) == 10 * NANOSECONDS // TSP_NS + 1
        assert set(np.diff(series.stamp)) == {TSP_NS}

    late = np.array([arrived - stamp for stamp, arrived in arrivals]) / 1e6
    p50, p99 = np.percentile(late, [50, 99])
    print(f"\nlateness of {late.size} samples in rclpy: p50 {p50:.2f} ms, p99 {p99:.2f} ms, max {late.max():.2f} ms")
