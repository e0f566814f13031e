"""Command line options of the tools: invalid values are rejected before any work."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

LARGEST_DOMAIN_ID = 232
"""Maximum domain id; above it, RTPS ports exceed 65535."""
DIGITS = 18
"""Maximum number of digits of a whole number."""


def parser(doc: str | None) -> argparse.ArgumentParser:
    """Returns a parser with the description `doc`."""
    return argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)


def positive(text: str) -> float:
    """Returns a finite number above 0."""
    return _number(text, "not a finite number above 0", lambda value: value > 0)


def from_zero(text: str) -> float:
    """Returns a finite number that is not negative."""
    return _number(text, "not a finite number from 0 on", lambda value: value >= 0)


def whole(text: str) -> int:
    """Returns a whole number from 1 on."""
    return _whole(text, 1)


def whole_from_zero(text: str) -> int:
    """Returns a whole number from 0 on."""
    return _whole(text, 0)


def domain_id(text: str) -> int:
    """Returns a ROS_DOMAIN_ID."""
    return _whole(text, 0, LARGEST_DOMAIN_ID)


def _whole(text: str, least: int, most: int | None = None) -> int:
    # int() is slow for very long numbers.
    value = int(text) if text.isascii() and text.isdecimal() and len(text) <= DIGITS else -1
    if value < least or (most is not None and value > most):
        limit = "on" if most is None else f"to {most}"
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {least} {limit}")
    return value


def _number(text: str, wrong: str, is_valid: Callable[[float], bool]) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and is_valid(value)):
        raise argparse.ArgumentTypeError(f"{text!r} is {wrong}")
    return value
