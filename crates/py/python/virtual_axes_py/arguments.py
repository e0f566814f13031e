"""Conversion and checks of arguments; each error names the argument, its value and what is allowed."""

from __future__ import annotations

import difflib
import json
import operator
import os
import re
import reprlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from decimal import Decimal
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from . import _native


Value = TypeVar("Value")
MOST_LISTED = 20
"""Number of known names up to which an error lists them."""
OPTION = re.compile(r"`[^`]*`|--column (?=\S*=)|--([a-z][a-z0-9-]*)")
"""Option in a message of the command, or a command in backticks."""


class Named(dict[str, Value]):
    """Dictionary whose `KeyError` has the nearest key."""

    def __missing__(self, key: str) -> Value:
        """Raises `KeyError`."""
        raise KeyError(unknown("key", key, self))


def read_json(text: str) -> Any:
    """Returns the values of a JSON text."""
    return json.loads(text, object_hook=Named)


def unknown(kind: str, name: object, known: Iterable[str]) -> str:
    """Returns the text of an error for an unknown name, with the nearest one and, if they are few, all."""
    names = list(known)
    folded = {one.lower(): one for one in names}
    near = difflib.get_close_matches(str(name).strip().lower(), folded, 1)
    hints = [f"the nearest is {folded[one]}" for one in near]
    if len(names) <= MOST_LISTED:
        hints.append(f"known are {', '.join(names) or 'none'}")
    return "; ".join([f"{kind} {name!r} is unknown", *hints])


@contextmanager
def named_errors(options: Mapping[str, Any]) -> Iterator[None]:
    """Names the option and its value in a `TypeError` of the native module."""
    try:
        yield
    except TypeError as error:
        name = str(error).rpartition(".")[2]
        if name not in options:
            raise
        raise TypeError(f"{name} is {reprlib.repr(options[name])}: {error.__cause__}") from None


def in_python(text: str) -> str:
    """Returns a message of the command with arguments in place of options, but in commands in backticks."""

    def argument(found: re.Match[str]) -> str:
        if found[1] is None:
            return found[0].replace("--column ", "column=")
        return "Machine.with_" if found[1] == "set" else found[1].replace("-", "_")

    return OPTION.sub(argument, text)


def to_array(name: str, values: Any) -> NDArray[Any]:
    """Returns an array, without a copy if it is one; raises `ValueError` for rows of different lengths."""
    if isinstance(values, np.ndarray):
        return values
    if isinstance(values, str | bytes):
        raise TypeError(f"{name} is {values!r}; it must have numbers")
    if isinstance(values, Iterator):
        values = list(values)
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name} has rows of different lengths") from error
    if array.dtype.kind == "O" and not array.ndim:
        raise TypeError(f"{name} is of type {type(values).__name__}; it must have real numbers")
    return array


def to_floats(name: str, values: Any) -> NDArray[np.float64]:
    """Returns an array of floats, without a copy if it is one; None and masked values are NaN.

    Raises `TypeError` for anything but real numbers, `ValueError` for rows of different lengths.
    """
    array = to_array(name, values)
    if isinstance(array, np.ma.MaskedArray):
        return np.asarray(np.ma.filled(array.astype(np.float64), np.nan), dtype=np.float64)
    if array.dtype == np.float64:
        return array
    if array.dtype.kind == "O":
        wrong = [one for one in array.flat if one is not None and not isinstance(one, Real | Decimal)]
        if wrong:
            found = f"{reprlib.repr(wrong[0])} of type {type(wrong[0]).__name__}"
            raise TypeError(f"{name} has the element {found}; it must have real numbers")
    elif array.dtype.kind not in "buif":
        raise TypeError(f"{name} has elements of type {array.dtype}; it must have real numbers")
    return array.astype(np.float64)


def to_list(name: str, values: Any) -> list[float]:
    """Returns numbers in one row; raises `TypeError` for anything but real numbers, `ValueError` for another shape."""
    array = to_floats(name, values)
    if array.ndim != 1:
        raise ValueError(f"{name} has the shape {array.shape}; it needs one dimension, as [1.0, 0.5]")
    return [float(value) for value in array]


def to_real(name: str, value: Any) -> float:
    """Returns a number; raises `TypeError` for anything else."""
    try:
        if not isinstance(value, str | bytes | bool | np.bool_):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise TypeError(f"{name} is {value!r}; it must be a real number")


def to_path(name: str, value: Any) -> str:
    """Returns a name or path as a text; raises `TypeError` for anything else."""
    try:
        return os.fsdecode(value)
    except TypeError:
        raise TypeError(f"{name} is of type {type(value).__name__}; it must be a name or a path") from None


def to_text(name: str, value: Any) -> str:
    """Returns a text; raises `TypeError` for anything else."""
    if not isinstance(value, str):
        raise TypeError(f"{name} is {reprlib.repr(value)}; it must be a text")
    return value


def to_whole(name: str, value: Any, least: int, most: int) -> int:
    """Returns an integer; raises `TypeError` for another type, `ValueError` unless it is from `least` to `most`."""
    try:
        if isinstance(value, bool):
            raise TypeError
        whole = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} {value!r}: must be an integer") from None
    if not least <= whole <= most:
        raise ValueError(f"{name} {whole}: must be from {least} to {most}")
    return whole


def to_native(machine: Any) -> _native.Machine:
    """Returns the native object of a machine; raises `TypeError` for anything else."""
    from .machine import Machine

    if not isinstance(machine, Machine):
        raise TypeError(f"machine is of type {type(machine).__name__}; it must be a Machine")
    return machine.native
