"""What the axes said, as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from virtual_axes.msg import TrajectoryResult

from .trajectories import NANOSECONDS, to_ns


class Series:
    """What one topic said over a span of time: a row per message, a column per joint."""

    def __init__(self, messages: Sequence[Any], fields: Sequence[str]):
        """Keep `fields` of `messages`, which carry header and name."""
        self.stamp = np.array([to_ns(m.header.stamp) for m in messages], dtype=np.int64)
        """ns"""
        self.name: list[str] = list(messages[0].name) if messages else []
        for message in messages:
            if list(message.name) != self.name:
                raise ValueError(f"the joints changed from {self.name} to {list(message.name)}")
        self._columns = {field: np.array([getattr(m, field) for m in messages]) for field in fields}

    def __getitem__(self, key: str | tuple[str, str]) -> np.ndarray:
        """`series["position"]` is rows by joints, `series["position", "x"]` one joint's."""
        if isinstance(key, tuple):
            return self._columns[key[0]][:, self.name.index(key[1])]
        return self._columns[key]

    def __len__(self) -> int:
        """Number of messages."""
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
    """All that the node published while it executed a trajectory."""

    start: int
    """When time 0 of the trajectory was, ns."""
    joints: Series
    """`joint_states`: position, velocity (m, m/s; rad, rad/s), effort (N, N.m)."""
    currents: Series
    """`~/motor_currents`: current, current_setpoint, friction, gravity, load (A), saturated."""
    states: Series
    """`~/drive_states`: psec, position, ..., see DriveStates.msg."""
    result: TrajectoryResult | None = None
    """How it ended."""

    @property
    def time(self) -> np.ndarray:
        """Time of the joint states, s from the start of the trajectory."""
        return (self.joints.stamp - self.start) / NANOSECONDS

    def within(self, span: tuple[float, float]) -> np.ndarray:
        """Mask of the joint states from span[0] to span[1], s from the start."""
        return (self.time >= span[0]) & (self.time <= span[1])

    def tracking_error(self, joint: str) -> np.ndarray:
        """PSEC - SP at every position instant; contains the pure delay."""
        return self.states["psec", joint] - self.states["position", joint]

    def synchronized_tracking_error(self, joint: str, alpha_periods: float = 1.5) -> np.ndarray:
        """PSEC_floor(k - alpha) - SP_k: what the controller is asked to follow."""
        shift = math.ceil(alpha_periods)
        psec = self.states["psec", joint]
        delayed = np.concatenate([np.full(shift, psec[0]), psec])[: len(psec)]
        return delayed - self.states["position", joint]

    def radial_deviation(
        self, center: tuple[float, float], radius: float, axes: tuple[str, str] = ("x", "y")
    ) -> np.ndarray:
        """Distance from the center less the radius, at every joint state, m (ISO 230-4)."""
        x, y = (self.joints["position", axis] for axis in axes)
        return np.hypot(x - center[0], y - center[1]) - radius


def circular_deviation(radial_deviation: np.ndarray) -> float:
    """Circular deviation G after ISO 230-4: the largest less the smallest radial deviation, m."""
    return float(np.ptp(radial_deviation))
