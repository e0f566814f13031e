#!/usr/bin/env python3
"""Generates part programs of many short lines: a finishing raster, and a five-axis path along an S.

    tools/part_programs.py                                   fails if a generated file in config/programs differs
    tools/part_programs.py --write                           writes these files
    tools/part_programs.py --raster 150000 > raster.nc       raster of at least that many motions
    tools/part_programs.py --s-path 0.1 > s.nc               S with points every 0.1 mm
    tools/part_programs.py --measure                         time and memory of `virtual_axes` on rasters: Markdown

The raster follows the surface z = 0.8 mm sin(2 pi x / 20 mm) cos(2 pi y / 26 mm) in passes of 24 mm, 0.3 mm apart. As
in CAM, lines are as long as the chord error of 0.01 um allows, 50 um at most, and coordinates have 4 decimals.

The S has two arcs of 270 degrees with a radius of 30 mm. The tool leans to the left of the path, by 15 degrees with a
wave of 10 degrees. The program controls the tool center point (G43.4), for machines with the tables A and C.

The measurement executes `virtual_axes run`, `check` and `psec` of `cargo build --release` on rasters of 37 500, 75 000
and 150 000 motions: elapsed time, and processor time, which other load changes less. Segments per minute and relative
time are of the processor time; the latter is that per segment, divided by that of the shortest raster.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from math import cos, degrees, pi, sin, sqrt
from pathlib import Path

import options

CHECKOUT = Path(__file__).resolve().parent.parent
FOLDER = CHECKOUT / "config" / "programs"
COMMITTED_SEGMENTS = 12_000
COMMITTED_SPACING = 0.5

HEIGHT, WAVE_X, WAVE_Y = 0.8, 2 * pi / 20, 2 * pi / 26
PASS, STEP_OVER = 24.0, 0.3
CHORD_ERROR, LONGEST, SHORTEST = 1e-5, 0.05, 0.003
RASTER_FEED = 3000

RADIUS, ARC = 30.0, 3 * pi / 2
TILT, TILT_WAVE = 15.0, 10.0
S_FEED = 2000

MEASURED_SEGMENTS = (37_500, 75_000, 150_000)
TIMEOUT = 1800


def arguments() -> argparse.Namespace:
    """Reads the command line."""
    parser = options.parser(__doc__)
    parser.add_argument("--write", action="store_true", help="writes the files in config/programs")
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument("--raster", type=options.whole, metavar="MOTIONS", help="prints a raster")
    choice.add_argument("--s-path", type=options.positive, metavar="MM", help="prints an S with this spacing")
    choice.add_argument("--measure", action="store_true", help="prints time and memory on rasters")
    return parser.parse_args()


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
    first = True
    for index in range(count + 1):
        x, y, a, c = s_point(total * index / count)
        if first:
            yield from (f"G0 A{a:.4f} C{c:.4f}", "G43.4 H1", f"G0 X{x:.4f} Y{y:.4f} Z20", f"G1 Z0 F{S_FEED}")
            first = False
        else:
            yield f"X{x + 0.0:.4f} Y{y + 0.0:.4f} A{a:.4f} C{c:.4f}"
    yield from ("G0 Z20", "G49", "M5", "G53 G0 Z0", "G0 A0 C0", "M30", "%")


def text(lines: Iterator[str]) -> str:
    """Returns a program as text."""
    return "".join(f"{line}\n" for line in lines)


def measured(command: list[str]) -> tuple[float, float, float]:
    """Runs a command without output; returns elapsed and processor time in s and the largest resident memory in MiB."""
    began = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        while True:
            identifier, status, usage = os.wait4(process.pid, os.WNOHANG)
            seconds = time.monotonic() - began
            if identifier:
                break
            if seconds > TIMEOUT:
                process.kill()
            time.sleep(0.02)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise subprocess.CalledProcessError(process.returncode, command)
    return seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def measure() -> None:
    """Prints a table of times and memory of the commands on rasters."""
    binary = CHECKOUT / "target" / "release" / "virtual_axes"
    print("| command | segments | elapsed (s) | processor (s) | segments per minute | relative time | memory (MiB) |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        programs = []
        for segments in MEASURED_SEGMENTS:
            program = Path(folder) / f"raster-{segments}.nc"
            program.write_text(text(raster(segments)))
            programs.append((program, sum(1 for _ in raster_points(segments))))
        for name in ("run", "check", "psec"):
            out = ["--out", f"{folder}/setpoints.csv"] if name == "psec" else []
            first = None
            for program, segments in programs:
                elapsed, used, memory = measured([str(binary), name, str(program), *out])
                first = first or used / segments
                print(
                    f"| `{name}` | {segments} | {elapsed:.1f} | {used:.1f} | {segments / used * 60e-6:.1f} million "
                    f"| {used / segments / first:.2f} | {memory:.0f} |",
                    flush=True,
                )


def main() -> int:
    """Prints a program or measurements, or writes or compares the files."""
    args = arguments()
    if args.measure:
        measure()
        return 0
    if args.raster or args.s_path:
        for line in raster(args.raster) if args.raster else s_path(args.s_path):
            print(line)
        return 0
    files = {
        "finishing-raster.nc": text(raster(COMMITTED_SEGMENTS)),
        "s-path-five-axis.nc": text(s_path(COMMITTED_SPACING)),
    }
    differing = [name for name, content in files.items() if not args.write and (FOLDER / name).read_text() != content]
    for name, content in files.items() if args.write else ():
        (FOLDER / name).write_text(content)
    for name in differing:
        print(f"part_programs: config/programs/{name} differs from the generator", file=sys.stderr)
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
