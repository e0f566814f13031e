"""Figures of the paper: the page that tools/reproduction.py writes is the stored one, and as specified."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))

import reproduction  # noqa: E402  (its folder is added before)


def test_numbers_as_specified():
    """Every number that the model specifies is the output of its command, and the stored page has them."""
    page, rows = reproduction.page()
    assert sum(bool(row.specified) for row in rows) >= 30
    assert [row for row in rows if row.deviates()] == []
    assert reproduction.PAGE.read_text(encoding="utf-8") == page, "tools/reproduction.py writes another page"


def test_a_deviation_is_found():
    """A number outside its tolerance is a deviation; one within is none."""
    rows = [("49.3", "49.0 ± 0.2"), ("49.2", "49.0 ± 0.2"), ("−8.4", "−8.5"), ("2.39", "2.37"), ("2.39", "")]
    deviates = [reproduction.Row("", here, specified=specified).deviates() for here, specified in rows]
    assert deviates == [True, False, False, True, False]


def test_columns_without_values_are_left_out():
    """A table has the columns that have a value."""
    rows = [reproduction.Row("a", "1.0"), reproduction.Row("b", "2.0", specified="2.0")]
    assert reproduction.table(rows)[0] == "| | specified | here |"
    assert reproduction.table(rows[:1])[2] == "| a | 1.0 |"
