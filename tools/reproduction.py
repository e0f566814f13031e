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


def section(title: str, text: str, command: str, rows: list[tuple[str, str, str, str]]) -> str:
    """Returns the section of one figure of the paper."""
    lines = [
        f"\n## {title}\n",
        textwrap.fill(text, WIDTH, break_on_hyphens=False),
        f"\n    virtual_axes run {command}\n",
    ]
    lines += ["| what | paper | specified | here |", "|---|---|---|---|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def axis_rows(run: dict, axis: str, specified: tuple[str, str], paper: str = "—") -> list[tuple[str, str, str, str]]:
    """Returns the largest delay-compensated following error and current of an axis."""
    figures = run["axes"][axis]
    unit = {"um": "µm", "mdeg": "mdeg"}[figures["unit"]]
    name = axis.upper()
    error, current = figures["delay_compensated_following_error"]["max"], figures["peak_current_a"]
    return [
        (f"{name}, largest delay-compensated following error, {unit}", paper, specified[0], number(error)),
        (f"{name}, largest current, A", "—", specified[1], number(current, 2)),
    ]


def contour_rows(run: dict) -> list[tuple[str, str, str, str]]:
    """Returns contour and orientation errors."""
    contour, orientation = run["contour_error_um"], run["orientation_error_mdeg"]
    rows = [
        ("contour error, max, µm", "—", "—", number(contour["max"])),
        ("the same without end overshoot, µm", "—", "—", number(contour["max_within_ends"])),
        ("contour error, RMS, µm", "—", "—", number(contour["rms"])),
    ]
    if orientation["max"] > 0:
        rows.append(("orientation error, max, mdeg", "—", "—", number(orientation["max"])))
    return rows


def following_error_rows(run: dict) -> list[tuple[str, str, str, str]]:
    """Returns the largest delay-compensated following error of each moving axis."""
    units = {"um": "µm", "mdeg": "mdeg"}
    return [
        (
            f"{name.upper()}, largest delay-compensated following error, {units[axis['unit']]}",
            "—",
            "—",
            number(axis["delay_compensated_following_error"]["max"]),
        )
        for name, axis in run["axes"].items()
        if axis["moves"]
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


def circle_rows(
    run: dict, paper: str, specified: tuple[str, str, str], title: str | None = None
) -> list[tuple[str, str, str, str]]:
    """Returns the radial deviation of the first circle."""
    deviation = run["circles"][0]["radial_deviation_um"]
    title = title or run["controller"]
    return [
        (f"{title}: radial deviation, mean, µm", paper, specified[0], number(deviation["mean"])),
        (f"{title}: smallest, µm", "—", specified[1], number(deviation["min"])),
        (f"{title}: largest, µm", "—", specified[2], number(deviation["max"])),
    ]


def page() -> str:
    """Returns the whole page."""
    parts = [HEAD]
    validated = "measured and simulated agree to {}"
    [single] = run("x-constant")
    rows = axis_rows(single, "x", ("218.9", "14.40"), validated.format("4 µm, during acceleration to 6 µm"))
    parts.append(
        section(
            "Figure 6: one axis at constant velocity",
            "X over 200 mm at 10 m/min; the paper prints neither length nor feed.",
            "x-constant",
            rows,
        )
    )
    others = (("y", ("230.5", "12.40")), ("z", ("102.7", "11.50")), ("a", ("35.0", "2.37")), ("c", ("35.4", "1.76")))
    for axis, specified in others:
        [single] = run(f"{axis}-constant")
        turn = ", 90° at 10 rpm" if axis in "ac" else ""
        text = f"The same trial on {axis.upper()}{turn}; the paper has no figure of it."
        parts.append(
            section(f"Section 4.1: {axis.upper()}", text, f"{axis}-constant", axis_rows(single, axis, specified))
        )
    [single] = run("c-two-speeds")
    rows = axis_rows(single, "c", ("—", "—"), validated.format("0.006°"))
    parts.append(
        section(
            "Figure 7: two velocities on C",
            "0 to 130° at 18 rpm, then to 210° at 6 rpm, reached at 130°.",
            "c-two-speeds",
            rows,
        )
    )
    [single] = run("x-there-and-back")
    parts.append(
        section(
            "Section 4.1, case 3: reciprocating motion",
            "X over 200 mm and back at 10 m/min.",
            "x-there-and-back",
            axis_rows(single, "x", ("—", "—")),
        )
    )
    figure_8 = (
        ("a", "contour-a", "a closed polygon, stopping at the corners"),
        ("b", "contour-b", "two lines joined by half circles"),
        ("c", "orientation-ac", "A and C turn together; the shape is assumed"),
        ("d", "bspline-3d", "a cubic B-spline in X, Y and Z; its control points are assumed"),
    )
    for letter, name, text in figure_8:
        [single] = run(name)
        parts.append(
            section(
                f"Figure 8 {letter}: {name}",
                f"{text[0].upper()}{text[1:]}. In the paper "
                f"{validated.format('5 µm or 0.005°, on the spline to 12 µm')}.",
                name,
                following_error_rows(single) + contour_rows(single),
            )
        )
    command = "ballbar --controller cascade,cascade-noff"
    cascade, without = run(command)
    rows = circle_rows(cascade, "50 (left)", ("49.0 ± 0.2", "47.7 ± 1", "68.6 ± 1"))
    rows += circle_rows(without, "—", ("−283.1 ± 0.2", "−284.4 ± 1", "−263.5 ± 1"))
    parts.append(
        section(
            "Figure 10, left: the ballbar",
            "A circle of 150 mm radius at 15 m/min, two turns at full feed. The paper's unit is misprinted as mm.",
            command,
            rows,
        )
    )
    stiff, soft = run(predictive("ballbar"))
    rows = circle_rows(stiff, "almost 0 (right)", ("0.0 ± 0.2", "−9.5 ± 1", "10.4 ± 1"), TUNINGS[0])
    rows += circle_rows(soft, "almost 0 (right)", ("−1.6 ± 0.2", "−10.4 ± 1", "10.9 ± 1"), TUNINGS[1])
    parts.append(
        section(
            "Figure 10, right: the ballbar under predictive control",
            "The rows contain N1, N2, Nu and λ_rel; the paper does not print its tuning. The extremes are reversal "
            "spikes at the friction reversals in the quadrants.",
            predictive("ballbar"),
            rows,
        )
    )
    command = f"ballbar --controller gpc --compare {','.join(in_x_and_y(feedforward__friction=1))}"
    preset, compensated = run(command)
    rows = circle_rows(preset, "almost 0 (right)", ("−0.4 ± 0.2", "−8.5 ± 1", "13.2 ± 1"), PRESET)
    rows += circle_rows(compensated, "—", ("—", "−1.4", "0.4"), "same tuning with friction compensation")
    parts.append(
        section(
            "Figure 10, right: tuning of the machine file, and friction compensation",
            "The friction current at the setpoint velocity is fed forward, 11.75 ms after the setpoint.",
            command,
            rows,
        )
    )
    for turn, specified in (("90", "146.6"), ("45", "103.7")):
        [single] = run(f"corner-{turn}")
        corner = single["corners"][0]
        rows = [("largest contour error at the corner, µm", "—", specified, number(corner["max_contour_error_um"]))]
        parts.append(
            section(
                f"Figure 11: corner of {turn}°",
                "Two legs of 50 mm at 10 m/min, from rest to rest, without a pause between them.",
                f"corner-{turn}",
                rows + contour_rows(single),
            )
        )
    for turn, cascade, specified in (("90", "146.6", ("6.6", "13.1")), ("45", "103.7", ("4.0", "14.8"))):
        command = predictive(f"corner-{turn}")
        rows = [
            (
                f"{title}: largest contour error at the corner, µm",
                "—",
                value,
                number(single["corners"][0]["max_contour_error_um"]),
            )
            for title, value, single in zip(TUNINGS, specified, run(command), strict=True)
        ]
        parts.append(
            section(
                f"Figure 11: corner of {turn}° under predictive control",
                f"The same corner as above, where the cascade has {cascade} µm, with the tunings of figure 10.",
                command,
                rows,
            )
        )
    for name, text in (
        ("five-axis", "The tool tip along a path in the workpiece while A and C turn"),
        ("bspline-5x", "The tool tip along a spatial B-spline while A and C turn"),
    ):
        [single] = run(name)
        parts.append(
            section(
                f"Section 6, objective of the paper: {name}",
                f"{text}: the geometric error caused by the drives, in the workpiece frame.",
                name,
                following_error_rows(single) + contour_rows(single),
            )
        )
    return "".join(parts)


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
