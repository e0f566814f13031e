"""Comparison of output with that of a page: numbers within one unit of the last digit, all else literal."""

from __future__ import annotations

import re
from decimal import Decimal

ELLIPSIS = "..."
NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w]|\.\d)")
"""Number that stands alone: not part of a name, a version or a file name."""


def difference(expected: list[str], actual: list[str], *, is_prefix: bool = False) -> str:
    """Returns the first difference as text, or an empty text.

    `...` alone on a line stands for any lines, within a line for any characters. With `is_prefix`, `actual`
    may go on after the expected lines.
    """
    expected = [line.rstrip() for line in expected]
    actual = [line.rstrip() for line in actual]
    for lines in (expected, actual):
        while lines and not lines[-1]:
            lines.pop()
    if is_prefix:
        expected = [*expected, ELLIPSIS]
    # reachable[j]: the expected lines so far match the first j lines of the output.
    reachable = {0}
    for number, line in enumerate(expected):
        if line.strip() == ELLIPSIS:
            reachable = set(range(min(reachable), len(actual) + 1))
            continue
        following = {j + 1 for j in reachable if j < len(actual) and lines_match(line, actual[j])}
        if not following:
            return _explain(expected, number, actual, min(reachable))
        reachable = following
    if len(actual) in reachable:
        return ""
    return f"more output than shown, from: {actual[max(reachable)]!r}"


def _explain(expected: list[str], number: int, actual: list[str], reached: int) -> str:
    line = expected[number]
    if number and expected[number - 1].strip() == ELLIPSIS:
        return f"no line after '...' matches {line!r}"
    got = repr(actual[reached]) if reached < len(actual) else "the end of the output"
    return f"expected {line!r}, got {got}"


def lines_match(expected: str, actual: str) -> bool:
    """Returns true if a line of output matches a line of the page."""
    if ELLIPSIS not in expected:
        return _texts_match(expected, actual)
    return _parts_match(expected.split(ELLIPSIS), actual)


def _parts_match(parts: list[str], actual: str) -> bool:
    """Returns true if the parts occur in this order: the first at the beginning, the last at the end."""
    head, *rest = parts
    ends = [end for end in range(len(actual) + 1) if _texts_match(head, actual[:end])]
    for index, part in enumerate(rest):
        starts = range(min(ends), len(actual) + 1) if ends else []
        last = index == len(rest) - 1
        candidates = [len(actual)] if last else range(len(actual) + 1)
        ends = [end for end in candidates if any(s <= end and _texts_match(part, actual[s:end]) for s in starts)]
    return bool(ends)


def _texts_match(expected: str, actual: str) -> bool:
    if NUMBER.sub("#", expected) != NUMBER.sub("#", actual):
        return expected == actual
    return all(numbers_match(*pair) for pair in zip(NUMBER.findall(expected), NUMBER.findall(actual), strict=True))


def numbers_match(expected: str, actual: str) -> bool:
    """Returns true for equal integers, or for equal numbers of decimals and at most one unit of the last digit."""
    one, other = (Decimal(text.replace("−", "-")) for text in (expected, actual))
    exponent = one.as_tuple().exponent
    if exponent != other.as_tuple().exponent:
        return False
    return abs(one - other) <= (Decimal(1).scaleb(exponent) if "." in expected else 0)
