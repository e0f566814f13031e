#!/usr/bin/env python3
"""Draws docs/images/figure-11.svg, the paper's figure 11: a tuning better on the circle, worse at a corner.

Needs `cargo build --release` and `source .build/env.sh`. The tuning is the one that `--search` finds by `tune`.
"""

import json
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import options
import pictures

PICTURE = pictures.IMAGES / "figure-11.svg"
TITLE = "Radial deviation on a circle and position at a corner, of two controllers"
CIRCLE, CORNER = "ballbar", "corner-45"
TUNING = {"n1": 1, "n2": 9, "nu": 8, "lambda_rel": 0.5}
SYMBOLS = {"n1": "N1", "n2": "N2", "nu": "Nu", "lambda_rel": "λ_rel"}
# End of the first leg, and the displayed range around the corner, mm.
LEG_MM, AROUND_MM = 50.0, 2.5
TRACE = ("--trace-period", "1ms")
GROUP = 8
"""Samples of which the picture of the circle has minimum and maximum: half a pixel."""


def search() -> dict[str, float]:
    """Returns the tuning that `tune` finds, and prints its margins."""
    arguments = ["tune", CIRCLE, "--controller", "gpc", "--also", CORNER, "--contrast", "--json"]
    found = subprocess.run([pictures.PROGRAM, *arguments], check=True, capture_output=True).stdout
    best = json.loads(found)["best"]
    print(f"tuning     {best['tuning']}")
    print(f"margins    {best['margins']}")
    return best["tuning"]


def figure(tuning: dict[str, float], group: int) -> Figure:
    """Runs circle and corner with both controllers, draws them and prints the contour errors."""
    loops = [f"{axis}.position_loop" for axis in "xy"]
    changes = [f"--set={loop}.controller=gpc" for loop in loops]
    changes += [f"--set={loop}.gpc.{name}={value}" for loop in loops for name, value in tuning.items()]
    gpc = "GPC " + ", ".join(f"{symbol} {tuning[name]:g}" for name, symbol in SYMBOLS.items())
    drawing, (circle, corner) = plt.subplots(1, 2, figsize=(11, 5))
    runs = ("cascade", "cascade with feedforward", "#2a7ab9", []), ("gpc", gpc, "#d95f02", changes)
    for part, name, color, changed in runs:
        figures, run = pictures.ballbar(*TRACE, *changed)
        kept = pictures.extremes(run["deviation"], group)
        circle.plot(run["time"][kept], run["deviation"][kept], color=color, label=name, gid=f"circle-{part}")
        report(CIRCLE, name, figures)
        figures, run = pictures.run(CORNER, *TRACE, *changed)
        near = abs(run["x"] - LEG_MM) < 2 * AROUND_MM
        corner.plot(run["x"][near], run["y"][near], color=color, label=name, gid=f"corner-{part}")
        report(CORNER, name, figures)
    corner.plot([0, LEG_MM, LEG_MM + LEG_MM], [0, 0, LEG_MM], "k--", linewidth=0.8, label="path")
    describe(circle, corner)
    drawing.tight_layout(rect=(0, 0.08, 1, 1))
    drawing.legend(*corner.get_legend_handles_labels(), loc="lower center", ncols=3)
    return drawing


def report(scenario: str, name: str, figures: dict) -> None:
    """Prints the contour errors of a run."""
    error = figures["contour_error_um"]
    print(f"{scenario:10} {name:36} {error['max']:5.1f} µm, within the ends {error['max_within_ends']:5.1f} µm")


def describe(circle: Axes, corner: Axes) -> None:
    """Sets titles, labels and limits."""
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


def write(path: Path, tuning: dict[str, float], group: int = GROUP, tolerance: float = pictures.TOLERANCE) -> None:
    """Writes the picture."""
    with plt.rc_context(pictures.STYLE):
        pictures.save(figure(tuning, group), path, TITLE, tolerance)


def main() -> int:
    """Searches if requested, and draws."""
    parser = options.parser(__doc__)
    parser.add_argument("--search", action="store_true", help="search the tuning anew, over the whole grid")
    arguments = parser.parse_args()
    write(PICTURE, search() if arguments.search else TUNING)
    print(f"picture    {PICTURE.relative_to(pictures.ROOT)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
