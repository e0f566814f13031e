"""Identification of the parameters of an axis from recordings."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .arguments import Named, named_errors, read_json, to_native, to_path, to_real, to_text
from .machine import Machine
from .run import embedded_page
from .tables import columns_of, numbers

if TYPE_CHECKING:
    from .tables import Table

    Recording = str | os.PathLike[str] | Mapping[str, ArrayLike] | Table
    Feedforward = Literal["off", "velocity", "both"]
    Source = str | dict[str, NDArray[np.float64]] | tuple[list[str], list[NDArray[np.float64]]]


CHANNELS = (
    "time",
    "psec",
    "position",
    "velocity",
    "current",
    "torque",
    "velocity_feedforward",
    "torque_feedforward",
    "motor_position",
)
"""Names of the channels of a recording, in SI."""


class Identification:
    """Identified parameters of an axis, with findings and the agreement with the recordings."""

    def __init__(self, native: _native.Identification) -> None:
        """Wraps a native result; use `identify`."""
        self._native = native

    @cached_property
    def summary(self) -> dict[str, Any]:
        """All results with the keys and units of `virtual_axes identify --json`."""
        found: dict[str, Any] = read_json(self._native.json())
        return found

    @property
    def parameters(self) -> dict[str, float]:
        """Identified parameters by key, in the units of the machine file."""
        return Named((value["key"], value["value"]) for value in self.summary["values"])

    @property
    def deviations(self) -> dict[str, float | None]:
        """Standard errors of the parameters by key, in their units; None where there is none, as for delays."""
        return Named((value["key"], value["standard_error"]) for value in self.summary["values"])

    @property
    def findings(self) -> list[str]:
        """Findings with their remedies, the most severe first: `invalid: …`, `missing: …`, `warning: …`, `note: …`."""
        return self._native.findings()

    @property
    def is_valid(self) -> bool:
        """True unless a finding says that the result must not be used."""
        return all(finding["severity"] != "invalid" for finding in self.summary["findings"])

    @property
    def machine(self) -> Machine:
        """Machine with the identified parameters; `ValueError` with the findings if the result is invalid."""
        if not self.is_valid:
            invalid = [line for line in self.findings if line.startswith("invalid: ")]
            raise ValueError("invalid result, there is no identified machine:\n" + "\n".join(invalid))
        return Machine(self._native.machine())

    def report(self) -> str:
        """Returns the page of `virtual_axes identify --report` as HTML."""
        return self._native.report()

    def _repr_html_(self) -> str:
        """Returns the report for a notebook."""
        return embedded_page(self.report())

    def __repr__(self) -> str:
        """Returns axis, number of parameters and of findings."""
        axis, values = self.summary["axis"], self.summary["values"]
        return f"Identification({axis!r}, {len(values)} parameters, {len(self.findings)} findings)"


def identify(
    recordings: Recording | Sequence[Recording],
    axis: str,
    machine: Machine | None = None,
    *,
    transmission: Recording | Sequence[Recording] = (),
    validate: Recording | Sequence[Recording] = (),
    feedforward: Feedforward | Sequence[Feedforward] = (),
    validate_feedforward: Feedforward | Sequence[Feedforward] = (),
    refine: str | Sequence[str] | None = None,
    free_i0: bool = False,
    presliding: bool = False,
    column: str | Sequence[str] = (),
    columns: str | os.PathLike[str] | None = None,
    topic: str | Sequence[str] = (),
    joint: str | None = None,
    format: str | None = None,
    rate_hz: float | None = None,
    cutoff_hz: float | None = None,
    current_lag_ms: float | None = None,
    trace_filter_hz: float | None = None,
    psec_shift: float | Literal["auto"] | None = None,
) -> Identification:
    """Identifies friction, gravity, inertia, feedforward, delays and gain of an axis, as `virtual_axes identify` does.

    `recordings` are files (CSV, MCAP, exports of controls) or dictionaries of equally long channels: `time` (s),
    `position` and `psec` (m or rad), `velocity` (m/s or rad/s of the axis), `current` (A), `torque` (N·m),
    `velocity_feedforward` (rad/s of the motor), `torque_feedforward` (N·m) and `motor_position` (m or rad at the axis);
    or tables, as a DataFrame of pandas or polars, whose columns are either these channels or are read as those of CSV:
    names and units as `x.position`, `ENC_POS|1 [mm]`, or those of `column`. A named index is a column. `machine`
    (default: the first built-in one) has the initial values.

    The options are those of the command: `transmission` are recordings with the encoders of motor and load, to identify
    stiffness, damping, inertia of the load and backlash, beside `recordings` or alone with `[]`; `validate` are
    recordings to compare with the result; `feedforward` is the active one, `off`, `velocity` or `both`, for all or for
    each recording; `refine` are the groups that the refinement in closed loop adjusts (`inertia`, `friction`,
    `gravity`, `feedforward`, `gain`; by default all, `()` for none); `free_i0` refines the breakaway current by itself;
    `presliding` identifies stiffness and damping of the presliding from slow reversals, with the lag `current_lag_ms`
    of the current, 0 by default; `column`, `columns`, `topic`, `joint`, `format` and `rate_hz` read the files;
    `cutoff_hz`, `current_lag_ms`, `trace_filter_hz` and `psec_shift` (ms, or `auto`) condition the signals.

    Raises `ValueError` with the command's text for an unreadable or implausible recording, or if no parameter can be
    identified. Releases the global interpreter lock.
    """
    options = {
        "column": [column] if isinstance(column, str) else list(column),
        "columns": columns,
        "topic": [topic] if isinstance(topic, str) else list(topic),
        "joint": joint,
        "format": format,
        "rate_hz": None if rate_hz is None else _rate(rate_hz),
        "cutoff_hz": cutoff_hz,
        "current_lag_ms": current_lag_ms,
        "trace_filter_hz": trace_filter_hz,
        "psec_shift": psec_shift,
        "feedforward": [feedforward] if isinstance(feedforward, str) else list(feedforward),
        "validate_feedforward": (
            [validate_feedforward] if isinstance(validate_feedforward, str) else list(validate_feedforward)
        ),
        "refine": None if refine is None else [refine] if isinstance(refine, str) else list(refine),
        "free_i0": free_i0,
        "presliding": presliding,
    }
    native = to_native(machine if machine is not None else Machine.load())
    files, both, others = _sources(recordings), _sources(transmission), _sources(validate)
    try:
        with named_errors(options):
            return Identification(_native.identify(native, to_text("axis", axis), files, both, others, options))
    except ValueError as error:
        # The options of the command have the names of the arguments, with dashes.
        text = str(error)
        for name in options:
            text = text.replace(f"--{name.replace('_', '-')}", name)
        raise ValueError(text) from None


def _rate(given: float) -> float:
    """Returns a sampling rate; raises `ValueError` unless it is above 0 Hz."""
    rate_hz = to_real("rate_hz", given)
    if not rate_hz > 0:
        raise ValueError(f"rate_hz {rate_hz}: must be above 0 Hz")
    return rate_hz


def _sources(given: Recording | Sequence[Recording]) -> list[Source]:
    """Returns recordings as the native module takes them."""
    several = given if isinstance(given, list | tuple) else [given]
    return [_source(one) for one in several]


def _source(given: Any) -> Source:
    """Returns a recording as the native module takes it: a path, channels, or names and values of columns."""
    if isinstance(given, Mapping) and not hasattr(given, "data_vars"):
        return {to_text("channel", name): _channel(name, values) for name, values in given.items()}
    columns = None if isinstance(given, str | os.PathLike) else columns_of("recording", given, skip_texts=True)
    if columns is None and not isinstance(given, str | bytes | os.PathLike):
        text = "it must be a path, a dictionary of channels, or a table, as Run.to_pandas() returns it"
        raise TypeError(f"recording is of type {type(given).__name__}; {text}")
    if columns is None:
        return to_path("recording", given)
    if all(name in CHANNELS for name in columns):
        return columns
    return list(columns), [np.ascontiguousarray(values) for values in columns.values()]


def _channel(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Returns the values of a channel; raises `ValueError` unless they have one dimension."""
    channel = numbers(f"channel {name}", values)
    if channel.ndim != 1:
        raise ValueError(f"channel {name} has the shape {channel.shape}; it needs one dimension")
    return channel
