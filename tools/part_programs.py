#!/usr/bin/env python3
"""Generates part programs of many short lines: a finishing raster, and a five-axis path along an S.

    tools/part_programs.py                                   fails if a generated file in config/programs differs
    tools/part_programs.py --write                           writes these files
    tools/part_programs.py --raster 150000 > raster.nc       raster of at least that many motions

The raster follows the surface z = 0.8 mm sin(2 pi x / 20 mm) cos(2 pi y / 26 mm) in passes of 24 mm, 0.3 mm apart. As
in CAM, lines are as long as the chord error of 0.01 um allows, 50 um at most, and coordinates have 4 decimals.

The S has two arcs of 270 degrees with a radius of 30 mm. The tool leans to the left of the path, by 15 degrees with a
wave of 10 degrees. The program controls the tool center point (G43.4), for machines with the tables A and C.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from math import cos, degrees, pi, sin, sqrt
from pathlib import Path

import options

FOLDER = Path(__file__).resolve().parent.parent / "config" / "programs"
SEGMENTS = 12_000
SPACING = 0.5

HEIGHT, WAVE_X, WAVE_Y = 0.8, 2 * pi / 20, 2 * pi / 26
PASS, STEP_OVER = 24.0, 0.3
CHORD_ERROR, LONGEST, SHORTEST = 1e-5, 0.05, 0.003
RASTER_FEED = 3000

RADIUS, ARC = 30.0, 3 * pi / 2
TILT, TILT_WAVE = 15.0, 10.0
S_FEED = 2000


def raster_points(segments: int) -> Iterator[tuple[float, float]]:
    """Yields x and y along the passes, in alternating directions; the lines between passes are short too."""
    count, pass_index = 0, 0
    while count < segments:
        y = pass_index * STEP_OVER
        position = 0.0
        while True:
            yield (position if pass_index % 2 == 0 else PASS - position), y
            count += 1
            if position == PASS:
                break
            x = position if pass_index % 2 == 0 else PASS - position
            slope = HEIGHT * WAVE_X * cos(WAVE_X * x) * cos(WAVE_Y * y)
            curvature = abs(HEIGHT * WAVE_X**2 * sin(WAVE_X * x) * cos(WAVE_Y * y)) / (1 + slope**2) ** 1.5
            chord = sqrt(8 * CHORD_ERROR / max(curvature, 1e-12))
            length = min(max(chord, SHORTEST), LONGEST)
            step, left = length / sqrt(1 + slope**2), PASS - position
            if step < left < step + SHORTEST:
                step = left / 2
            position = min(position + step, PASS)
        for step in range(1, 10):
            yield (PASS if pass_index % 2 == 0 else 0.0), y + STEP_OVER * step / 10
            count += 1
        pass_index += 1


def raster(segments: int) -> Iterator[str]:
    """Yields the lines of a finishing raster; unchanged coordinates are omitted."""
    yield from ("%", "(3D finishing raster of short lines: tools/part_programs.py)")
    yield from ("G21 G17 G90 G94 G40 G49 G80 G54", "T1 M6", "G43 H1", "S12000 M3")
    yield from ("G64 P0.005", "G0 X0 Y0 Z10", f"G1 Z1 F{RASTER_FEED}")
    last = ("", "", "")
    for x, y in raster_points(segments):
        z = HEIGHT * sin(WAVE_X * x) * cos(WAVE_Y * y)
        words = tuple(f"{letter}{value + 0.0:.4f}" for letter, value in zip("XYZ", (x, y, z), strict=True))
        line = "".join(word for word, before in zip(words, last, strict=True) if word != before)
        if line:
            yield line
        last = words
    yield from ("G0 Z10", "M5", "G49", "G53 G0 Z0", "M30", "%")


def s_point(length: float) -> tuple[float, float, float, float]:
    """Returns x, y in mm and the angles a, c in degrees at a length along the S in mm."""
    half = RADIUS * ARC
    heading = pi / 2 + min(length, 2 * half - length) / RADIUS
    if length <= half:
        angle = length / RADIUS
        x, y = RADIUS * cos(angle), RADIUS * (1 + sin(angle))
    else:
        angle = pi / 2 - (length - half) / RADIUS
        x, y = RADIUS * cos(angle), RADIUS * (sin(angle) - 1)
    return x, y, TILT + TILT_WAVE * sin(pi * length / half), degrees(heading) + 180


def s_path(spacing: float) -> Iterator[str]:
    """Yields the lines of the S-shaped path."""
    total = 2 * RADIUS * ARC
    count = max(round(total / spacing), 1)
    yield from ("%", "(S-shaped five-axis path with tool center point control: tools/part_programs.py)")
    yield from ("G21 G17 G90 G94 G40 G49 G80 G54", "T1 M6", "S10000 M3", "G64 P0.01")
    x, y, a, c = s_point(0.0)
    yield from (f"G0 A{a:.4f} C{c:.4f}", "G43.4 H1", f"G0 X{x:.4f} Y{y:.4f} Z20", f"G1 Z0 F{S_FEED}")
    for index in range(1, count + 1):
        x, y, a, c = s_point(total * index / count)
        yield f"X{x + 0.0:.4f} Y{y + 0.0:.4f} A{a:.4f} C{c:.4f}"
    yield from ("G0 Z20", "G49", "M5", "G53 G0 Z0", "G0 A0 C0", "M30", "%")


def text(lines: Iterator[str]) -> str:
    """Returns a program as text."""
    return "".join(f"{line}\n" for line in lines)


def main() -> int:
    """Prints a program, or writes or compares the files."""
    parser = options.parser(__doc__)
    parser.add_argument("--write", action="store_true", help="writes the files in config/programs")
    parser.add_argument("--raster", type=options.whole, metavar="MOTIONS", help="prints a raster")
    args = parser.parse_args()
    if args.raster:
        print(text(raster(args.raster)), end="")
        return 0
    status = 0
    for name, lines in (
        ("finishing-raster", raster(SEGMENTS)),
        ("s-path-five-axis", s_path(SPACING)),
    ):
        file, content = FOLDER / f"{name}.nc", text(lines)
        if args.write:
            file.write_text(content)
        elif file.read_text() != content:
            print(f"part_programs: {file} differs from the generator", file=sys.stderr)
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
