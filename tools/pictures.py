#!/usr/bin/env python3
"""Draws the pictures of the documentation by runs of `virtual_axes`: small SVG files with simplified curves.

    cargo build --release && source .build/env.sh
    tools/pictures.py [NAME.svg ...]      writes them in docs/images, by default all

ballbar.svg is that of README.md, which ./demo.sh draws over ROS 2, and contrast.svg that of the predictive controllers:
a tuning that is better on the circle and worse at a corner, found by `virtual_axes tune ballbar --controller gpc --also
corner-45 --contrast`. figure-*.svg belong to the figures of the paper in docs/reproduction.md.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
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

SIMULATED, SECOND, THIRD = "#2166ac", "#d95f02", "#1b7837"
"""Colors of the curves."""
UNITS = (("mm", 1e3, "µm", "m/min", 1e6), ("°", np.degrees(1.0), "mdeg", "rpm", np.degrees(1e3)))
"""Unit and factor of positions, unit of errors and velocities, factor of errors, of linear and of rotary axes."""
TRIALS = {"a": ("contour-a", "xy"), "b": ("contour-b", "xy"), "c": ("orientation-ac", "ac"), "d": ("bspline-3d", "xyz")}
"""Scenario and axes of each part of figure 8."""
RADIUS_MM = 150.0
STEADY = (1.5, 8.04)
"""Span between the ramps of the ballbar, as in the definition of the radial deviation, s."""
TUNING = {"n1": 1, "n2": 9, "nu": 8, "lambda_rel": 0.5}
SYMBOLS = {"n1": "N1", "n2": "N2", "nu": "Nu", "lambda_rel": "λ_rel"}
LEG_MM, AROUND_MM = 50.0, 2.5
"""End of the first leg of the corner, and the displayed range around the corner, mm."""


def read(scenario: str, *options: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Returns the figures of a run, and the columns of its trace by name, in m, rad and s."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace.csv"
        command = [PROGRAM, "run", scenario, *options, "--json", "--trace", path]
        output = subprocess.run(command, check=True, capture_output=True).stdout
        with path.open() as file:
            names = file.readline().strip().split(",")
            columns = np.loadtxt(file, delimiter=",", unpack=True)
    return json.loads(output)["runs"][0], dict(zip(names, columns))


def run(scenario: str, *options: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Returns the figures of a run, and its time (s), x and y (mm)."""
    figures, trace = read(scenario, *options)
    return figures, {"time": trace["time"], "x": trace["x.position"] * 1e3, "y": trace["y.position"] * 1e3}


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


def contrast(tuning: dict[str, float] = TUNING) -> Figure:
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


def friction_law() -> Figure:
    """Draws the friction law of X as printed, and currents of simulated motions at constant velocity."""
    figure, plot = plt.subplots(figsize=(7, 4.2), layout="constrained")
    speed = np.linspace(0.05, 20, 200)
    plot.plot(speed, printed_friction(speed), color=SIMULATED, label="law with the printed parameters", gid="law")
    feeds = (1, 2, 5, 10, 15, 20)
    currents = [steady_current("x-constant", "x", "--feed", str(feed)) for feed in feeds]
    plot.plot(feeds, currents, "o", color=SECOND, label="simulated current at constant velocity")
    plot.set(xlabel="velocity of X (m/min)", ylabel="current (A)", xlim=(0, 21), ylim=(0, None))
    plot.grid(alpha=0.3)
    plot.legend(loc="lower right")
    return figure


def printed_friction(speed: np.ndarray | float) -> np.ndarray | float:
    """Returns the friction current of X at a speed in m/min, A: equation 3 with the values of appendix 2."""
    return 1.576 * np.exp(0.01965 * speed) - 0.5332 * np.exp(-0.2801 * speed)


def steady_current(scenario: str, axis: str, *options: str) -> float:
    """Returns the mean current of an axis behind the middle of its motion, where its velocity is constant, A."""
    _, trace = read(scenario, "--trace-period", "1ms", *options)
    part = trace[f"{axis}.position"] / trace[f"{axis}.position"].max()
    return float(trace[f"{axis}.current"][(part > 0.5) & (part < 0.75)].mean())


def one_axis(scenario: str, axis: str) -> Figure:
    """Draws setpoint, position, following error, velocity and current of an axis over time, at the position cycles."""
    _, trace = read(scenario)
    unit, factor, small, per_minute, error_factor = UNITS[axis in "ac"]
    figure, (place, error, speed, current) = plt.subplots(4, 1, figsize=(9, 8.5), sharex=True, layout="constrained")
    setpoint, position = trace[f"{axis}.psec"] * factor, trace[f"{axis}.position"] * factor
    name = axis.upper()
    place.plot(trace["time"], setpoint, "k--", linewidth=1, label="setpoint (PSEC)")
    place.plot(trace["time"], position, color=SIMULATED, label="simulated position", gid="position")
    error.plot(trace["time"], following(trace, axis) * error_factor, color=SIMULATED, gid="error")
    minute = 60 / (2 * np.pi) if axis in "ac" else 60
    speed.plot(trace["time"], trace[f"{axis}.velocity"] * minute, color=SIMULATED, gid="velocity")
    current.plot(trace["time"], trace[f"{axis}.current"], color=SIMULATED, gid="current")
    place.set(ylabel=f"{name} ({unit})")
    place.legend(loc="lower right")
    error.set(ylabel=f"delay-compensated\nfollowing error ({small})")
    speed.set(ylabel=f"velocity ({per_minute})")
    current.set(ylabel="current (A)", xlabel="time (s)")
    for plot in (place, error, speed, current):
        plot.grid(alpha=0.3)
    return figure


def following(trace: dict[str, np.ndarray], axis: str) -> np.ndarray:
    """Returns the delay-compensated following error, m or rad: α of 9 ms acts after two position cycles of 6 ms."""
    setpoint = trace[f"{axis}.psec"]
    return np.concatenate([np.full(2, setpoint[0]), setpoint[:-2]]) - trace[f"{axis}.position"]


def several_axes(scenario: str, axes: str) -> Figure:
    """Draws path and delay-compensated following errors of axes of the same kind; the path in the first two."""
    figure, (path, error) = plt.subplots(1, 2, figsize=(10.5, 4), layout="constrained", width_ratios=(1, 1.5))
    _, trace = read(scenario)
    unit, factor, small, _, error_factor = UNITS[axes == "ac"]
    first, second = ([trace[f"{axis}.{signal}"] * factor for axis in axes[:2]] for signal in ("psec", "position"))
    path.plot(*first, "k--", linewidth=1, label="setpoint (PSEC)")
    path.plot(*second, color=SIMULATED, label="simulated position", gid="path")
    for axis, color in zip(axes, (SIMULATED, SECOND, THIRD)):
        values = following(trace, axis) * error_factor
        error.plot(trace["time"], values, color=color, label=axis.upper(), linewidth=1, gid=f"error-{axis}")
    path.set(xlabel=f"{axes[0].upper()} ({unit})", ylabel=f"{axes[1].upper()} ({unit})")
    path.set_aspect("equal", adjustable="datalim")
    path.legend(loc="upper right", fontsize=8)
    error.set(ylabel=f"delay-compensated following error ({small})", xlabel="time (s)")
    error.legend(loc="upper right", ncols=3, fontsize=8)
    for plot in (path, error):
        plot.grid(alpha=0.3)
    return figure


def corners() -> Figure:
    """Draws both corners with the cascade and with both tunings of predictive control."""
    figure, plots = plt.subplots(1, 2, figsize=(11, 5.2))
    for plot, turn in zip(plots, (45, 90)):
        end = (LEG_MM + LEG_MM * np.cos(np.radians(turn)), LEG_MM * np.sin(np.radians(turn)))
        plot.plot([0, LEG_MM, end[0]], [0, 0, end[1]], "k--", linewidth=0.8, label="path")
        runs = [("cascade", "cascade with feedforward", SIMULATED, [])]
        for (weight, name), color in zip((("1e-3", "10⁻³"), ("1e-2", "10⁻²")), (SECOND, THIRD)):
            runs.append((f"gpc-{weight}", f"GPC 1, 8, 6, λ_rel {name}", color, predictive(weight)))
        for part, name, color, changes in runs:
            _, trace = run(f"corner-{turn}", "--trace-period", "1ms", *changes)
            near = np.hypot(trace["x"] - LEG_MM, trace["y"]) < 1.2
            plot.plot(trace["x"][near], trace["y"][near], color=color, label=name, gid=f"{part}-{turn}")
        plot.set(xlabel="X (mm)", ylabel="Y (mm)", title=f"corner of {turn}°, 10 m/min", aspect="equal")
        plot.set(xlim=(LEG_MM - 0.5, LEG_MM + 0.5), ylim=(-0.25, 0.5))
        plot.grid(alpha=0.3)
    figure.tight_layout(rect=(0, 0.08, 1, 1))
    figure.legend(*plots[0].get_legend_handles_labels(), loc="lower center", ncols=4)
    return figure


def predictive(weight: str) -> list[str]:
    """Returns options for predictive control of X and Y with N1, N2, Nu = 1, 8, 6 and a weight λ_rel."""
    tuning = {"controller": "gpc", "gpc.n2": 8, "gpc.nu": 6, "gpc.lambda_rel": weight}
    return [f"--set={axis}.position_loop.{name}={value}" for axis in "xy" for name, value in tuning.items()]


def circles() -> Figure:
    """Draws the radial deviation of the cascade with feedforward and of predictive control over time."""
    figure, plot = plt.subplots(figsize=(9, 4.6), layout="constrained")
    runs = (
        ("cascade", "cascade with feedforward (left in the paper)", SIMULATED, []),
        ("gpc", "GPC 1, 8, 6, λ_rel 10⁻³ (right in the paper)", SECOND, predictive("1e-3")),
    )
    for part, name, color, changes in runs:
        _, trace = ballbar("--trace-period", "2ms", *changes)
        plot.plot(np.degrees(trace["angle"] - trace["angle"][0]), trace["deviation"], color=color, label=name, gid=part)
    plot.set(xlabel="polar angle over both turns (°)", ylabel="radial deviation (µm)")
    plot.grid(alpha=0.3)
    plot.legend(loc="center right")
    return figure


PICTURES: dict[str, tuple[Callable[[], Figure], str]] = {
    "ballbar.svg": (ballbars, "Ballbar: radial deviation over the polar angle"),
    "contrast.svg": (contrast, "Radial deviation on a circle and position at a corner, of two controllers"),
    "figure-5.svg": (friction_law, "Friction law of X, and simulated currents at constant velocity"),
    "figure-6.svg": (partial(one_axis, "x-constant", "x"), "X at 10 m/min: position, error, velocity and current"),
    "figure-7.svg": (
        partial(one_axis, "c-two-speeds", "c"),
        "C at two velocities: position, error, velocity and current",
    ),
    **{
        f"figure-8-{letter}.svg": (
            partial(several_axes, scenario, axes),
            f"Path of {scenario}, and its following errors",
        )
        for letter, (scenario, axes) in TRIALS.items()
    },
    "figure-10.svg": (circles, "Radial deviation of the cascade and of predictive control on a circle"),
    "figure-11.svg": (corners, "Positions at sharp corners with the cascade and predictive control"),
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
    """Writes the files."""
    parser = options.parser(__doc__)
    parser.add_argument("names", metavar="NAME.svg", nargs="*", help="files, by default all")
    names = parser.parse_args().names or [*PICTURES]
    if unknown := set(names) - set(PICTURES):
        parser.error(f"{', '.join(unknown)}: unknown; known are {', '.join(PICTURES)}")
    for name in names:
        write(name, IMAGES / name)
        print(f"{IMAGES.relative_to(ROOT)}/{name}")


if __name__ == "__main__":
    main()
