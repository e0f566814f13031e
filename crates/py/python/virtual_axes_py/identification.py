"""Identification of the parameters of an axis from recordings."""

from __future__ import annotations

import os
import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .arguments import Named, in_python, named_errors, read_json, to_native, to_path, to_real, to_text, unknown
from .machine import Machine
from .run import embedded_page
from .tables import columns_of, numbers

if TYPE_CHECKING:
    from .machine import Columns

    Recording = str | os.PathLike[str] | Columns
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
UNREAD = " is not read; the nearest channel is "
"""Part of a finding about a column that may be misspelled."""


@dataclass(frozen=True)
class _Stored:
    """Identification without its recordings, as a pickle contains it."""

    text: str
    lines: list[str]
    result: _native.Machine | None

    def json(self) -> str:
        """Returns the summary as JSON."""
        return self.text

    def findings(self) -> list[str]:
        """Returns the findings."""
        return self.lines

    def machine(self) -> _native.Machine:
        """Returns the machine with the identified values; that of a valid result."""
        assert self.result is not None
        return self.result

    def report(self) -> str:
        """Raises `ValueError`: the page needs the recordings."""
        raise ValueError("a copy from a pickle has no recordings to plot; call report() on the original")


def _restored(text: str, lines: list[str], machine: Machine | None) -> Identification:
    """Returns an identification from a pickle."""
    stored: Any = _Stored(text, lines, machine.native if machine else None)
    return Identification(stored)


class Identification:
    """Identified parameters of an axis, with findings and the agreement with the recordings; immutable.

    A pickle contains all but the recordings, so that its copy has no report.
    """

    def __init__(self, native: _native.Identification) -> None:
        """Wraps a native result; use `identify`."""
        self._native: Any = native

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
        return [in_python(line) for line in self._native.findings()]

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
        """Returns the page of `virtual_axes identify --report` as HTML; `ValueError` for a copy from a pickle."""
        page: str = self._native.report()
        return page

    def _repr_html_(self) -> str | None:
        """Returns the report for a notebook; None for a copy from a pickle, which shows its `repr`."""
        return None if isinstance(self._native, _Stored) else embedded_page(self.report())

    def __copy__(self) -> Identification:
        """Returns the same object, which is immutable."""
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Identification:
        """Returns the same object, which is immutable."""
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles summary, findings and machine."""
        return _restored, (self._native.json(), self.findings, self.machine if self.is_valid else None)

    def __repr__(self) -> str:
        """Returns axis, number of parameters and of findings."""
        axis, values = self.summary["axis"], self.summary["values"]
        return f"Identification({axis!r}, {len(values)} parameters, {len(self.findings)} findings)"


def identify(
    recordings: Recording | Iterable[Recording],
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
    names and units as `x.position`, `ENC_POS|1 [mm]`, or those of `column`. A named index is a column; a column whose
    name is nearly that of a missing channel gives a `UserWarning`. Several are a sequence or an iterator, as
    `Path.glob` returns it. `machine` (default: the first built-in one) has the initial values. Without times, `rate_hz`
    is the sampling rate.

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
    files, both, others = (_sources(given, options) for given in (recordings, transmission, validate))
    try:
        with named_errors(options):
            found = Identification(_native.identify(native, to_text("axis", axis), files, both, others, options))
            for line in found.findings:
                if UNREAD in line:
                    warnings.warn(line.removeprefix("warning: "), stacklevel=2)
            return found
    except ValueError as error:
        raise ValueError(in_python(str(error))) from None


def _rate(given: float) -> float:
    """Returns a sampling rate; raises `ValueError` unless it is above 0 Hz."""
    rate_hz = to_real("rate_hz", given)
    if not rate_hz > 0:
        raise ValueError(f"rate_hz {rate_hz}: must be above 0 Hz")
    return rate_hz


def _sources(given: Recording | Iterable[Recording], options: Mapping[str, Any]) -> list[Source]:
    """Returns recordings as the native module takes them."""
    several = given if isinstance(given, list | tuple | Iterator) and not hasattr(given, "read") else [given]
    return [_source(one, options) for one in several]


def _source(given: Any, options: Mapping[str, Any]) -> Source:
    """Returns a recording as the native module takes it: a path, channels, or names and values of columns."""
    if isinstance(given, Mapping) and not hasattr(given, "data_vars"):
        wrong = [name for name in given if to_text("channel", name) not in CHANNELS]
        if wrong:
            raise ValueError(unknown("channel", wrong[0], CHANNELS))
        return _timed({name: _channel(name, values) for name, values in given.items()}, options)
    columns = None if isinstance(given, str | os.PathLike) else columns_of("recording", given, skip_texts=True)
    if hasattr(given, "columns") and not len(given.columns):
        raise ValueError("recording has no columns; it needs position and current, or those of `column`")
    if columns is None and not isinstance(given, str | bytes | os.PathLike):
        text = "it must be a path, a dictionary of channels, or a table, as Run.to_pandas() returns it"
        raise TypeError(f"recording is of type {type(given).__name__}; {text}")
    if columns is None:
        return to_path("recording", given)
    _check_names(columns, options["column"])
    if all(name in CHANNELS for name in columns):
        return _timed(columns, options)
    return list(columns), [np.ascontiguousarray(values) for values in columns.values()]


def _check_names(columns: Iterable[str], selected: Sequence[str]) -> None:
    """Raises `ValueError` for two columns with the name of one channel, whatever their case and unit."""
    same = defaultdict(list)
    for number, title in enumerate(columns, 1):
        same[title.partition("[")[0].strip().lower()].append((title, number))
    for channel, titles in same.items():
        if len(titles) > 1 and channel in CHANNELS and not any(one.startswith(f"{channel}=") for one in selected):
            listed = " and ".join(repr(title) for title, _ in titles)
            remedy = f"select one by its number: column='{channel}=#{titles[0][1]}'"
            raise ValueError(f"recording has the columns {listed} for {channel}; {remedy}")


def _timed(channels: dict[str, NDArray[np.float64]], options: Mapping[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Returns channels with times; those without have the sampling rate of the options."""
    rate_hz = options["rate_hz"]
    if "time" in channels or not channels:
        return channels
    if rate_hz is None:
        raise ValueError("recording has no channel time (s); add it, or give rate_hz")
    return {"time": np.arange(max(map(len, channels.values()))) / rate_hz, **channels}


def _channel(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Returns the values of a channel; raises `ValueError` unless they have one dimension."""
    channel = numbers(f"channel {name}", values)
    if channel.ndim != 1:
        raise ValueError(f"channel {name} has the shape {channel.shape}; it needs one dimension")
    return channel
