"""Conversion and checks of arguments; each error names the argument, its value and what is allowed."""

from __future__ import annotations

import operator
import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from . import _native


def to_floats(name: str, values: Any) -> NDArray[np.float64]:
    """Returns an array of floats, without a copy if it is one.

    Raises `TypeError` for anything but real numbers, `ValueError` for rows of different lengths.
    """
    if isinstance(values, np.ndarray) and values.dtype == np.float64:
        return values
    if isinstance(values, str | bytes):
        raise TypeError(f"{name} is {values!r}; it must have numbers")
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name} has rows of different lengths") from error
    if array.dtype.kind not in "buif":
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
        if not isinstance(value, str | bytes):
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


def to_whole(name: str, value: Any, least: int, most: int) -> int:
    """Returns an integer; raises `TypeError` for another type, `ValueError` unless it is from `least` to `most`."""
    try:
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
