"""Machines: parameters of axes, drives, controllers, limits and kinematics."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .arguments import to_floats
from .run import Run

if TYPE_CHECKING:
    Setpoints = NDArray[np.float64] | Mapping[str, ArrayLike] | _native.Scenario | _native.PartProgram
    Parameter = bool | int | float | str | Sequence[bool] | Sequence[int] | Sequence[float] | Sequence[str]

SIGNALS = (
    "psec",
    "delayed_psec",
    "position",
    "velocity",
    "current",
    "current_setpoint",
    "voltage",
    "velocity_setpoint",
    "velocity_feedforward",
    "torque_feedforward",
    "friction_current",
    "gravity_current",
    "load_current",
    "effort",
    "wind_up",
)
"""Names of the signals of an axis: m or rad at the axis, rad/s and N·m at the motor, A, V; effort in N or N·m."""


class Machine:
    """Machine with checked parameters; immutable.

    >>> machine = Machine.load()
    >>> stiffer = machine.with_({"x.position_loop.gain": 2.0})
    >>> stiffer.parameters["x.position_loop.gain"]
    2.0
    """

    __slots__ = ("_native",)

    def __init__(self, native: _native.Machine) -> None:
        """Wraps a native machine; use `load` or `from_yaml`."""
        self._native = native

    @staticmethod
    def load(name_or_path: str | None = None) -> Machine:
        """Loads a built-in machine (`machine_names()`, by default the first) or a machine file.

        Raises `ValueError` with file, line, parameter, value and allowed range.
        """
        return Machine(_native.Machine.load() if name_or_path is None else _native.Machine.load(name_or_path))

    @staticmethod
    def from_yaml(text: str, source: str = "text") -> Machine:
        """Creates a machine from the text of a machine file; `source` names it in errors.

        Raises `ValueError` as `load` does.
        """
        return Machine(_native.Machine.from_yaml(text, source))

    def with_(self, changes: Mapping[str, Parameter]) -> Machine:
        """Returns a copy with other parameters, checked together.

        The keys and units are those of the machine file, as `x.position_loop.gain`. Raises `ValueError` for an unknown
        parameter or a value out of range, `TypeError` for a value of another kind.
        """
        return Machine(self._native.with_(dict(changes)))

    def to_yaml(self) -> str:
        """Returns the text of a machine file with these parameters."""
        return self._native.to_yaml()

    @property
    def native(self) -> _native.Machine:
        """Native object, for other modules of this package."""
        return self._native

    @property
    def name(self) -> str:
        """Name of the machine."""
        return self._native.name

    @property
    def axes(self) -> list[str]:
        """Names of the axes, in the order of the columns of all arrays."""
        return self._native.axes

    @property
    def units(self) -> list[str]:
        """Unit of each axis: `m` or `rad`."""
        return self._native.units

    @property
    def position_period(self) -> float:
        """Position cycle Tsp, s: the time between two setpoints."""
        return self._native.position_period

    @property
    def current_period(self) -> float:
        """Current cycle Tsi, s: the time between two ticks."""
        return self._native.current_period

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters with their values or defaults, in the units of the machine file."""
        return self._native.parameters

    def simulate(
        self,
        psec: Setpoints,
        *,
        signals: Sequence[str] = SIGNALS,
        every_tick: bool = False,
        figures: str = "all",
    ) -> Run:
        """Simulates setpoints until the axes have settled and returns signals and figures.

        `psec` is an array (setpoints, axes) of position setpoints, m or rad, one row per position cycle; or a
        dictionary of equally long columns by axis name, where the other axes stand at 0; or a scenario or a part
        program. The machine starts at rest at the first row. After the last row the setpoints hold for 1 s, so that
        the arrays of the run are longer than `psec`.

        `signals` are those of `SIGNALS` to record, at every position cycle, or with `every_tick` at every current
        cycle. `figures` is `all`, `contour` (all but circles) or `axes`, which is the fastest.

        Raises `ValueError` for setpoints of another shape or that the machine rejects, with time, axis and limit;
        `TypeError` for anything but real numbers.
        """
        given = self.setpoints(psec)
        if isinstance(signals, str):
            raise TypeError(f"signals is {signals!r}; it must be a list of names")
        table, text, count = self._native.simulate(given, list(signals), every_tick, figures)
        return Run(self, table.pop("time"), table, json.loads(text), count, given)

    def setpoints(self, psec: Setpoints) -> NDArray[np.float64] | _native.Scenario | _native.PartProgram:
        """Returns setpoints as an array (setpoints, axes), m or rad; scenarios and part programs as they are.

        Raises `ValueError` for an unknown axis, another shape or a value that is not finite; `TypeError` for anything
        but real numbers.
        """
        if isinstance(psec, _native.Scenario | _native.PartProgram):
            return psec
        if not isinstance(psec, Mapping):
            if isinstance(psec, str):
                raise TypeError(
                    f"psec is {psec!r}; a scenario is scenario(name), a part program nc_program(name_or_path)"
                )
            return self._checked(to_floats("psec", psec))
        unknown = [name for name in psec if name not in self.axes]
        if unknown:
            raise ValueError(f"axis {unknown[0]!r} is unknown; known are {', '.join(self.axes)}")
        columns = {name: to_floats(f"psec of {name}", values) for name, values in psec.items()}
        shapes = {column.shape for column in columns.values()}
        if not columns:
            raise ValueError(f"psec has no columns; it needs one or more of {', '.join(self.axes)}")
        if len(shapes) != 1 or len(next(iter(shapes))) != 1:
            found = ", ".join(f"{name} {column.shape}" for name, column in columns.items())
            raise ValueError(f"the columns of psec have the shapes {found}; they need one common length")
        still = np.zeros(next(iter(shapes)))
        return self._checked(np.column_stack([columns.get(name, still) for name in self.axes]))

    def _checked(self, psec: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns setpoints of a fitting shape with finite values."""
        axes = self.axes
        if psec.ndim != 2:
            raise ValueError(f"psec has the shape {psec.shape}; it needs (setpoints, {len(axes)})")
        if psec.shape[1] != len(axes):
            raise ValueError(f"psec has {psec.shape[1]} columns; it needs one per axis: {', '.join(axes)}")
        if len(psec) == 0:
            raise ValueError("psec has no setpoints; it needs at least one row")
        if not np.isfinite(psec).all():
            row, column = np.argwhere(~np.isfinite(psec))[0]
            value = str(psec[row, column]).replace("nan", "NaN")
            time = row * self.position_period
            raise ValueError(f"at {time:.6g} s: {axes[column]}: position is {value}, not a finite number")
        return psec

    def __eq__(self, other: object) -> bool:
        """Returns true for a machine with equal parameters."""
        return isinstance(other, Machine) and self._native == other._native

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Returns name and axes."""
        return repr(self._native)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles the machine as the text of its file."""
        return Machine.from_yaml, (self.to_yaml(),)
