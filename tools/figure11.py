#!/usr/bin/env python3
"""Figure 11 of the paper by `tune`: better on the circle, worse at a corner; writes docs/images/figure-11.svg.

Needs `cargo build --release` and `source .build/env.sh`. Takes minutes: `tune` searches the whole grid.
"""

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib

import options

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend is chosen before)

ROOT = Path(__file__).resolve().parent.parent
COMMAND = ROOT / "target" / "release" / "virtual_axes"
PICTURE = ROOT / "docs" / "images" / "figure-11.svg"
CIRCLE, CORNER = "ballbar", "corner-45"
RADIUS_MM = 150.0
# End of the first leg, and the displayed range around the corner, mm.
LEG_MM, AROUND_MM = 50.0, 2.5
# Span between the ramps, as in the definition of the radial deviation, s.
STEADY = (1.5, 8.04)


def search() -> dict:
    """Returns the contrast that `tune` finds."""
    arguments = ["tune", CIRCLE, "--controller", "gpc", "--also", CORNER, "--contrast", "--json"]
    return json.loads(subprocess.run([COMMAND, *arguments], check=True, capture_output=True).stdout)


def trace(scenario: str, changes: list[str]) -> dict[str, list[float]]:
    """Returns positions of X and Y in mm, every millisecond."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace.csv"
        arguments = ["run", scenario, "--trace", path, "--trace-period", "1ms"]
        for change in changes:
            arguments += ["--set", change]
        subprocess.run([COMMAND, *arguments], check=True, capture_output=True)
        with path.open() as file:
            rows = list(csv.DictReader(file))
    columns = {"time": "time", "x": "x.position", "y": "y.position"}
    scale = {"time": 1.0, "x": 1e3, "y": 1e3}
    return {name: [float(row[column]) * scale[name] for row in rows] for name, column in columns.items()}


def draw(contrast: dict) -> None:
    """Draws the circle's deviation over its angle and the corner, of both controllers."""
    tuning = contrast["best"]["tuning"]
    names = {"n1": "N1", "n2": "N2", "nu": "Nu", "lambda_rel": "λ_rel"}
    changes = [f"{axis}.position_loop.controller=gpc" for axis in "xy"]
    changes += [f"{axis}.position_loop.gpc.{name}={tuning[name]}" for axis in "xy" for name in names]
    label = "GPC " + ", ".join(f"{text} {tuning[name]:g}" for name, text in names.items())
    figure, (circle, corner) = plt.subplots(1, 2, figsize=(11, 5))
    for changed, name, color in ([], "cascade with feedforward", "#2a7ab9"), (changes, label, "#d95f02"):
        run = trace(CIRCLE, changed)
        steady = [i for i, time in enumerate(run["time"]) if STEADY[0] <= time <= STEADY[1]]
        # The circle starts at home, at its rightmost point.
        deviation = [((run["x"][i] + RADIUS_MM) ** 2 + run["y"][i] ** 2) ** 0.5 - RADIUS_MM for i in steady]
        circle.plot([run["time"][i] for i in steady], [d * 1e3 for d in deviation], color=color, label=name)
        run = trace(CORNER, changed)
        corner.plot(run["x"], run["y"], color=color, label=name)
    corner.plot([0, LEG_MM, LEG_MM + LEG_MM], [0, 0, LEG_MM], "k--", linewidth=0.8, label="path")
    circle.set(xlabel="time (s)", ylabel="radial deviation (µm)", title=f"{CIRCLE}: R 150 mm at 15 m/min")
    corner.set(
        xlabel="X (mm)",
        ylabel="Y (mm)",
        title=f"{CORNER}: 10 m/min",
        xlim=(LEG_MM - AROUND_MM, LEG_MM + AROUND_MM),
        ylim=(-AROUND_MM / 5, AROUND_MM / 2),
        aspect="equal",
    )
    for axes in circle, corner:
        axes.grid(alpha=0.3)
    figure.tight_layout(rect=(0, 0.08, 1, 1))
    figure.legend(*corner.get_legend_handles_labels(), loc="lower center", ncols=3)
    figure.savefig(PICTURE, metadata={"Date": None})


def main() -> int:
    """Searches, draws and prints the result."""
    options.parser(__doc__).parse_args()
    contrast = search()
    draw(contrast)
    there = contrast["also"][0]
    print(f"tuning     {contrast['best']['tuning']}")
    print(f"{CIRCLE:10} {contrast['present']['cost']:.1f} µm, tuned {contrast['best']['cost']:.1f} µm")
    print(f"{CORNER:10} {there['present']['cost']:.1f} µm, tuned {there['tuned']['cost']:.1f} µm")
    print(f"margins    {contrast['best']['margins']}")
    print(f"picture    {PICTURE.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
