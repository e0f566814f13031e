"""Published messages of the axes as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from virtual_axes.msg import TrajectoryResult

from .trajectories import NANOSECONDS, to_ns


class Series:
    """Messages of one topic over a time span: a row per message, a column per joint."""

    def __init__(self, messages: Sequence[Any], fields: Sequence[str]):
        """Keeps `fields` of `messages`, which have header and name."""
        self.stamp = np.array([to_ns(m.header.stamp) for m in messages], dtype=np.int64)
        """Stamps, ns."""
        self.name: list[str] = list(messages[0].name) if messages else []
        for message in messages:
            if list(message.name) != self.name:
                raise ValueError(f"the joints changed from {self.name} to {list(message.name)}")
        self._columns = {field: np.array([getattr(m, field) for m in messages]) for field in fields}

    def __getitem__(self, key: str | tuple[str, str]) -> np.ndarray:
        """Returns rows by joints for `series["position"]`, one joint for `series["position", "x"]`."""
        if isinstance(key, tuple):
            return self._columns[key[0]][:, self.name.index(key[1])]
        return self._columns[key]

    def __len__(self) -> int:
        """Returns the number of messages."""
        return len(self.stamp)


STATE_FIELDS = (
    "psec",
    "position",
    "tracking_error",
    "synchronized_tracking_error",
    "velocity",
    "velocity_setpoint",
    "velocity_feedforward",
    "torque_feedforward",
    "voltage",
    "controller",
)
CURRENT_FIELDS = ("current", "current_setpoint", "friction", "gravity", "load", "saturated")
JOINT_FIELDS = ("position", "velocity", "effort")


@dataclass(frozen=True)
class Recording:
    """All messages that the node published while it executed a trajectory."""

    start: int
    """Time 0 of the trajectory, ns."""
    joints: Series
    """`joint_states`: position, velocity (m, m/s; rad, rad/s), effort (N, N·m)."""
    currents: Series
    """`~/motor_currents`: current, current_setpoint, friction, gravity, load (A), saturated."""
    states: Series
    """`~/drive_states`: psec, position, ..., see DriveStates.msg."""
    result: TrajectoryResult | None = None
    """Final result of the trajectory."""

    @property
    def time(self) -> np.ndarray:
        """Returns the times of the joint states, s from the start of the trajectory."""
        return (self.joints.stamp - self.start) / NANOSECONDS

    def within(self, span: tuple[float, float]) -> np.ndarray:
        """Returns a mask of the joint states from span[0] to span[1], s from the start."""
        return (self.time >= span[0]) & (self.time <= span[1])

    def following_error(self, joint: str) -> np.ndarray:
        """Returns the following error PSEC − SP at all position cycles, m or rad; it contains the pure delay."""
        error: np.ndarray = self.states["psec", joint] - self.states["position", joint]
        return error

    def delay_compensated_following_error(self, joint: str, alpha_periods: float = 1.5) -> np.ndarray:
        """Returns the delay-compensated following error PSEC(k − ⌈α⌉) − SP(k), m or rad; α in position cycles."""
        shift = math.ceil(alpha_periods)
        psec = self.states["psec", joint]
        delayed = np.concatenate([np.full(shift, psec[0]), psec])[: len(psec)]
        error: np.ndarray = delayed - self.states["position", joint]
        return error

    def radial_deviation(
        self, center: tuple[float, float], radius: float, axes: tuple[str, str] = ("x", "y")
    ) -> np.ndarray:
        """Returns the distance from the center minus the radius, at all joint states, m (ISO 230-4)."""
        x, y = (self.joints["position", axis] for axis in axes)
        return np.hypot(x - center[0], y - center[1]) - radius


def circular_deviation(radial_deviation: np.ndarray) -> float:
    """Returns the circular deviation G of ISO 230-4: maximum minus minimum radial deviation, m."""
    return float(np.ptp(radial_deviation))
