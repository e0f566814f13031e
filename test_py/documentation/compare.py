"""Comparison of expected and actual output."""

from __future__ import annotations

import re

NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w])")


def mismatch(expected: list[str], actual: list[str]) -> str | None:
    """Returns the first difference in one line, or None if the output is as expected."""
    reached = _match(expected, actual)
    if reached is None:
        return None
    wanted, found = reached
    shown = f"`{actual[found]}`" if found < len(actual) else "the end of the output"
    return f"expected `{expected[wanted]}`, found {shown}" if wanted < len(expected) else f"unexpected line {shown}"


def _match(expected: list[str], actual: list[str]) -> tuple[int, int] | None:
    """Returns None for a match, else the furthest pair of lines that was reached."""
    furthest = (0, 0)
    # Lines of the output that can follow the expected lines so far.
    starts = {0}
    for index, line in enumerate(expected):
        furthest = (index, max(starts))
        if line.strip() == "...":
            starts = set(range(min(starts), len(actual) + 1))
        else:
            starts = {start + 1 for start in starts if start < len(actual) and line_matches(line, actual[start])}
        if not starts:
            if index and expected[index - 1].strip() == "...":
                return index, len(actual)
            return furthest
    return None if len(actual) in starts else (len(expected), max(starts))


def line_matches(expected: str, actual: str) -> bool:
    """Returns true if a line equals the expected one, with numbers within one unit of their last decimal."""
    pattern, numbers, end = "", [], 0
    for number in NUMBER.finditer(expected):
        pattern += _literal(expected[end : number.start()]) + f"({NUMBER.pattern})"
        numbers.append(number[0])
        end = number.end()
    pattern += _literal(expected[end:].rstrip())
    found = re.fullmatch(pattern, actual.rstrip())
    return found is not None and all(map(number_matches, numbers, found.groups()))


def _literal(text: str) -> str:
    parts = re.split(r"(\.\.\.|\s+)", text)
    return "".join(".*" if part == "..." else r"\s+" if part.isspace() else re.escape(part) for part in parts)


def number_matches(expected: str, actual: str) -> bool:
    """Returns true if a number differs by at most one unit of the last decimal of the expected one."""
    expected, actual = expected.replace("−", "-"), actual.replace("−", "-")
    mantissa, _, exponent = expected.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    if not decimals and not exponent:
        return float(expected) == float(actual)
    unit = 10.0 ** (int(exponent or 0) - decimals)
    return abs(float(expected) - float(actual)) <= unit * (1 + 1e-9)
