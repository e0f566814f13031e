"""Setpoints: arbitrary trajectories and the circular test."""

from __future__ import annotations

import array
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration, Time
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NANOSECONDS = 1_000_000_000
TSP_NS = 6_000_000
"""Position cycle of the default machine, ns."""


def to_time(stamp_ns: int) -> Time:
    """Returns a ROS time from integer ns."""
    return Time(sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)


def to_ns(stamp: Time) -> int:
    """Returns integer ns from a ROS time."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def joint_trajectory(
    names: Sequence[str],
    times: Sequence[float] | np.ndarray,
    positions: Any,
    velocities: Any = None,
    accelerations: Any = None,
    stamp: int | None = None,
) -> JointTrajectory:
    """Returns setpoints for `names`: `times` in s from the start, a row of positions (m, rad) per time.

    Without velocities the axes go from point to point linearly, with them along cubics, with
    accelerations too along quintics. `stamp` is the start in ns; None starts at once.
    """
    nanoseconds = np.rint(np.asarray(times, dtype=float) * NANOSECONDS).astype(np.int64)
    seconds, rest = np.divmod(nanoseconds, NANOSECONDS)

    def rows(values: Any) -> Iterable[array.array[float]]:
        if values is None:
            return itertools.repeat(array.array("d"))
        table = np.ascontiguousarray(values, dtype=np.float64).reshape(len(nanoseconds), -1)
        width = table.shape[1] * table.itemsize
        data = table.tobytes()
        return (array.array("d", data[i * width : (i + 1) * width]) for i in range(len(nanoseconds)))

    message = JointTrajectory(joint_names=list(names))
    message.points = [
        JointTrajectoryPoint(
            positions=position,
            velocities=velocity,
            accelerations=acceleration,
            time_from_start=Duration(sec=sec, nanosec=nanosec),
        )
        for sec, nanosec, position, velocity, acceleration in zip(
            seconds.tolist(), rest.tolist(), rows(positions), rows(velocities), rows(accelerations)
        )
    ]
    if stamp is not None:
        message.header.stamp = to_time(stamp)
    return message


class Ballbar(NamedTuple):
    """Circle at constant feed with ramps, sampled on the position grid."""

    time: np.ndarray
    """Times from the start, one per position cycle, s."""
    x: np.ndarray
    """X positions, m."""
    y: np.ndarray
    """Y positions, m."""
    steady: tuple[float, float]
    """Span of steady feed, 0.5 s clear of both ramps, s."""
    center: tuple[float, float]
    """Center, m."""
    radius: float
    """Radius, m."""


def ballbar(
    radius: float = 0.150,
    feed: float = 15 / 60,
    turns: float = 2.0,
    rest: float = 0.5,
    ramp: float = 0.5,
    period_ns: int = TSP_NS,
    clear: float = 0.5,
) -> Ballbar:
    """Returns the circular test: counter-clockwise from (0, 0) about (-radius, 0).

    `rest` s at rest, the feed (m/s) rises as feed/2 (1 - cos(pi t/ramp)), `turns` full turns at full
    feed, the same ramp down, `rest` s at rest. The ramps are extra path.
    """
    cruise = turns * 2 * math.pi * radius / feed
    duration = rest + ramp + cruise + ramp + rest
    time_ns = np.arange(math.ceil(duration * NANOSECONDS / period_ns) + 1, dtype=np.int64) * period_ns
    time_s = time_ns / NANOSECONDS

    def ramp_path(t: np.ndarray) -> np.ndarray:
        """Returns the integral of the rising feed, m."""
        return feed / 2 * (t - ramp / math.pi * np.sin(math.pi * t / ramp))

    up = np.clip(time_s - rest, 0, ramp)
    at_feed = np.clip(time_s - rest - ramp, 0, cruise)
    down = np.clip(time_s - rest - ramp - cruise, 0, ramp)
    # The ramp down is the time-reversed ramp up.
    half = feed * ramp / 2
    path = ramp_path(up) + feed * at_feed + half - ramp_path(ramp - down)
    angle = path / radius
    return Ballbar(
        time=time_s,
        x=radius * (np.cos(angle) - 1),
        y=radius * np.sin(angle),
        steady=(rest + ramp + clear, rest + ramp + cruise - clear),
        center=(-radius, 0.0),
        radius=radius,
    )
