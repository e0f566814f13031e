#!/usr/bin/env python3
"""Writes docs/reproduction.md: the paper figure by figure, with the command for each number.

    cargo build --release && tools/reproduction.py

Each number is the output of the command beside it. The status is 1 if a number is not as specified. The pictures are
those of tools/pictures.py.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import options
import pictures

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "virtual_axes"
PAGE = ROOT / "docs" / "reproduction.md"

HEAD = """# The paper, figure by figure

Prévost, Lavernhe, Lartigue, Dumur: *Feed drive modelling for the simulation of tool path tracking in multi-axis High
Speed Machining*. The paper compares measurements of a Mikron UCP 710 with its simulation; the measurements are not
published. So two things can be compared: what the paper states in words, and numbers that follow from its equations and
parameters. Each section has what the paper states, what this package computes and how, and a picture of it.

The tables have one to three columns of numbers, of the same quantity in the same unit:

- *paper*: printed there. It prints one number of its simulation, the deviation on the circle; the others describe how
  well simulation and measurement agree, and stand in the text.
- *specified*: what equations 1 to 9 with the printed parameters give, computed with closed forms or by an independent
  program, not by this package. A test fails if a number differs by more than the stated tolerance, else by more than
  one unit of the last digit.
- *here*: the output of the command above the table. Add `--report page.html` for its plots, `--trace signals.csv` for
  its signals.

A number without a specified one is a result; it is compared with nothing. Values that the paper does not print, such as
lengths and shapes, are assumed and named. `tools/reproduction.py` writes this page, `tools/pictures.py` its pictures.
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
    words = arguments.partition(" --trace")[0].replace("\\\n", " ").split()
    command = [PROGRAM, "run", *words, "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=300).stdout)["runs"]


def number(value: float, digits: int = 1) -> str:
    """Returns a number with a real minus sign, and without a negative zero."""
    text = f"{value:.{digits}f}"
    return (text if float(text) else text.removeprefix("-")).replace("-", "−")


@dataclass
class Row:
    """Row of a table: a quantity, its number here, and where there are some the specified and the printed ones."""

    what: str
    here: str
    paper: str = ""
    specified: str = ""

    def deviates(self) -> bool:
        """Returns whether the number is not as specified."""
        if not self.specified:
            return False
        specified, _, tolerance = self.specified.replace("−", "-").partition(" ± ")
        unit = 10.0 ** -len(specified.partition(".")[2])
        return abs(float(self.here.replace("−", "-")) - float(specified)) > float(tolerance or unit) + 1e-9


def row(what: str, value: float, digits: int = 1, **cells: str) -> Row:
    """Returns a row of a table."""
    return Row(what, number(value, digits), **cells)


def error_row(run: dict, axis: str, **cells: str) -> Row:
    """Returns the row of the largest delay-compensated following error of an axis."""
    figures = run["axes"][axis]
    unit = {"um": "µm", "mdeg": "mdeg"}[figures["unit"]]
    what = f"{axis.upper()}, largest delay-compensated following error, {unit}"
    return row(what, figures["delay_compensated_following_error"]["max"], **cells)


def axis_rows(run: dict, axis: str, error: str = "", current: str = "") -> list[Row]:
    """Returns the largest error and current of an axis, with their specified values."""
    peak = run["axes"][axis]["peak_current_a"]
    return [
        error_row(run, axis, specified=error),
        row(f"{axis.upper()}, largest current, A", peak, 2, specified=current),
    ]


def contour_rows(run: dict) -> list[Row]:
    """Returns contour and orientation errors."""
    contour, orientation = run["contour_error_um"], run["orientation_error_mdeg"]
    rows = [
        row("contour error, max, µm", contour["max"]),
        row("the same without end overshoot, µm", contour["max_within_ends"]),
        row("contour error, RMS, µm", contour["rms"]),
    ]
    return rows + ([row("orientation error, max, mdeg", orientation["max"])] if orientation["max"] > 0 else [])


def path_rows(run: dict) -> list[Row]:
    """Returns the errors of the moving axes and of the path."""
    return [error_row(run, name) for name, axis in run["axes"].items() if axis["moves"]] + contour_rows(run)


def corner_row(run: dict, specified: str, title: str = "") -> Row:
    """Returns the largest contour error at the corner."""
    what = f"{title}largest contour error at the corner, µm"
    return row(what, run["corners"][0]["max_contour_error_um"], specified=specified)


def circle_rows(run: dict, title: str, paper: str, *specified: str) -> list[Row]:
    """Returns the radial deviation of the first circle; `specified` are mean, minimum and maximum."""
    deviation = run["circles"][0]["radial_deviation_um"]
    names = {"mean": f"{title}: radial deviation, mean, µm", "min": f"{title}: smallest, µm"}
    names["max"] = f"{title}: largest, µm"
    papers = (paper, "", "")
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


def law_rows(run: dict) -> list[Row]:
    """Returns the current of X at constant velocities, beside equation 3 with the printed parameters."""
    del run
    return [
        row(
            f"X, current at {feed} m/min, A",
            pictures.steady_current("x-constant", "x", "--feed", str(feed)),
            4,
            specified=number(float(pictures.printed_friction(feed)), 4),
        )
        for feed in (1, 5, 10, 15)
    ]


@dataclass
class Section:
    """Section of the page: what the paper states, what is simulated, the command, and its results."""

    title: str
    paper: str
    here: str
    command: str
    rows: Callable[..., list[Row]]
    """Function from the runs of the command to the rows of the table."""
    picture: tuple[str, str] = ("", "")
    """File in docs/images and its description."""


DURING = "The largest following errors arise in acceleration and deceleration"
SECTIONS = [
    Section(
        "Figure 5: friction law of X",
        "The current at constant velocity depends on the velocity alone; a law of two exponentials (equation 3) fits "
        "the measured currents with a regression coefficient of 0.995.",
        "X moves with the parameters of appendix 2. Behind the middle of the motion the mean current, column "
        "`x.current` of the trace, is that of the printed law; likewise with other feeds.",
        "x-constant --feed 10 --trace x.csv",
        law_rows,
        ("figure-5.svg", "Friction law of X over the velocity, and currents of simulated motions on it"),
    ),
    Section(
        "Figure 6: one axis at constant velocity",
        "Simulated and measured position differ by at most 4 µm, in acceleration and deceleration by 6 µm; velocity "
        "and current are almost identical.",
        "X moves 200 mm at 10 m/min; the paper prints neither length nor feed. "
        + DURING
        + ", as in the paper, and none is "
        "left at constant velocity. The picture has one sample per position cycle, as the recordings of the paper.",
        "x-constant",
        lambda run: axis_rows(run, "x", "218.9", "14.40"),
        ("figure-6.svg", "X over time: setpoint and position, following error, velocity, current"),
    ),
    *(
        Section(
            f"Section 4.1: {axis.upper()}",
            "Whatever the axis, the experiments give similar results; the paper has no figure of this one.",
            f"The same trial on {axis.upper()}{turn}.",
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
    Section(
        "Figure 7: two velocities on C",
        "C turns from 0° to 130° at 18 rpm and to 210° at 6 rpm. Simulated and measured angle differ by less than "
        "0.006°, most in acceleration and deceleration.",
        "The same motion; 6 rpm are reached at 130°. " + DURING + ".",
        "c-two-speeds",
        lambda run: axis_rows(run, "c"),
        ("figure-7.svg", "C over time: setpoint and position, following error, velocity, current"),
    ),
    Section(
        "Section 4.1, case 3: reciprocating motion",
        "A segment is traveled back and forth at the same velocity; the paper has no figure of it.",
        "X moves 200 mm and back at 10 m/min.",
        "x-there-and-back",
        lambda run: axis_rows(run, "x"),
    ),
    *(
        Section(
            f"Figure 8 {letter}: {name}",
            f"{shown}. Simulated and measured positions differ by less than {agreement}.",
            text,
            name,
            path_rows,
            (f"figure-8-{letter}.svg", f"Path of {name}, and following errors of its axes over time"),
        )
        for letter, name, shown, agreement, text in (
            (
                "a",
                "contour-a",
                "A trajectory in X and Y at 10 m/min",
                "5 µm",
                "A closed polygon of an assumed shape, which stops at the corners.",
            ),
            (
                "b",
                "contour-b",
                "A trajectory in X and Y at 10 m/min",
                "5 µm",
                "Two lines joined by half circles; lengths and radius are assumed.",
            ),
            (
                "c",
                "orientation-ac",
                "A change of the tool orientation by A and C",
                "0.005°",
                "A and C turn together; the angles and the speed are assumed.",
            ),
            (
                "d",
                "bspline-3d",
                "A B-spline in space",
                "12 µm",
                "A cubic B-spline in X, Y and Z; its control points are assumed.",
            ),
        )
    ),
    Section(
        "Figure 10, left: the ballbar",
        "A circle of 150 mm radius at 15 m/min, with velocity and torque feedforward: an error of 50 mm, "
        "which must be µm.",
        "The circle of two turns at full feed. Its radius is too large by 49 µm: the velocity feedforward is late by "
        "half a position cycle ([The model](explanation/model.md#control)). Without feedforward it is too small.",
        "ballbar --controller cascade,cascade-noff",
        lambda cascade, without: [
            *circle_rows(cascade, cascade["controller"], "50", "49.0 ± 0.2", "47.7 ± 1", "68.6 ± 1"),
            *circle_rows(without, without["controller"], "", "−283.1 ± 0.2", "−284.4 ± 1", "−263.5 ± 1"),
        ],
        ("figure-10.svg", "Radial deviation on the circle: the cascade 49 µm outside, predictive control near zero"),
    ),
    Section(
        "Figure 10, right: the ballbar under predictive control",
        "The same circle with a predictive controller of the position loop: the error is almost zero. Its tuning "
        "N1, N2, Nu, λ is not printed.",
        "Two tunings, named in the rows by N1, N2, Nu and λ_rel. The mean is almost zero with both; the extremes are "
        "the spikes at the reversals, by friction. The picture above has the first one.",
        predictive("ballbar"),
        lambda stiff, soft: [
            *circle_rows(stiff, TUNINGS[0], "almost 0", "0.0 ± 0.2", "−9.5 ± 1", "10.4 ± 1"),
            *circle_rows(soft, TUNINGS[1], "almost 0", "−1.6 ± 0.2", "−10.4 ± 1", "10.9 ± 1"),
        ],
    ),
    Section(
        "Figure 10, right: tuning of the machine file, and friction compensation",
        "As above.",
        "The tuning of the machine file, and the same with friction compensation, which the paper does not have: the "
        "friction current at the setpoint velocity is fed forward, 11.75 ms after the setpoint.",
        f"ballbar --controller gpc --compare {','.join(in_x_and_y(feedforward__friction=1))}",
        lambda preset, compensated: [
            *circle_rows(preset, PRESET, "almost 0", "−0.4 ± 0.2", "−8.5 ± 1", "13.2 ± 1"),
            *circle_rows(compensated, "same tuning with friction compensation", "", "", "−1.4", "0.4"),
        ],
    ),
    *(
        Section(
            f"Figure 11: corner of {turn}°",
            "A sharp corner at 10 m/min, with the cascade.",
            "Two legs of 50 mm from rest to rest, without a pause between them; the lengths are assumed.",
            f"corner-{turn}",
            partial(lambda run, value: [corner_row(run, value), *contour_rows(run)], value=value),
            picture,
        )
        for turn, value, picture in (
            (
                "90",
                "146.6",
                ("figure-11.svg", "Both corners enlarged: the cascade passes outside, predictive control on the path"),
            ),
            ("45", "103.7", ("", "")),
        )
    ),
    *(
        Section(
            f"Figure 11: corner of {turn}° under predictive control",
            "With the tuning of figure 10, predictive control has a smaller gap than the cascade in one of the two "
            "pictures, and not in the other: the tuning depends on the trajectory.",
            f"The corner of {turn}°, where the cascade has {cascade} µm, with both tunings of figure 10: the gap is "
            "smaller. A tuning that is better on the circle and worse at a corner exists, too "
            "([Predictive control](explanation/predictive-control.md#the-tuning-depends-on-the-path)).",
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
        Section(
            f"Section 6: {name}",
            "The model is to predict the geometric error that the drives cause; the paper has no figure of this path.",
            f"{text}; the error is that in the workpiece frame.",
            name,
            path_rows,
        )
        for name, text in (
            ("five-axis", "The tool tip moves along a path in the workpiece while A and C turn"),
            ("bspline-5x", "The tool tip moves along a B-spline in space while A and C turn"),
        )
    ),
]
"""Sections of the page, in the order of the paper."""


def table(rows: list[Row]) -> list[str]:
    """Returns the lines of a table, with the columns that have a value."""
    columns = [name for name in ("paper", "specified", "here") if any(getattr(row, name) for row in rows)]
    lines = [f"| | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    return lines + [f"| {' | '.join([row.what, *(getattr(row, name) for name in columns)])} |" for row in rows]


def page() -> tuple[str, list[Row]]:
    """Returns the whole page, and the rows of its tables."""
    parts, every = [HEAD.rstrip("\n")], []
    for section in SECTIONS:
        rows = section.rows(*run(section.command))
        every += rows
        texts = (f"**Paper.** {section.paper}", f"**Here.** {section.here}")
        wrapped = [textwrap.fill(text, WIDTH, break_on_hyphens=False, break_long_words=False) for text in texts]
        parts += [
            f"\n## {section.title}\n",
            "\n\n".join(wrapped),
            f"\n    virtual_axes run {section.command}\n",
            *table(rows),
        ]
        name, description = section.picture
        parts += [f"\n![{description}](images/{name})"] if name else []
    return "\n".join(parts) + "\n", every


def main() -> int:
    """Writes the page and reports deviations."""
    options.parser(__doc__).parse_args()
    text, rows = page()
    PAGE.write_text(text, encoding="utf-8")
    wrong = [row for row in rows if row.deviates()]
    for one in wrong:
        print(f"reproduction: {one.what}: {one.here}, specified {one.specified}", file=sys.stderr)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
