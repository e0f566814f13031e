"""Cases of the comparison: setpoints of each, and the default machine's axes in SI units.

Setpoints are written as text for all contenders: names of the axes, then a row per position cycle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

TABLE = Path(__file__).with_name("mikron_ucp710.txt")
"""Table of the default machine, a row per quantity."""

POSITION_PERIOD = 6e-3
"""Tsp, s."""
M_MIN = 1.0 / 60.0
"""One meter per minute, m/s."""
SWEEP_MACHINES = 256
"""Machines of the sweep; their gains differ."""


@dataclass(frozen=True)
class Case:
    """A comparison: moving axes and duration."""

    name: str
    joints: tuple[str, ...]
    duration: float
    psec: Callable[[float], tuple[float, ...]]
    circle: tuple[float, float, float] | None = None
    """Radius (m), and the window (s) in which the radial deviation is taken."""
    machines: int = 1

    def arguments(self) -> list[str]:
        """Returns the arguments of the programs beside the setpoints."""
        words: list[str] = []
        if self.circle is not None:
            radius, first, last = self.circle
            window = [str(math.ceil(t / POSITION_PERIOD - 1e-9)) for t in (first, last)]
            words += ["--circle", repr(radius), *window]
        if self.machines > 1:
            words += ["--machines", str(self.machines)]
        return words

    def periods(self) -> int:
        """Returns the number of position cycles."""
        return math.ceil(self.duration / POSITION_PERIOD - 1e-9)

    def simulated_seconds(self) -> float:
        """Returns the machine-seconds of one run."""
        return self.periods() * POSITION_PERIOD * self.machines

    def write(self, folder: Path) -> Path:
        """Writes the setpoints; returns their path."""
        path = folder / f"{self.name}.txt"
        rows = (self.psec(k * POSITION_PERIOD) for k in range(self.periods()))
        lines = [" ".join(self.joints), *(" ".join(map(repr, row)) for row in rows)]
        path.write_text("\n".join(lines) + "\n")
        return path


def line(length: float, velocity: float, acceleration: float, jerk: float) -> tuple[float, Callable[[float], float]]:
    """Returns duration (s) and position (m) over time (s) of a jerk-limited motion from rest to rest."""
    t_jerk = acceleration / jerk
    t_even = velocity / acceleration - t_jerk
    ramp = 2 * t_jerk + t_even
    duration = length / velocity + ramp

    def ramped(t: float) -> float:
        first = min(t, t_jerk)
        second = min(max(t - t_jerk, 0.0), t_even)
        third = max(t - t_jerk - t_even, 0.0)
        way = jerk * first**3 / 6
        speed = jerk * first**2 / 2
        way += speed * second + acceleration * second**2 / 2
        speed += acceleration * second
        return way + speed * third + acceleration * third**2 / 2 - jerk * third**3 / 6

    def way(t: float) -> float:
        if t < ramp:
            return ramped(max(t, 0.0))
        if t < duration - ramp:
            return ramped(ramp) + velocity * (t - ramp)
        return length - ramped(max(duration - t, 0.0))

    return duration, way


def single_axis() -> Case:
    """Returns X over 200 mm at 10 m/min, rest to rest, 2.5 m/s², 50 m/s³, and half a second of rest."""
    duration, way = line(0.200, 10 * M_MIN, 2.5, 50.0)
    return Case("single-axis", ("x",), duration + 0.5, lambda t: (way(t),))


@dataclass(frozen=True)
class Shuttle:
    """Moves there and back, each rest to rest with a velocity v/2 (1 - cos)."""

    length: float
    time: float
    moves: int

    def at(self, t: float) -> float:
        """Returns the position at a time."""
        done = min(int(t / self.time), self.moves)
        start = self.length * (done % 2)
        if done == self.moves:
            return start
        tau = t / self.time - done
        way = self.length * (tau - math.sin(2 * math.pi * tau) / (2 * math.pi))
        return start + (way if done % 2 == 0 else -way)


def five_axis() -> Case:
    """Returns simultaneous reciprocating motions of all five axes for 10 s, each with its own period."""
    shuttles = (
        Shuttle(0.300, 1.9, 5),
        Shuttle(0.250, 1.35, 7),
        Shuttle(0.200, 1.05, 9),
        Shuttle(math.radians(90), 3.1, 3),
        Shuttle(math.radians(270), 4.7, 2),
    )
    return Case("five-axis", ("x", "y", "z", "a", "c"), 10.0, lambda t: tuple(s.at(t) for s in shuttles))


def sweep() -> Case:
    """Returns the ballbar of the model's page on many X-Y machines: 150 mm at 15 m/min, two turns, cosine ramps."""
    radius, velocity, rest, ramp, turns = 0.150, 15 * M_MIN, 0.5, 0.5, 2
    steady = turns * 2 * math.pi * radius / velocity
    moving = 2 * ramp + steady

    def ramped(t: float) -> float:
        return velocity / 2 * (t - ramp / math.pi * math.sin(math.pi * t / ramp))

    def psec(t: float) -> tuple[float, float]:
        t = min(max(t - rest, 0.0), moving)
        if t < ramp:
            way = ramped(t)
        elif t < ramp + steady:
            way = velocity * (t - ramp / 2)
        else:
            way = velocity * (ramp + steady) - ramped(moving - t)
        angle = way / radius
        return radius * (math.cos(angle) - 1), radius * math.sin(angle)

    window = (rest + ramp + 0.5, rest + ramp + steady - 0.5)
    return Case("sweep", ("x", "y"), 2 * rest + moving, psec, (radius, *window), SWEEP_MACHINES)


CASES = {case.name: case for case in (single_axis(), five_axis(), sweep())}
"""Cases by name."""


def read_setpoints(path: Path) -> tuple[list[str], list[list[float]]]:
    """Returns names of the axes, and setpoints by axis."""
    first, *rows = path.read_text().splitlines()
    columns = zip(*([float(word) for word in row.split()] for row in rows))
    return first.split(), [list(column) for column in columns]
