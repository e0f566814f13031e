#!/usr/bin/env python3
"""Writes docs/reproduction.md: the paper figure by figure, with the command for each number.

    cargo build --release && tools/reproduction.py

Each number is the output of the command beside it. The status is 1 if a number is not as specified.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from functools import partial
from pathlib import Path

import options

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "virtual_axes"
PAGE = ROOT / "docs" / "reproduction.md"

HEAD = """# The paper, figure by figure

Prévost, Lavernhe, Lartigue, Dumur: *Feed drive modelling for the simulation of tool path tracking in
multi-axis High Speed Machining*. The paper compares measurements with a simulation. Columns of the tables:
the value printed in the paper, the value specified for this package's model, and the value computed by
`virtual_axes` with the command above the table. Add `--report page.html` to a command for plots,
`--trace signals.csv` for the signals.

`tools/reproduction.py` generates this page. A test compares its numbers with the specified ones: within the stated
tolerance, else within one unit of the last digit.
"""


WIDTH = 120
"""Line width of the page's text, characters."""

CONTINUED = " \\\n        "
"""Continuation of a command on the next line in shell syntax."""


TUNINGS = ("gpc 1, 8, 6, 10⁻³", "gpc 1, 8, 6, 10⁻²")
"""N1, N2, Nu and λ_rel of the two runs of `predictive`."""
PRESET = "gpc 1, 14, 12, 0.005"


def run(arguments: str) -> list[dict]:
    """Returns the runs of `virtual_axes run … --json`."""
    command = [PROGRAM, "run", *arguments.replace("\\\n", " ").split(), "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=300).stdout)["runs"]


def number(value: float, digits: int = 1) -> str:
    """Returns a number with a real minus sign, and without a negative zero."""
    text = f"{value:.{digits}f}"
    return (text if float(text) else text.removeprefix("-")).replace("-", "−")


def row(what: str, value: float, digits: int = 1, paper: str = "—", specified: str = "—") -> str:
    """Returns a row of a table."""
    return f"| {what} | {paper} | {specified} | {number(value, digits)} |"


def error_row(run: dict, axis: str, **cells: str) -> str:
    """Returns the row of the largest delay-compensated following error of an axis."""
    figures = run["axes"][axis]
    unit = {"um": "µm", "mdeg": "mdeg"}[figures["unit"]]
    what = f"{axis.upper()}, largest delay-compensated following error, {unit}"
    return row(what, figures["delay_compensated_following_error"]["max"], **cells)


def axis_rows(run: dict, axis: str, error: str = "—", current: str = "—", paper: str = "—") -> list[str]:
    """Returns the largest error and current of an axis, with their specified values."""
    peak = run["axes"][axis]["peak_current_a"]
    return [
        error_row(run, axis, paper=paper, specified=error),
        row(f"{axis.upper()}, largest current, A", peak, 2, specified=current),
    ]


def contour_rows(run: dict) -> list[str]:
    """Returns contour and orientation errors."""
    contour, orientation = run["contour_error_um"], run["orientation_error_mdeg"]
    rows = [
        row("contour error, max, µm", contour["max"]),
        row("the same without end overshoot, µm", contour["max_within_ends"]),
        row("contour error, RMS, µm", contour["rms"]),
    ]
    return rows + ([row("orientation error, max, mdeg", orientation["max"])] if orientation["max"] > 0 else [])


def path_rows(run: dict) -> list[str]:
    """Returns the errors of the moving axes and of the path."""
    return [error_row(run, name) for name, axis in run["axes"].items() if axis["moves"]] + contour_rows(run)


def corner_row(run: dict, specified: str, title: str = "") -> str:
    """Returns the largest contour error at the corner."""
    what = f"{title}largest contour error at the corner, µm"
    return row(what, run["corners"][0]["max_contour_error_um"], specified=specified)


def circle_rows(run: dict, title: str, paper: str, *specified: str) -> list[str]:
    """Returns the radial deviation of the first circle; `specified` are mean, minimum and maximum."""
    deviation = run["circles"][0]["radial_deviation_um"]
    names = {"mean": f"{title}: radial deviation, mean, µm", "min": f"{title}: smallest, µm"}
    names["max"] = f"{title}: largest, µm"
    papers = (paper, "—", "—")
    return [
        row(what, deviation[key], paper=printed, specified=value)
        for (key, what), printed, value in zip(names.items(), papers, specified, strict=True)
    ]


def in_x_and_y(**values: object) -> list[str]:
    """Returns parameter assignments for both axes; two underscores stand for a dot."""
    return [f"{axis}.{key.replace('__', '.')}={value}" for key, value in values.items() for axis in "xy"]


def predictive(scenario: str) -> str:
    """Returns arguments for a scenario with N1, N2, Nu = 1, 8, 6 and λ_rel = 10⁻³, and again with 10⁻²."""
    horizons = in_x_and_y(position_loop__gpc__n2=8, position_loop__gpc__nu=6)
    first, second = (in_x_and_y(position_loop__gpc__lambda_rel=weight) for weight in ("1e-3", "1e-2"))
    lines = [" ".join(f"--set {change}" for change in pair) for pair in (horizons[:2], horizons[2:], first)]
    return CONTINUED.join([f"{scenario} --controller gpc", *lines, f"--compare {','.join(second)}"])


AGREES = "measured and simulated agree to "
SECTIONS: list[tuple[str, str, str, Callable[..., list[str]]]] = [
    (
        "Figure 6: one axis at constant velocity",
        "X over 200 mm at 10 m/min; the paper prints neither length nor feed.",
        "x-constant",
        lambda run: axis_rows(run, "x", "218.9", "14.40", AGREES + "4 µm, during acceleration to 6 µm"),
    ),
    *(
        (
            f"Section 4.1: {axis.upper()}",
            f"The same trial on {axis.upper()}{turn}; the paper has no figure of it.",
            f"{axis}-constant",
            partial(lambda run, axis, specified: axis_rows(run, axis, *specified), axis=axis, specified=specified),
        )
        for axis, turn, *specified in (
            ("y", "", "230.5", "12.40"),
            ("z", "", "102.7", "11.50"),
            ("a", ", 90° at 10 rpm", "35.0", "2.37"),
            ("c", ", 90° at 10 rpm", "35.4", "1.76"),
        )
    ),
    (
        "Figure 7: two velocities on C",
        "0 to 130° at 18 rpm, then to 210° at 6 rpm, reached at 130°.",
        "c-two-speeds",
        lambda run: axis_rows(run, "c", paper=AGREES + "0.006°"),
    ),
    (
        "Section 4.1, case 3: reciprocating motion",
        "X over 200 mm and back at 10 m/min.",
        "x-there-and-back",
        lambda run: axis_rows(run, "x"),
    ),
    *(
        (
            f"Figure 8 {letter}: {name}",
            f"{text}. In the paper {AGREES}5 µm or 0.005°, on the spline to 12 µm.",
            name,
            path_rows,
        )
        for letter, name, text in (
            ("a", "contour-a", "A closed polygon, stopping at the corners"),
            ("b", "contour-b", "Two lines joined by half circles"),
            ("c", "orientation-ac", "A and C turn together; the shape is assumed"),
            ("d", "bspline-3d", "A cubic B-spline in X, Y and Z; its control points are assumed"),
        )
    ),
    (
        "Figure 10, left: the ballbar",
        "A circle of 150 mm radius at 15 m/min, two turns at full feed. The paper's unit is misprinted as mm.",
        "ballbar --controller cascade,cascade-noff",
        lambda cascade, without: [
            *circle_rows(cascade, cascade["controller"], "50 (left)", "49.0 ± 0.2", "47.7 ± 1", "68.6 ± 1"),
            *circle_rows(without, without["controller"], "—", "−283.1 ± 0.2", "−284.4 ± 1", "−263.5 ± 1"),
        ],
    ),
    (
        "Figure 10, right: the ballbar under predictive control",
        "The rows contain N1, N2, Nu and λ_rel; the paper does not print its tuning. The extremes are reversal "
        "spikes at the friction reversals in the quadrants.",
        predictive("ballbar"),
        lambda stiff, soft: [
            *circle_rows(stiff, TUNINGS[0], "almost 0 (right)", "0.0 ± 0.2", "−9.5 ± 1", "10.4 ± 1"),
            *circle_rows(soft, TUNINGS[1], "almost 0 (right)", "−1.6 ± 0.2", "−10.4 ± 1", "10.9 ± 1"),
        ],
    ),
    (
        "Figure 10, right: tuning of the machine file, and friction compensation",
        "The friction current at the setpoint velocity is fed forward, 11.75 ms after the setpoint.",
        f"ballbar --controller gpc --compare {','.join(in_x_and_y(feedforward__friction=1))}",
        lambda preset, compensated: [
            *circle_rows(preset, PRESET, "almost 0 (right)", "−0.4 ± 0.2", "−8.5 ± 1", "13.2 ± 1"),
            *circle_rows(compensated, "same tuning with friction compensation", "—", "—", "−1.4", "0.4"),
        ],
    ),
    *(
        (
            f"Figure 11: corner of {turn}°",
            "Two legs of 50 mm at 10 m/min, from rest to rest, without a pause between them.",
            f"corner-{turn}",
            partial(lambda run, value: [corner_row(run, value), *contour_rows(run)], value=value),
        )
        for turn, value in (("90", "146.6"), ("45", "103.7"))
    ),
    *(
        (
            f"Figure 11: corner of {turn}° under predictive control",
            f"The same corner as above, where the cascade has {cascade} µm, with the tunings of figure 10.",
            predictive(f"corner-{turn}"),
            partial(
                lambda *runs, values: [
                    corner_row(run, value, f"{title}: ")
                    for title, value, run in zip(TUNINGS, values, runs, strict=True)
                ],
                values=values,
            ),
        )
        for turn, cascade, *values in (("90", "146.6", "6.6", "13.1"), ("45", "103.7", "4.0", "14.8"))
    ),
    *(
        (
            f"Section 6, objective of the paper: {name}",
            f"{text}: the geometric error caused by the drives, in the workpiece frame.",
            name,
            path_rows,
        )
        for name, text in (
            ("five-axis", "The tool tip along a path in the workpiece while A and C turn"),
            ("bspline-5x", "The tool tip along a spatial B-spline while A and C turn"),
        )
    ),
]
"""Title, text, command, and function from the runs to the rows of each figure of the paper."""


def page() -> str:
    """Returns the whole page."""
    parts = [HEAD.rstrip("\n")]
    for title, text, command, rows in SECTIONS:
        text = textwrap.fill(text, WIDTH, break_on_hyphens=False)
        parts += [f"\n## {title}\n", text, f"\n    virtual_axes run {command}\n"]
        parts += ["| what | paper | specified | here |", "|---|---|---|---|", *rows(*run(command))]
    return "\n".join(parts) + "\n"


def deviations(text: str) -> list[str]:
    """Returns the rows of the page whose number is not as specified."""
    found = []
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")] if line.startswith("| ") else []
        if len(cells) != 4 or cells[2] in ("specified", "—"):
            continue
        specified, _, tolerance = cells[2].replace("−", "-").partition(" ± ")
        unit = 10.0 ** -len(specified.partition(".")[2])
        if abs(float(cells[3].replace("−", "-")) - float(specified)) > float(tolerance or unit) + 1e-9:
            found.append(line)
    return found


def main() -> int:
    """Writes the page and reports deviations."""
    options.parser(__doc__).parse_args()
    text = page()
    PAGE.write_text(text, encoding="utf-8")
    wrong = deviations(text)
    for line in wrong:
        print(f"reproduction: not as specified: {line}", file=sys.stderr)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
