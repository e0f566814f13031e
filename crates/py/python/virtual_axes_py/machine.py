"""Machines: parameters of axes, drives, controllers, limits and kinematics."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .arguments import Named, named_errors, read_json, to_floats, to_path, to_text, unknown
from .run import Run
from .tables import TIME, axis_columns, axis_values, named_table

if TYPE_CHECKING:
    from .tables import LazyTable, Table

    Columns = Mapping[str, ArrayLike] | Table | LazyTable
    Setpoints = NDArray[np.float64] | Columns | _native.Scenario | _native.PartProgram
    Loads = ArrayLike | Columns
    AxisValues = ArrayLike | Mapping[str, ArrayLike]
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

TOOL_SIGNALS = ("contour_error", "orientation_error", "tool_path", "tool_setpoint", "feed")
"""Names of the signals of the tool: m and rad; path and setpoints of the tip in the workpiece frame, m; feed, m/s."""


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
        if not isinstance(native, _native.Machine):
            raise TypeError(f"native is of type {type(native).__name__}; Machine.load(name_or_path) loads a machine")
        self._native = native

    @staticmethod
    def load(name_or_path: str | os.PathLike[str] | None = None) -> Machine:
        """Loads a built-in machine (`machine_names()`, by default the first) or a machine file.

        Raises `ValueError` with file, line, parameter, value and allowed range.
        """
        if name_or_path is None:
            return Machine(_native.Machine.load())
        return Machine(_native.Machine.load(to_path("name_or_path", name_or_path)))

    @staticmethod
    def from_yaml(text: str, source: str = "text") -> Machine:
        """Creates a machine from the text of a machine file; `source` names it in errors.

        Raises `ValueError` as `load` does.
        """
        return Machine(_native.Machine.from_yaml(to_text("text", text), source))

    def with_(self, changes: Mapping[str, Parameter]) -> Machine:
        """Returns a copy with other parameters, checked together.

        The keys and units are those of the machine file, as `x.position_loop.gain`. Raises `ValueError` for an unknown
        parameter or a value out of range, `TypeError` for a value of another kind.
        """
        if not isinstance(changes, Mapping) and not (hasattr(changes, "keys") and getattr(changes, "ndim", 0) == 1):
            example = '{"x.position_loop.gain": 2.0}'
            raise TypeError(f"changes is of type {type(changes).__name__}; it must be a dictionary, as {example}")
        return Machine(self._native.with_({str(key): changes[key] for key in changes.keys()}))

    def with_controller(self, axis: str, rst: _native.Rst, *, allow_unstable: bool = False) -> Machine:
        """Returns a copy whose axis has a position controller in RST form, as of `design.gpc` or `design.rst`.

        Raises `ValueError` for an unknown axis, and for a loop that is unstable on the prediction model of the axis,
        unless `allow_unstable`.
        """
        if axis not in self.axes:
            raise ValueError(unknown("axis", axis, self.axes))
        if not isinstance(rst, _native.Rst):
            raise TypeError(
                f"rst is of type {type(rst).__name__}; it must be an Rst, as design.rst(r, s, t) returns it"
            )
        values: dict[str, Parameter] = {
            "controller": "rst",
            "allow_unstable": allow_unstable,
            "rst.r": rst.r,
            "rst.s": rst.s,
            "rst.t": rst.t,
            "rst.t_first": rst.t_first,
        }
        return self.with_({f"{axis}.position_loop.{name}": value for name, value in values.items()})

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
        return Named(self._native.parameters)

    def simulate(
        self,
        psec: Setpoints,
        *,
        loads: Loads | None = None,
        signals: Sequence[str] | None = None,
        every_tick: bool = False,
        figures: str = "all",
    ) -> Run:
        """Simulates setpoints until the axes have settled and returns signals and figures.

        `psec` is an array (setpoints, axes) of position setpoints, m or rad, one row per position cycle; or a table
        with equally long columns by axis name, where the other axes stand at 0: a dictionary, or a DataFrame of pandas
        or polars, a table of PyArrow, a structured array, or a dataset of xarray; or a scenario or a part program. A
        table with a column, index or coordinate `time` (s) is interpolated at the position cycles, as
        `virtual_axes run` does with CSV. The machine starts at rest at the first row. After the last row the setpoints
        hold for 1 s, so that the arrays of the run are longer than `psec`.

        `loads` are external forces and torques on the axes, N or N·m, positive towards plus: an array or table with a
        row per position cycle, of which the last one holds, or one value for each axis; axes without one have no load.

        `signals` are those of `SIGNALS` and `TOOL_SIGNALS` to record, by default all, at every position cycle, or with
        `every_tick` at every current cycle. `figures` is `all`, `contour` (all but circles and energy) or `axes`, which
        is the fastest and has no signals of the tool.

        Raises `ValueError` for setpoints of another shape or that the machine rejects, with time, axis and limit;
        `TypeError` for anything but real numbers.
        """
        given = self.setpoints(psec)
        if signals is not None and (isinstance(signals, str) or not isinstance(signals, Iterable)):
            raise TypeError(f"signals is {signals!r}; it must be a list of names")
        chosen = list(SIGNALS + TOOL_SIGNALS if signals is None else signals)
        wrong = [name for name in chosen if name not in SIGNALS + TOOL_SIGNALS]
        if wrong:
            raise ValueError(unknown("signal", wrong[0], SIGNALS + TOOL_SIGNALS))
        of_tool = [name for name in chosen if name in TOOL_SIGNALS]
        if of_tool and signals is not None and figures == "axes":
            raise ValueError(f"signal {of_tool[0]!r} needs contour errors; figures must be 'all' or 'contour'")
        forces = None if loads is None else self._loads(loads)
        options = {
            "signals": [name for name in chosen if name not in TOOL_SIGNALS],
            "tool": bool(of_tool),
            "every_tick": every_tick,
            "figures": figures,
        }
        with named_errors(options):
            table, tool, text, count = self._native.simulate(given, forces, options)
        time = table.pop("time")
        tool = Named((name, values) for name, values in tool.items() if name in of_tool)
        return Run(self, time, Named(table), read_json(text), count, given, tool, forces)

    def _loads(self, loads: Loads) -> NDArray[np.float64]:
        """Returns loads as rows of all axes, N or N·m."""
        is_row = hasattr(loads, "dims") and getattr(loads, "ndim", 0) == 1
        if isinstance(loads, Mapping):
            is_row = not loads or not all(np.ndim(one) == 1 for one in loads.values())
        columns = None if is_row else axis_columns(self, "loads", loads)
        if columns is None:
            rows = np.atleast_2d(axis_values(self.axes, "loads", loads, 0.0))
        elif TIME in columns:
            raise ValueError("loads has a column time; it needs a row per position cycle, without times")
        else:
            none = np.zeros(len(next(iter(columns.values()))))
            rows = np.column_stack([columns.get(axis, none) for axis in self.axes])
        if len(rows) == 0:
            raise ValueError("loads has no rows; it needs one, or one per position cycle")
        return rows

    def setpoints(self, psec: Setpoints) -> NDArray[np.float64] | _native.Scenario | _native.PartProgram:
        """Returns setpoints as an array (setpoints, axes), m or rad; scenarios and part programs as they are.

        Raises `ValueError` for an unknown axis, another shape or a value that is not finite; `TypeError` for anything
        but real numbers.
        """
        return self.named_setpoints("psec", psec)

    def named_setpoints(
        self, name: str, psec: Setpoints
    ) -> NDArray[np.float64] | _native.Scenario | _native.PartProgram:
        """Returns `setpoints` of an argument `name`, for other modules of this package."""
        if isinstance(psec, _native.Scenario | _native.PartProgram):
            return psec
        if isinstance(psec, str | os.PathLike):
            raise TypeError(
                f"{name} is {psec!r}; a scenario is scenario(name), a part program nc_program(name_or_path)"
            )
        columns = axis_columns(self, name, named_table(psec))
        if columns is None:
            return self._checked(to_floats(name, psec))
        if TIME in columns:
            names = [TIME, *(axis for axis in self.axes if axis in columns)]
            _check_times([columns[name] for name in names], names)
            return self._native.setpoints_over_time(names, [np.ascontiguousarray(columns[name]) for name in names])
        still = np.zeros(len(next(iter(columns.values()))))
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


def _check_times(columns: Sequence[NDArray[np.float64]], names: Sequence[str]) -> None:
    """Raises `ValueError` unless all values are finite and the times, the first column, rise from 0 or later."""
    for name, values in zip(names, columns):
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise ValueError(
                f"psec: row {row} of {name} is {str(values[row]).replace('nan', 'NaN')}, not a finite number"
            )
    time = columns[0]
    steps = np.diff(time)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0))
        raise ValueError(
            f"psec: row {row + 1} has the time {time[row + 1]:.6g} s, after {time[row]:.6g} s; times must rise"
        )
    if len(time) and time[0] < 0:
        raise ValueError(f"psec: the times begin at {time[0]:.6g} s; they must begin at 0 s or later")
