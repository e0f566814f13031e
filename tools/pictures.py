"""Small pictures for the documentation: runs of `virtual_axes`, and SVG files with simplified curves."""

from __future__ import annotations

import json
import os
import re
import subprocess
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend is chosen before)
import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
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


def save(figure: Figure, path: Path, title: str, tolerance: float = TOLERANCE) -> None:
    """Writes an SVG file with a white background, with curves simplified to the tolerance."""
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


def extremes(values: np.ndarray, count: int) -> np.ndarray:
    """Returns indices of the first and last value, and of minimum and maximum of each group of `count` values."""
    groups = (slice(first, first + count) for first in range(0, len(values), count))
    found = {group.start + int(end(values[group])) for group in groups for end in (np.argmin, np.argmax)}
    return np.array(sorted(found | {0, len(values) - 1}))


def curves(svg: str) -> dict[str, np.ndarray]:
    """Returns the points of each curve with an identifier (`gid` of its line)."""
    found = re.findall(r'<g id="([^"]+)">\s*<path d="m([^"]*)"', svg)
    return {name: np.cumsum(_points(data), axis=0) for name, data in found}
