"""`time: fast` and its /clock."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from drive import TSP_NS, Drive, joint_trajectory, to_ns

DEEP = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE)
LONG = 30.0
"""Duration of a motion that real time would take long for, s."""


def test_fast_outruns_the_wall_clock_on_an_unbroken_grid(start: Callable[..., Drive]):
    """Half a minute of motion; the clock shows each position instant once, and so do the samples."""
    drive = start("-p", "time:=fast")
    ticks: list[int] = []
    drive.node.create_subscription(Clock, "/clock", lambda message: ticks.append(to_ns(message.clock)), DEEP)
    drive.wait_for(lambda: ticks, 10, "tick of the clock")
    began = time.monotonic()
    recording = drive.run(joint_trajectory(["x"], [0.0, LONG], [[0.0], [0.3]]), timeout=60)
    elapsed = time.monotonic() - began
    print(f"{LONG} s of motion, {LONG / elapsed:.1f} times real time")
    assert set(np.diff(recording.joints.stamp)) == {TSP_NS}
    assert len(recording.joints) == LONG * 1e9 / TSP_NS + 1
    end = recording.joints.stamp[-1]
    drive.wait_for(lambda: ticks[-1] >= end, 10, "tick at the end of the motion")
    shown = np.array(ticks)
    shown = shown[(shown >= recording.start) & (shown <= end)]
    np.testing.assert_array_equal(shown, recording.joints.stamp)


def test_an_idle_fast_node_floods_nobody(start: Callable[..., Drive]):
    """With nothing to do the clock goes at real pace."""
    drive = start("-p", "time:=fast")
    before, began = drive.now(), time.monotonic()
    time.sleep(1.0)
    shown, passed = (drive.now() - before) / 1e9, time.monotonic() - began
    # Slower on a busy machine, never faster.
    assert 0 < shown < 1.5 * passed


def test_the_clock_of_somebody_else_is_left_alone(start: Callable[..., Drive]):
    """Where another node publishes /clock, this one holds back, and comes back when that one is gone."""
    drive = start("-p", "time:=fast")
    ticks: list[int] = []
    drive.node.create_subscription(Clock, "/clock", lambda message: ticks.append(to_ns(message.clock)), DEEP)
    drive.wait_for(lambda: ticks, 10, "tick of the clock")
    other = drive.node.create_publisher(Clock, "/clock", DEEP)
    drive.wait_for(lambda: "holding back" in drive.process.output(), 10, "notice of the other clock")
    time.sleep(0.3)
    count = len(ticks)
    time.sleep(0.5)
    assert len(ticks) == count
    drive.node.destroy_publisher(other)
