"""Stepwise simulation: the caller supplies the setpoints of each position cycle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .arguments import to_floats, to_native, to_whole
from .machine import Machine
from .tables import axis_values

if TYPE_CHECKING:
    from .machine import AxisValues


class Stepper:
    """Simulation of one machine, or of several equal ones at once, stepped by position cycles.

    Arrays have the shape (axes,) for one machine and (machines, axes) for several; a dictionary or Series by axis name
    may be in their place. Several machines are lanes of vector instructions and cost far less than as many steppers.

    >>> stepper = Stepper(Machine.load())
    >>> for _ in range(200):
    ...     position = stepper.step(np.array([0.001, 0, 0, 0, 0]))
    >>> abs(position[0] - 0.001) < 1e-6
    np.True_
    """

    __slots__ = ("_axes", "_native")

    def __init__(self, machine: Machine | Sequence[Machine], machines: int | None = None) -> None:
        """Creates machines at rest at home, 0 on every axis: equal ones, 1 by default, or those of a sequence.

        Raises `ValueError` unless there are 1 to 100,000, and for machines with other axes or periods.
        """
        several = [machine] if isinstance(machine, Machine) or not isinstance(machine, Sequence) else list(machine)
        if machines is not None and len(several) != 1:
            raise ValueError(f"machines {machines}: a sequence of machines has its own number, {len(several)}")
        count = 1 if machines is None else to_whole("machines", machines, 1, 100_000)
        natives = [to_native(one) for one in several]
        self._native = _native.Stepper(natives * count if len(natives) == 1 else natives)
        self._axes = natives[0].axes

    def __getstate__(self) -> tuple[_native.Stepper, list[str]]:
        """Pickles machines and state: the copy goes on with the same bits."""
        return self._native, self._axes

    def __setstate__(self, state: tuple[_native.Stepper, list[str]]) -> None:
        """Restores machines and state."""
        self._native, self._axes = state

    def __repr__(self) -> str:
        """Returns axes, number of machines and time."""
        return f"Stepper(axes {', '.join(self._axes)}; {self.machines} machines; {self.time:.6g} s)"

    def step(self, psec: AxisValues, preview: ArrayLike | None = None) -> NDArray[np.float64]:
        """Advances by one position cycle and returns the positions at its end, m or rad.

        `psec` are the setpoints of the cycle, m or rad. `preview` are the following setpoints, (axes, cycles) or of
        several machines (machines, axes, cycles), which predictive controllers read; beyond it they see the last one.
        Raises `ValueError` for another shape or a value beyond ±10⁶.
        """
        ahead = None if preview is None else to_floats("preview", preview)
        return self._native.step(axis_values(self._axes, "psec", psec), ahead)

    def reset(self, position: AxisValues | None = None, *, only: Sequence[int] | None = None) -> None:
        """Puts the axes at rest at `position`, m or rad (default 0), at time 0.

        `only` are the indices of the machines to reset, at their rows of `position`; the time goes on then. Raises
        `ValueError` for an array of another shape or an index out of range.
        """
        given = None if position is None else axis_values(self._axes, "position", position, 0.0)
        last = self.machines - 1
        self._native.reset(given, None if only is None else [to_whole("machine", one, 0, last) for one in only])

    def set_load(self, load: AxisValues) -> None:
        """Sets the external loads from the next cycle on, N or N·m, positive towards plus; 0 for axes without one."""
        self._native.set_load(axis_values(self._axes, "load", load, 0.0))

    def set_velocity_offset(self, offset: AxisValues) -> None:
        """Sets offsets that are added to the outputs Ω* of the position controllers from the next cycle on.

        They are in rad/s of the motor (m/s of a linear motor) and 0 after a reset. The controllers see the sum, within
        the speed limit, as their last output.
        """
        self._native.set_velocity_offset(axis_values(self._axes, "offset", offset, 0.0))

    def set_machine(self, machine: Machine, *, only: Sequence[int] | None = None) -> None:
        """Changes gains, weights, delays or plant parameters and keeps the state (bumpless transfer).

        `only` are the indices of the machines to change, by default all. Raises `ValueError` for a machine with other
        periods or other axes, or an index out of range.
        """
        last = self.machines - 1
        chosen = range(self.machines) if only is None else [to_whole("machine", one, 0, last) for one in only]
        self._set_machines([machine] * len(chosen), chosen)

    def _set_machines(self, machines: Sequence[Machine], only: Sequence[int]) -> None:
        """Gives each of the machines `only` other parameters."""
        self._native.set_machines([to_native(one) for one in machines], list(only))

    def save(self) -> _native.StepperState:
        """Returns a copy of the state for `restore`; it can be pickled."""
        return self._native.save()

    def restore(self, state: _native.StepperState) -> None:
        """Returns to a saved state and its parameters.

        The stepper then is the machine of the state. Raises `ValueError` if that has another number of machines or
        axes, or other periods.
        """
        self._native.restore(state)

    @property
    def position(self) -> NDArray[np.float64]:
        """Positions at the end of the last cycle, m or rad."""
        return self._native.position

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Velocities at the end of the last cycle, m/s or rad/s."""
        return self._native.velocity

    @property
    def current(self) -> NDArray[np.float64]:
        """Motor currents at the end of the last cycle, A."""
        return self._native.current

    @property
    def peak_current(self) -> NDArray[np.float64]:
        """Largest current amounts at the ticks of the last cycle, A."""
        return self._native.peak_current

    @property
    def following_error(self) -> NDArray[np.float64]:
        """Following errors at the start of the last cycle, m or rad."""
        return self._native.following_error

    @property
    def velocity_setpoint(self) -> NDArray[np.float64]:
        """Velocity setpoints Ω* of the last cycle, rad/s of the motor."""
        return self._native.velocity_setpoint

    @property
    def tick_positions(self) -> NDArray[np.float64]:
        """Positions at the ticks of the last cycle, (axes of all machines, ticks), m or rad."""
        return self._native.tick_positions()

    @property
    def time(self) -> float:
        """Simulated time since the start or the last reset, s."""
        return self._native.time

    @property
    def machines(self) -> int:
        """Number of machines."""
        return self._native.machines

    @property
    def preview_length(self) -> int:
        """Number of following setpoints that the controllers read."""
        return self._native.preview_length
