"""Numbers on the command lines of tools: what makes no sense is refused before anything is done."""

from __future__ import annotations

import argparse
import math


def parser(doc: str | None) -> argparse.ArgumentParser:
    """For a tool that says of itself what `doc` says."""
    return argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)


def positive(text: str) -> float:
    """A finite number above 0."""
    return _number(text, "no finite number above 0", lambda value: value > 0)


def from_zero(text: str) -> float:
    """A finite number from 0 on."""
    return _number(text, "no finite number from 0 on", lambda value: value >= 0)


def whole(text: str) -> int:
    """A whole number from 1 on."""
    if not (text.isascii() and text.isdecimal()) or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from 1 on")
    return int(text)


def whole_from_zero(text: str) -> int:
    """A whole number from 0 on."""
    return 0 if text == "0" else whole(text)


def _number(text: str, wrong: str, right) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and right(value)):
        raise argparse.ArgumentTypeError(f"{text!r} is {wrong}")
    return value
