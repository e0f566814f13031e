"""Part programs with which the cycle time of the profile `linuxcnc` is compared with LinuxCNC's."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable

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
    for track in range(tracks):
        ends = range(count + 1) if track % 2 == 0 else range(count, -1, -1)
        height = lambda x, y: 1.5 * math.sin(x / 4) * math.cos(y / 3)  # noqa: E731
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
        (step * k, 20 * math.sin(step * k / 12), -2 * math.cos(step * k / 9), tilt * math.sin(step * k / 15), 1.5 * step * k)
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


PROGRAMS: dict[str, tuple[str, str]] = {
    "pocket, exact stop": ("mill", "G61\n" + pocket(4, 6)),
    "pocket, G64 P0.01": ("mill", "G64 P0.01\n" + pocket(4, 6)),
    "pocket, G64": ("mill", "G64\n" + pocket(5, 5)),
    "pocket with rounded corners": ("mill", "G64 P0.02\n" + rounded_pocket(8)),
    "trochoidal slot": ("mill", "G64 P0.02\n" + trochoid(15)),
    "slots, G64 P0.05": ("mill", "G64 P0.05\n" + slots(4000)),
    "slots, exact path": ("mill", "G61\n" + slots(9000)),
    "raster 0.5 mm, F4000": ("mill", "G64 P0.01\n" + surface(0.5, 8, 4000)),
    "raster 0.2 mm, F9000": ("mill", "G64 P0.01\n" + surface(0.2, 8, 9000)),
    "raster 0.2 mm, G64": ("mill", "G64\n" + surface(0.2, 6, 6000)),
    "raster 1 mm, P0.002": ("mill", "G64 P0.002\n" + surface(1, 8, 8000)),
    "spiral of lines": ("mill", "G64 P0.01\n" + spiral(7000)),
    "spiral of lines, P0.001": ("mill", "G64 P0.001\n" + spiral(12000)),
    "drilling, G81": ("mill", drilling("G98 G81 Z-8 R1 F800")),
    "drilling, G83": ("mill", drilling("G98 G83 Z-9 R1 Q3 F900")),
    "dwell, G82": ("mill", drilling("G98 G82 Z-3 R1 P0.1 F900")),
    "polyline 10 mm": ("mill", "G64 P0.05\n" + scribble(11, 60, 10, 9000)),
    "polyline 3 mm": ("mill", "G64 P0.02\n" + scribble(12, 120, 3, 6000)),
    "polyline 1 mm": ("mill", "G64 P0.01\n" + scribble(13, 200, 1, 5000)),
    "helices": ("mill", "G64 P0.02\n" + helix()),
    "rosette of arcs": ("mill", "G64 P0.1\n" + rosette()),
    "five axes, 2 mm": ("mikron", "G64 P0.02\n" + five_axes(2, 3000, 25)),
    "five axes, 0.5 mm": ("mikron", "G64 P0.02\n" + five_axes(0.5, 3000, 25)),
    "five axes, 5 mm, G64": ("mikron", "G64\n" + five_axes(5, 6000, 40)),
    "indexed faces": ("mikron", "G64 P0.02\n" + indexed()),
}
"""Machine and text of each program by its name."""
