"""Part programs with which the cycle time of the profile `linuxcnc` is compared with LinuxCNC's.

    python linuxcnc_programs.py        # executes them in LinuxCNC, and writes their times to linuxcnc_times.json

The component `virtual_axes` must be installed (docs/how-to/linuxcnc.md). LinuxCNC runs in real time: leave the machine
idle.
"""

from __future__ import annotations

import json
import math
import random
import tempfile
from collections.abc import Iterable
from pathlib import Path

TIMES = Path(__file__).with_name("linuxcnc_times.json")

Point = Iterable[float]


def lines(letters: str, points: Iterable[Point]) -> str:
    """Returns a line of the program for each point."""
    words = ("".join(f" {letter}{value:.4f}" for letter, value in zip(letters, point, strict=True)) for point in points)
    return "\n".join(f"G1{line}" for line in words)


def pocket(pitch: float, rounds: int) -> str:
    """Returns a rectangular pocket from the inside to the outside."""
    text = ["G0 X60 Y40 Z2", "G1 Z-1 F600", "F3000"]
    for index in range(1, rounds + 1):
        reach = pitch * index
        text += [f"X{60 + reach} Y{40 - reach}", f"Y{40 + reach}", f"X{60 - reach}", f"Y{40 - reach}", f"X{60 + reach}"]
    return "\n".join([*text, "G0 Z5"])


def rounded_pocket(rounds: int) -> str:
    """Returns a pocket with arcs in its corners."""
    text = ["G0 X50 Y50", "G0 Z1", "G1 Z-1 F900", "F4500"]
    for index in range(1, rounds + 1):
        a, r = 3 * index, 1.5
        text += [
            f"G1 X{50 + a - r} Y{50 - a}",
            f"G3 X{50 + a} Y{50 - a + r} I0 J{r}",
            f"G1 Y{50 + a - r}",
            f"G3 X{50 + a - r} Y{50 + a} I{-r} J0",
            f"G1 X{50 - a + r}",
            f"G3 X{50 - a} Y{50 + a - r} I0 J{-r}",
            f"G1 Y{50 - a + r}",
            f"G3 X{50 - a + r} Y{50 - a} I{r} J0",
            f"G1 X{50 + a - r}",
        ]
    return "\n".join([*text, "G0 Z5"])


def trochoid(turns: int) -> str:
    """Returns a slot in circles that advance."""
    text = ["G0 X10 Y20", "G0 Z1", "G1 Z-2 F500", "F5000"]
    for index in range(turns):
        text += [f"G1 X{10 + index}", "G3 I0 J-4"]
    return "\n".join([*text, "G0 Z5"])


def surface(step: float, tracks: int, feed: float) -> str:
    """Returns a raster over a waved surface, back and forth."""
    text = [f"G0 X0 Y0 Z5\nG1 Z1 F1000\nF{feed}"]
    count = round(40 / step)

    def height(x: float, y: float) -> float:
        return 1.5 * math.sin(x / 4) * math.cos(y / 3)

    for track in range(tracks):
        ends = range(count + 1) if track % 2 == 0 else range(count, -1, -1)
        text.append(lines("XYZ", ((k * step, track * 0.7, height(k * step, track * 0.7)) for k in ends)))
    return "\n".join([*text, "G0 Z5"])


def spiral(feed: float) -> str:
    """Returns a spiral of short lines."""
    points = ((50 + 0.2 * k / 6 * math.cos(k / 6), 50 + 0.2 * k / 6 * math.sin(k / 6)) for k in range(360))
    return f"G0 X50 Y50\nG1 F{feed}\n{lines('XY', points)}"


def drilling(code: str) -> str:
    """Returns a pattern of holes."""
    holes = "\n".join(f"X{10 + 12 * (k % 4)} Y{10 + 9 * (k // 4)}" for k in range(12))
    return f"G0 X10 Y10 Z5\n{code}\n{holes}\nG80\nG0 Z20"


def scribble(seed: int, count: int, length: float, feed: float) -> str:
    """Returns a polyline with random directions."""
    draw = random.Random(seed)
    x, y, heading, points = 60.0, 60.0, 0.0, []
    for _ in range(count):
        heading += draw.uniform(-1.6, 1.6)
        step = length * draw.uniform(0.4, 1.6)
        x, y = x + step * math.cos(heading), y + step * math.sin(heading)
        points.append((x, y))
    return f"G0 X60 Y60\nG1 F{feed}\n{lines('XY', points)}"


def slots(feed: float) -> str:
    """Returns slots with half circles at their ends."""
    text = ["G0 X20 Y20", f"G1 F{feed}"]
    for index in range(5):
        y = 20 + 12 * index
        text += [
            f"G0 X20 Y{y} Z2",
            "G1 Z-1",
            "X60",
            f"G3 Y{y + 6} J3",
            "G1 X20",
            f"G3 Y{y} J-3",
            "G1 X30",
            "G0 Z2",
        ]
    return "\n".join(text)


def helix() -> str:
    """Returns helical plunges."""
    text = ["G0 X30 Y30 Z1", "G1 F2500"]
    for index in range(4):
        text += [f"G0 X{30 + 20 * index} Y30", "G1 Z0", *(f"G3 I-5 J0 Z{-1 - k}" for k in range(4)), "G1 Z1"]
    return "\n".join(text)


def five_axes(step: float, feed: float, tilt: float) -> str:
    """Returns a swarf of short lines with both rotary axes."""
    points = (
        (
            step * k,
            20 * math.sin(step * k / 12),
            -2 * math.cos(step * k / 9),
            tilt * math.sin(step * k / 15),
            1.5 * step * k,
        )
        for k in range(round(50 / step))
    )
    return f"G0 X0 Y0 Z0 A0 C0\nG1 F{feed}\n{lines('XYZAC', points)}"


def indexed() -> str:
    """Returns faces that are milled at several positions of the rotary axes."""
    text = []
    for index in range(4):
        text += [
            f"G0 Z40\nG0 A{15 * index} C{40 * index}\nG0 X10 Y10\nG1 Z0 F3000",
            "X50 F4000\nY25\nX10\nY10\nG2 I8 J6\nG0 Z40",
        ]
    return "\n".join(text)


def rosette() -> str:
    """Returns arcs with corners between them."""
    text = ["G0 X50 Y20", "G1 F6000"]
    for index in range(8):
        a = math.radians(45 * index + 45)
        text.append(f"G3 X{50 + 30 * math.sin(a):.4f} Y{50 - 30 * math.cos(a):.4f} R14")
    return "\n".join(text)


def changing_feeds() -> str:
    """Returns nearly straight lines, some of which are slow."""
    feeds = [6000, 600, 6000, 1500, 3000, 300]
    points = [(20 + 1.1 * k, 30 + 0.03 * (-1) ** k) for k in range(60)]
    return "\n".join(
        ["G0 X2 Y30", "G1 X20 F3000", *(f"G1 X{x:.4f} Y{y:.4f} F{feeds[k % 6]}" for k, (x, y) in enumerate(points))]
    )


def inclined_edges() -> str:
    """Returns edges with both rotary axes, with plunges and retracts in X, Y and Z alone."""
    text = ["G0 X0 Y0 Z5"]
    for index in range(6):
        text += [f"G1 Z-1 F{500 + 100 * index}", f"X{12 + index} Y{3 * index} A{4 * index} C{15 * index + 6} F2500"]
        text += [f"G1 Z{1 + 0.2 * index:.1f} F800", f"X{index} Y{2 * index}"]
    return "\n".join(text)


PROGRAMS: dict[str, tuple[str, str]] = {
    "pocket, exact stop": ("mill", "G61\n" + pocket(3, 7)),
    "pocket, G64 P0.03": ("mill", "G64 P0.03\n" + pocket(2.5, 8)),
    "pocket, G64": ("mill", "G64\n" + pocket(6, 4)),
    "pocket with rounded corners": ("mill", "G64 P0.005\n" + rounded_pocket(6)),
    "trochoidal slot": ("mill", "G64 P0.1\n" + trochoid(10)),
    "slots, G64 P0.02": ("mill", "G64 P0.02\n" + slots(7000)),
    "slots, exact path": ("mill", "G61\n" + slots(5000)),
    "raster 0.4 mm, F5000": ("mill", "G64 P0.02\n" + surface(0.4, 7, 5000)),
    "raster 0.25 mm, F10000": ("mill", "G64 P0.005\n" + surface(0.25, 6, 10000)),
    "raster 0.5 mm, G64": ("mill", "G64\n" + surface(0.5, 6, 7000)),
    "raster 1.6 mm, P0.003": ("mill", "G64 P0.003\n" + surface(1.6, 8, 6000)),
    "spiral of lines": ("mill", "G64 P0.02\n" + spiral(9000)),
    "spiral of lines, P0.002": ("mill", "G64 P0.002\n" + spiral(8000)),
    "drilling, G81": ("mill", drilling("G98 G81 Z-6 R2 F1000")),
    "drilling, G83": ("mill", drilling("G98 G83 Z-8 R1 Q2 F1200")),
    "dwell, G82": ("mill", drilling("G98 G82 Z-4 R1 P0.2 F1100")),
    "polyline 8 mm": ("mill", "G64 P0.03\n" + scribble(101, 60, 8, 10000)),
    "polyline 2 mm": ("mill", "G64 P0.01\n" + scribble(102, 120, 2, 7000)),
    "polyline 0.7 mm": ("mill", "G64 P0.02\n" + scribble(103, 200, 0.7, 4000)),
    "lines with changing feeds": ("mill", "G64 P0.01\n" + changing_feeds()),
    "helices": ("mill", "G64 P0.05\n" + helix()),
    "rosette of arcs": ("mill", "G64 P0.02\n" + rosette()),
    "five axes, 3 mm": ("mikron", "G64 P0.01\n" + five_axes(3, 4000, 20)),
    "five axes, 0.8 mm": ("mikron", "G64 P0.05\n" + five_axes(0.8, 2500, 30)),
    "five axes, 4 mm, G64": ("mikron", "G64\n" + five_axes(4, 5000, 35)),
    "indexed faces": ("mikron", "G64 P0.05\n" + indexed()),
    "inclined edges": ("mikron", "G64 P0.02\n" + inclined_edges()),
}
"""Machine and text of each program by its name."""


def measured_time(machine: str, text: str) -> float:
    """Returns the time from the first to the last motion of a program in LinuxCNC, s."""
    from test_linuxcnc import completed

    changes = {"FERROR": "9999", "MIN_FERROR": "9999", "MIN_LIMIT": "-9999", "MAX_LIMIT": "9999"}
    if machine == "mikron":
        changes["KINEMATICS"] = "trivkins coordinates=XYZAC"
    with tempfile.TemporaryDirectory() as folder:
        # A standing axis can change by a rounding error.
        rows = [[round(at, 9) for at in row[::2]] for row in completed(Path(folder), machine, changes, [text]).rows()]
    moved = [index for index in range(1, len(rows)) if rows[index] != rows[index - 1]]
    return round(1e-3 * (moved[-1] - moved[0] + 1), 3)


def main() -> None:
    """Writes the times of all programs."""
    times = {name: measured_time(machine, text) for name, (machine, text) in PROGRAMS.items()}
    TIMES.write_text(json.dumps(times, indent=2) + "\n")


if __name__ == "__main__":
    main()
