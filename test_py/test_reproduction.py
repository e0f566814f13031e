"""Figures of the paper: the numbers of the page that tools/reproduction.py writes are as specified."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))

import reproduction  # noqa: E402  (its folder is added before)


def test_numbers_as_specified():
    """Every number that the model specifies is the output of its command."""
    page = reproduction.page()
    specified = [
        row for row in page.splitlines() if row.startswith("| ") and row.split(" | ")[2] not in ("—", "specified")
    ]
    assert len(specified) >= 30
    assert reproduction.deviations(page) == []


def test_a_deviation_is_found():
    """A number outside its tolerance is a deviation; one within is none."""
    rows = (
        "| a | — | 49.0 ± 0.2 | 49.3 |\n| b | — | 49.0 ± 0.2 | 49.2 |\n| c | — | −8.5 | −8.4 |\n| d | — | 2.37 | 2.39 |"
    )
    assert [row[2] for row in reproduction.deviations(rows)] == ["a", "d"]
