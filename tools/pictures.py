#!/usr/bin/env python3
"""Draws the pictures of the documentation by runs of `virtual_axes`: small SVG files with simplified curves.

    cargo build --release && source .build/env.sh
    tools/pictures.py                     writes ballbar.svg (README.md) and figure-11.svg (the paper's) in docs/images

./demo.sh draws the ballbars over ROS 2. Figure 11: a tuning that is better on the circle and worse at a corner, found
by `virtual_axes tune ballbar --controller gpc --also corner-45 --contrast`.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend is chosen before)
import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

import options  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "test_py"))
from polar_chart import Circle, draw  # noqa: E402

PROGRAM = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "virtual_axes"
IMAGES = ROOT / "docs" / "images"
TOLERANCE = 0.1
"""Largest distance of samples from the simplified curve, points (a pixel is 0.75 points)."""
STYLE = {
    # Coordinates of a figure are those of its SVG file.
    "figure.dpi": 72,
    # Text remains text: small, and found by a search. The fonts have similar widths.
    "svg.fonttype": "none",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "sans-serif"],
    "path.simplify": False,
    # Identifiers that depend on the content alone.
    "svg.hashsalt": "virtual_axes",
}

RADIUS_MM = 150.0
STEADY = (1.5, 8.04)
"""Span between the ramps of the ballbar, as in the definition of the radial deviation, s."""
TUNING = {"n1": 1, "n2": 9, "nu": 8, "lambda_rel": 0.5}
SYMBOLS = {"n1": "N1", "n2": "N2", "nu": "Nu", "lambda_rel": "λ_rel"}
LEG_MM, AROUND_MM = 50.0, 2.5
"""End of the first leg of the corner, and the displayed range around the corner, mm."""


def run(scenario: str, *options: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Returns the figures of a run, and its time (s), x and y (mm)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace.csv"
        command = [PROGRAM, "run", scenario, *options, "--json", "--trace", path]
        output = subprocess.run(command, check=True, capture_output=True).stdout
        with path.open() as file:
            header = file.readline().strip().split(",")
            columns = [header.index(name) for name in ("time", "x.position", "y.position")]
            time, x, y = np.loadtxt(file, delimiter=",", usecols=columns, unpack=True)
    return json.loads(output)["runs"][0], {"time": time, "x": x * 1e3, "y": y * 1e3}


def ballbar(*options: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Returns the figures of a ballbar, and its time (s), polar angle (rad) and radial deviation (µm)."""
    figures, trace = run("ballbar", *options)
    steady = (trace["time"] >= STEADY[0]) & (trace["time"] <= STEADY[1])
    # The circle starts at home, at its rightmost point.
    x, y = trace["x"][steady] + RADIUS_MM, trace["y"][steady]
    angle = np.unwrap(np.arctan2(y, x))
    return figures, {"time": trace["time"][steady], "angle": angle, "deviation": (np.hypot(x, y) - RADIUS_MM) * 1e3}


def ballbars() -> Figure:
    """Draws a ballbar with each position controller."""
    circles = {}
    for title, controller in (
        ("cascade with feedforward", "cascade"),
        ("cascade without feedforward", "cascade-noff"),
        ("predictive control", "gpc"),
    ):
        figures, trace = ballbar("--controller", controller)
        [circle] = figures["circles"]
        mean = circle["radial_deviation_um"]["mean"]
        circles[title] = Circle(trace["angle"], trace["deviation"], mean, circle["circular_deviation_um"])
    return draw(circles)


def figure_11(tuning: dict[str, float] = TUNING) -> Figure:
    """Draws circle and corner with both controllers, and prints the contour errors."""
    loops = [f"{axis}.position_loop" for axis in "xy"]
    changes = [f"--set={loop}.controller=gpc" for loop in loops]
    changes += [f"--set={loop}.gpc.{name}={value}" for loop in loops for name, value in tuning.items()]
    gpc = "GPC " + ", ".join(f"{symbol} {tuning[name]:g}" for name, symbol in SYMBOLS.items())
    figure, (circle, corner) = plt.subplots(1, 2, figsize=(11, 5))
    runs = ("cascade", "cascade with feedforward", "#2a7ab9", []), ("gpc", gpc, "#d95f02", changes)
    for part, name, color, changed in runs:
        of_circle, trace = ballbar("--trace-period", "1ms", *changed)
        circle.plot(trace["time"], trace["deviation"], color=color, label=name, gid=f"circle-{part}")
        of_corner, trace = run("corner-45", "--trace-period", "1ms", *changed)
        near = abs(trace["x"] - LEG_MM) < 2 * AROUND_MM
        corner.plot(trace["x"][near], trace["y"][near], color=color, label=name, gid=f"corner-{part}")
        for error in (of_circle["contour_error_um"], of_corner["contour_error_um"]):
            print(f"{name}: {error['max']:.1f} µm, within the ends {error['max_within_ends']:.1f} µm")
    corner.plot([0, LEG_MM, LEG_MM + LEG_MM], [0, 0, LEG_MM], "k--", linewidth=0.8, label="path")
    circle.set(xlabel="time (s)", ylabel="radial deviation (µm)", title="ballbar: R 150 mm at 15 m/min")
    corner.set(xlabel="X (mm)", ylabel="Y (mm)", title="corner-45: 10 m/min", aspect="equal")
    corner.set(xlim=(LEG_MM - AROUND_MM, LEG_MM + AROUND_MM), ylim=(-AROUND_MM / 5, AROUND_MM / 2))
    circle.grid(alpha=0.3)
    corner.grid(alpha=0.3)
    figure.tight_layout(rect=(0, 0.08, 1, 1))
    figure.legend(*corner.get_legend_handles_labels(), loc="lower center", ncols=3)
    return figure


PICTURES: dict[str, tuple[Callable[[], Figure], str]] = {
    "ballbar.svg": (ballbars, "Ballbar: radial deviation over the polar angle"),
    "figure-11.svg": (figure_11, "Radial deviation on a circle and position at a corner, of two controllers"),
}
"""Function and title of each file in docs/images."""


def write(name: str, path: Path, tolerance: float = TOLERANCE, **changes: object) -> None:
    """Draws a picture and writes it as SVG with a white background, with curves simplified to the tolerance."""
    function, title = PICTURES[name]
    with plt.rc_context(STYLE):
        save(function(**changes), path, title, tolerance)


def save(figure: Figure, path: Path, title: str, tolerance: float) -> None:
    """Writes a figure."""
    figure.canvas.draw()
    # Its positions are final.
    figure.set_layout_engine("none")
    for line in (line for axes in figure.axes for line in axes.lines if tolerance > 0):
        kept = simplified(line.get_transform().transform(line.get_xydata()), tolerance)
        line.set_data(line.get_xdata()[kept], line.get_ydata()[kept])
    metadata = {"Title": title, **dict.fromkeys(("Creator", "Date", "Format", "Type"))}
    figure.savefig(path, metadata=metadata)
    plt.close(figure)
    path.write_text(compact(path.read_text()))


def simplified(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Returns indices of points whose polyline stays within the tolerance (Ramer, Douglas, Peucker)."""
    kept, spans = {0, len(points) - 1}, [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        distance = distance_to_segments(points[first : last + 1], points[[first, last]])
        farthest = first + int(np.argmax(distance))
        if distance[farthest - first] > tolerance:
            kept.add(farthest)
            spans += [(first, farthest), (farthest, last)]
    return np.array(sorted(kept))


def distance_to_segments(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Returns the distance of each point to a polyline."""
    start, along = line[:-1], np.diff(line, axis=0)
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    from_start = points[:, None] - start
    share = np.clip((from_start * along).sum(axis=2) / squared, 0, 1)
    return np.hypot(*np.moveaxis(from_start - share[..., None] * along, 2, 0)).min(axis=1)


def compact(svg: str) -> str:
    """Returns a file of matplotlib with short coordinates, one font, and without comments and unused groups."""
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<!DOCTYPE.*?>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(?<= )(d|x|y)="([^"]*)"', lambda value: f'{value[1]}="{_short(value[2])}"', svg)
    svg = re.sub(r' transform="rotate\(-0 [^"]*"| font-family: [^;"]*;|; stroke-dashoffset: 0', "", svg)
    svg = svg.replace("<svg ", f'<svg font-family="{", ".join(STYLE["font.sans-serif"])}" ', 1)
    # Only identifiers that a tool sets remain, and groups of several elements.
    svg = re.sub(r'<g id="[a-z2.]+_\d+">', "<g>", svg)
    svg = re.sub(r"<g>\s*(<(?:path|text)\b[^<]*(?:</text>)?)\s*</g>", r"\1", svg)
    return re.sub(r"\n\s*", "\n", svg)


def _short(value: str) -> str:
    """Returns coordinates with one digit after the point, a tenth of a point; a polyline has relative ones."""
    if re.fullmatch(r"M[^A-Z]*(L[^A-Za-z]*)+", value):
        tenths = np.diff(np.rint(_points(value) * 10), axis=0, prepend=0)
        return "m" + " ".join(f"{number / 10:g}" for number in tenths.flat).replace(" -", "-")
    value = re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.1f}".removesuffix(".0"), value)
    return re.sub(r"\s*([MLCQz])\s*", r"\1", value).strip()


def _points(data: str) -> np.ndarray:
    """Returns the points of a polyline's data."""
    return np.array(re.findall(r"-?[\d.]+", data), dtype=float).reshape(-1, 2)


def curves(svg: str) -> dict[str, np.ndarray]:
    """Returns the points of each curve with an identifier (`gid` of its line)."""
    found = re.findall(r'<g id="([^"]+)">\s*<path d="m([^"]*)"', svg)
    return {name: np.cumsum(_points(data), axis=0) for name, data in found}


def main() -> None:
    """Writes both files."""
    options.parser(__doc__).parse_args()
    for name in PICTURES:
        write(name, IMAGES / name)
        print(f"{IMAGES.relative_to(ROOT)}/{name}")


if __name__ == "__main__":
    main()
