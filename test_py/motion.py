"""Motions for several tests, and the comparison of psec with the plan."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from virtual_axes_py.ros import TSP_NS, AxesClient, joint_trajectory, to_ns

TSP = TSP_NS / 1e9
"""Position cycle, s."""
RATIO = 0.02 / (2 * math.pi)
"""Pitch of the default machine's ball screws, m of the axis per rad of the motor."""


def swing(duration: float, amplitude: float = 0.05, rest: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Returns times on the position grid and positions of one swing 0 -> amplitude -> 0, after a rest."""
    periods = round((duration + rest) / TSP)
    time = np.arange(periods + 1) * TSP_NS / 1e9
    phase = np.clip((time - rest) / (periods * TSP - rest), 0, 1)
    return time, amplitude / 2 * (1 - np.cos(2 * np.pi * phase))


def on_grid(drive: AxesClient, instant: int) -> int:
    """Returns the first position cycle at or after `instant`, ns."""
    return grid_after(drive.now(), instant)


def assert_psec(
    drive: AxesClient,
    start: int,
    plan: Mapping[str, Sequence[float]],
    first: int | None = None,
    last: int | None = None,
    timeout: float = 60.0,
) -> int:
    """Asserts that psec is bit-identical to the plan at all instants from `first` to `last` (ns).

    `start` is when the plan begins; returns the number of instants.
    """
    length = len(next(iter(plan.values())))
    first = start if first is None else first
    last = start + (length - 1) * TSP_NS if last is None else last
    drive.wait_until(last, timeout)
    states = drive.record(first, last).states
    expected = np.arange(grid_after(start, first), last + 1, TSP_NS)
    assert np.array_equal(states.stamp, expected), "instants missing or twice"
    index = (states.stamp - start) // TSP_NS
    for joint, positions in plan.items():
        wanted = np.asarray(positions)[index]
        different = np.flatnonzero(states["psec", joint] != wanted)
        assert different.size == 0, (
            f"psec of {joint} differs at {different.size} of {index.size} instants, first at point "
            f"{index[different[0]]}: {states['psec', joint][different[0]]!r}, planned {wanted[different[0]]!r}"
        )
    return index.size


def grid_after(start: int, instant: int) -> int:
    """Returns the first position cycle at or after `instant` on the grid through `start`, ns."""
    return start + -(-(instant - start) // TSP_NS) * TSP_NS


def start_swing(drive: AxesClient, joints: Sequence[str] = ("x",), duration: float = 6.0, **options: float):
    """Starts a swing on `joints`; returns its acceptance, its start and its plan."""
    time, position = swing(duration, **options)
    accepted = drive.accept(joint_trajectory(joints, time, np.column_stack([position] * len(joints))))
    return accepted, to_ns(accepted.start), {joint: position for joint in joints}


def go_home(drive: AxesClient) -> None:
    """Resets the axes to rest at the start position and drops old samples."""

    def at_home() -> bool:
        return not any(value for field in ("position", "psec") for value in drive.latest(field).values())

    # A stream setpoint in transit during the reset moves the axes away again.
    for patience_s in (10, 20, 60):
        drive.reset()
        try:
            # On a busy machine samples from before the reset are still in transit.
            drive.wait_for(at_home, patience_s, "rest at home")
            break
        except TimeoutError:
            if patience_s == 60:
                raise
    drive.wait_until(drive.now() + 2 * TSP_NS, 5)
    drive.drop_samples()
