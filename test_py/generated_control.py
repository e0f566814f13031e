"""Controls with known parameters, which make setpoints of simple part programs.

They are written apart from the planner of the package, to judge what is identified from their setpoints: speeds by a
pass forward and one backward over all motions, filters as moving averages of finely sampled positions.
"""

from __future__ import annotations

import math
import random
import re
from dataclasses import dataclass, field

import numpy as np

FINE = 5
"""Steps of the raw positions in a sampling period."""
SMOOTHINGS = ("trapezoid", "jerk", "one filter", "two filters")
CORNERS = ("arc", "stop", "velocity_step", "deviation")


@dataclass
class Control:
    """Parameters of a control, in m and s."""

    period: float
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray | None
    filters: list[float]
    corners: str
    corner_velocity: float
    corner_tolerance: float
    normal_fraction: float
    tangential_fraction: float
    block_cycle: float
    look_ahead: int
    wait: float

    @classmethod
    def drawn(cls, seed: int) -> Control:
        """Draws a control; the kinds of smoothing and of corners take turns."""
        draw = random.Random(seed)
        smoothing, corners = SMOOTHINGS[seed % 4], CORNERS[seed // 4 % 4]
        acceleration = np.array([draw.uniform(1.5, 6) for _ in range(3)])
        first = draw.uniform(0.02, 0.06)
        filters = {"one filter": [first], "two filters": [first, first * draw.uniform(0.3, 0.85)]}
        return cls(
            period=draw.choice([0.001, 0.002]),
            velocity=np.array([draw.uniform(15, 40) / 60 for _ in range(3)]),
            acceleration=acceleration,
            jerk=acceleration / np.array([draw.uniform(0.02, 0.06) for _ in range(3)]) if smoothing == "jerk" else None,
            filters=filters.get(smoothing, []),
            corners=corners,
            corner_velocity=draw.uniform(0.3, 2) / 60,
            corner_tolerance=draw.uniform(0.05, 0.4) * 1e-3,
            normal_fraction=draw.uniform(0.5, 1),
            tangential_fraction=draw.uniform(0.4, 1),
            block_cycle=draw.uniform(0.5, 6) * 1e-3,
            look_ahead=draw.randint(30, 150),
            wait=draw.uniform(0, 50) * 1e-3,
        )


@dataclass
class Motion:
    """Line, or arc in X and Y, and how it ends."""

    start: np.ndarray
    end: np.ndarray
    feed: float
    is_exact: bool
    tolerance: float | None
    center: np.ndarray | None = None
    sweep: float = 0.0
    dwell: float | None = None
    cuts: list[float] = field(default_factory=lambda: [0.0, 0.0])

    @property
    def radius(self) -> float:
        return float(np.linalg.norm((self.start - self.center)[:2]))

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.end - self.start)) if self.center is None else abs(self.sweep) * self.radius

    def points(self, place: np.ndarray) -> np.ndarray:
        """Returns the positions at places along the motion."""
        if self.center is None:
            return self.start + np.outer(place / self.length, self.end - self.start)
        offset = self.start - self.center
        angle = math.atan2(offset[1], offset[0]) + self.sweep * place / self.length
        circle = self.radius * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
        return np.array([self.center[0], self.center[1], self.start[2]]) + circle

    def tangent(self, at_end: bool) -> np.ndarray:
        """Returns the direction at an end."""
        if self.center is None:
            return (self.end - self.start) / self.length
        offset = (self.end if at_end else self.start) - self.center
        return math.copysign(1, self.sweep) * np.array([-offset[1], offset[0], 0]) / self.radius


def motions(program: str) -> list[Motion]:
    """Reads G0 to G4, G61 and G64 P with absolute coordinates in mm."""
    found: list[Motion] = []
    position, code, feed, is_exact, tolerance = np.zeros(3), 0, 0.0, False, None
    for line in program.splitlines():
        words = re.findall(r"([A-Z])\s*(-?[0-9.]+)", re.sub(r"\(.*?\)|;.*", "", line))
        numbers = {letter: float(value) for letter, value in words}
        codes = [float(value) for letter, value in words if letter == "G"]
        if 4 in codes:
            found[-1].dwell = (found[-1].dwell or 0.0) + numbers["P"]
            continue
        for value in codes:
            if value in (0, 1, 2, 3):
                code = int(value)
            elif value in (61, 64):
                is_exact, tolerance = value == 61, numbers["P"] * 1e-3 if "P" in numbers else None
        feed = numbers.get("F", feed)
        end = np.array([numbers.get(axis, 1e3 * position[i]) * 1e-3 for i, axis in enumerate("XYZ")])
        is_arc = code in (2, 3)
        if not (set(numbers) & set("XYZ")) and not (is_arc and set(numbers) & set("IJ")):
            continue
        motion = Motion(position, end, math.inf if code == 0 else feed / 60e3, is_exact, tolerance)
        if is_arc:
            motion.center = position + 1e-3 * np.array([numbers.get("I", 0), numbers.get("J", 0), 0])
            a, b = position - motion.center, end - motion.center
            angle = (math.atan2(b[1], b[0]) - math.atan2(a[1], a[0])) % math.tau
            angle = angle if angle > 1e-9 else math.tau
            motion.sweep = angle if code == 3 else (angle - math.tau if angle < math.tau else -math.tau)
        if motion.length > 1e-12:
            found.append(motion)
        position = end
    return found


@dataclass
class Element:
    """Part of the path with constant limits; `limit` is the speed at its end."""

    points: object
    length: float
    speed: float
    acceleration: float
    jerk: float
    limit: float
    dwell: float | None = None


def elements(control: Control, program: str) -> list[Element]:
    """Returns the path with the corners of the control."""
    path = motions(program)

    def least(values: np.ndarray, direction: np.ndarray) -> float:
        return min(value / abs(part) for value, part in zip(values, direction, strict=True) if abs(part) > 1e-12)

    jerk = control.jerk if control.jerk is not None else np.full(3, math.inf)

    def limits(motion: Motion) -> tuple[float, float, float]:
        if motion.center is None:
            direction = motion.tangent(False)
            return (
                min(motion.feed, least(control.velocity, direction), motion.length / control.block_cycle),
                least(control.acceleration, direction),
                least(jerk, direction),
            )
        across = control.normal_fraction * min(control.acceleration[:2])
        speed = min(motion.feed, *control.velocity[:2], math.sqrt(across * motion.radius))
        along = control.tangential_fraction * min(control.acceleration[:2])
        return min(speed, motion.length / control.block_cycle), along, min(jerk[:2])

    joints: list[tuple[float, Element | None]] = []
    for before, after in zip(path, path[1:], strict=False):
        first, second = before.tangent(True), after.tangent(False)
        turn = 2 * math.atan2(np.linalg.norm(second - first), np.linalg.norm(second + first))
        stops = before.dwell is not None or math.isinf(before.feed) != math.isinf(after.feed)
        if stops or turn > math.pi - 1e-3:
            joints.append((0.0, None))
            continue
        if turn < 1e-6:
            joints.append((math.inf, None))
            continue
        if before.is_exact or control.corners == "stop":
            joints.append((0.0, None))
            continue
        if control.corners == "velocity_step":
            joints.append((control.corner_velocity / np.linalg.norm(second - first), None))
            continue
        tolerance = control.corner_tolerance if before.tolerance is None else before.tolerance
        moving = [a for a, d, e in zip(control.acceleration, first, second, strict=True) if abs(d) + abs(e) > 1e-12]
        radius = tolerance / (1 / math.cos(turn / 2) - 1)
        across, along = control.normal_fraction * min(moving), control.tangential_fraction * min(moving)
        if control.corners == "deviation":
            joints.append((math.sqrt(across * radius), None))
            continue
        assert before.center is None and after.center is None, "corners of arcs are not generated"
        cut = min(radius * math.tan(turn / 2), 0.5 * before.length, 0.5 * after.length)
        radius = cut / math.tan(turn / 2)
        before.cuts[1], after.cuts[0] = cut, cut
        start = before.end - cut * first
        normal = (second - math.cos(turn) * first) / math.sin(turn)

        def arc(place: np.ndarray, start=start, first=first, normal=normal, radius=radius) -> np.ndarray:
            angle = place / radius
            return start + radius * (np.outer(np.sin(angle), first) + np.outer(1 - np.cos(angle), normal))

        speed = min(math.sqrt(across * radius), limits(before)[0], limits(after)[0])
        joints.append((speed, Element(arc, radius * turn, speed, along, math.inf, math.inf)))
    joints.append((0.0, None))
    result = []
    for motion, (limit, corner) in zip(path, joints, strict=True):
        speed, acceleration, jerk_limit = limits(motion)
        offset = motion.cuts[0]
        length = motion.length - sum(motion.cuts)

        def points(place: np.ndarray, motion: Motion = motion, offset: float = offset) -> np.ndarray:
            return motion.points(place + offset)

        if length > 1e-12 or corner is None:
            result.append(Element(points, max(length, 0.0), speed, acceleration, jerk_limit, limit, motion.dwell))
        if corner is not None:
            result.append(corner)
    return result


def change(element: Element, start: float, end: float) -> tuple[float, float]:
    """Returns time and distance of a change of speed."""
    step = abs(end - start)
    if math.isinf(element.jerk):
        time = step / element.acceleration
    elif step >= element.acceleration**2 / element.jerk:
        time = step / element.acceleration + element.acceleration / element.jerk
    else:
        time = 2 * math.sqrt(step / element.jerk)
    return time, 0.5 * (start + end) * time


def reachable(element: Element, speed: float) -> float:
    """Returns the largest speed at the other end of an element."""
    if math.isinf(element.jerk):
        return math.sqrt(speed**2 + 2 * element.acceleration * element.length)
    low, high = speed, speed + math.sqrt(2 * element.acceleration * element.length) + 1e-9
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if change(element, speed, middle)[1] <= element.length else (low, middle)
    return low


def ends(control: Control, path: list[Element]) -> list[float]:
    """Returns the speed at the end of each element."""
    limits = [min(a.limit, a.speed, b.speed) for a, b in zip(path, path[1:], strict=False)] + [0.0]
    result, speed = [], 0.0
    for index, element in enumerate(path):
        exit_speed = 0.0
        if limits[index] > 0:
            last = min(index + control.look_ahead, len(path) - 1)
            for other in range(index + 1, last + 1):
                if limits[other] == 0:
                    last = other
                    break
            for other in range(last, index, -1):
                exit_speed = min(reachable(path[other], exit_speed), limits[other - 1])
        speed = min(exit_speed, reachable(element, speed))
        result.append(speed)
    return result


def phases(element: Element, start: float, end: float) -> list[tuple[float, float, float, float]]:
    """Returns duration, speed, acceleration and jerk of the phases of an element."""
    low, high = max(start, end), max(element.speed, start, end)

    def needs(peak: float) -> float:
        return change(element, start, peak)[1] + change(element, peak, end)[1]

    if needs(high) > element.length:
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if needs(middle) <= element.length else (low, middle)
        peak = low
    else:
        peak = high
    found = []

    def ramp(a: float, b: float) -> None:
        sign, step = math.copysign(1, b - a), abs(b - a)
        if step <= 0:
            return
        if math.isinf(element.jerk):
            found.append((step / element.acceleration, a, sign * element.acceleration, 0.0))
            return
        jerk_time = min(element.acceleration / element.jerk, math.sqrt(step / element.jerk))
        top = sign * element.jerk * jerk_time
        found.append((jerk_time, a, 0.0, sign * element.jerk))
        found.append((max(step / element.acceleration - jerk_time, 0.0), a + 0.5 * top * jerk_time, top, 0.0))
        found.append((jerk_time, b - 0.5 * top * jerk_time, top, -sign * element.jerk))

    ramp(start, peak)
    if peak > 0:
        found.append((max(element.length - needs(peak), 0.0) / peak, peak, 0.0, 0.0))
    ramp(peak, end)
    return found


def averaged(positions: np.ndarray, samples: float) -> np.ndarray:
    """Returns the moving average over a number of samples, of positions joined by straight lines."""
    padded = np.concatenate([np.repeat(positions[:1], 2, axis=0), positions])
    steps = 0.5 * (padded[1:] + padded[:-1])
    integral = np.concatenate([np.zeros((1, positions.shape[1])), np.cumsum(steps, axis=0)])[1:]
    index = np.arange(len(positions), dtype=float) + 1
    result = np.empty_like(positions)
    grid = np.arange(len(integral), dtype=float)
    for axis in range(positions.shape[1]):
        # Second-order between samples: the integral of straight lines.
        at = index - samples
        whole = np.floor(at).astype(int)
        part = at - whole
        low = np.clip(whole, 0, len(grid) - 1)
        value = padded[np.clip(low + 1, 0, len(padded) - 1), axis]
        after = padded[np.clip(low + 2, 0, len(padded) - 1), axis]
        early = integral[low, axis] + part * value + 0.5 * part**2 * (after - value)
        before = positions[0, axis] * at + integral[0, axis]
        result[:, axis] = (integral[np.arange(len(positions)) + 1, axis] - np.where(at < 0, before, early)) / samples
    return result


def setpoints(control: Control, program: str) -> tuple[np.ndarray, np.ndarray]:
    """Returns times and positions of X, Y and Z in each sampling period."""
    path = elements(control, program)
    exits = ends(control, path)
    step = control.period / FINE
    pieces, clock, sample, speed = [], 0.0, 0, 0.0
    settling = sum(control.filters)

    def stand(position: np.ndarray, time: float) -> None:
        nonlocal clock, sample
        clock += time
        count = max(math.floor(clock / step) + 1 - sample, 0)
        pieces.append(np.repeat(position[None, :], count, axis=0))
        sample += count

    for element, end in zip(path, exits, strict=True):
        parts = phases(element, speed, end)
        durations = np.array([part[0] for part in parts])
        starts = np.concatenate([[0], np.cumsum(durations)])
        places, at = [], 0.0
        for duration, v, a, j in parts:
            places.append(at)
            at += duration * (v + duration * (a / 2 + duration * j / 6))
        count = max(math.floor((clock + starts[-1]) / step) + 1 - sample, 0)
        times = (sample + np.arange(count)) * step - clock
        index = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(parts) - 1)
        local = times - starts[index]
        v, a, j = (np.array([part[k] for part in parts])[index] for k in (1, 2, 3))
        place = np.array(places)[index] + local * (v + local * (a / 2 + local * j / 6))
        if count:
            pieces.append(element.points(np.clip(place, 0, element.length)))
        sample += count
        clock += starts[-1]
        speed = end
        if element.dwell is not None:
            stand(element.points(np.array([element.length]))[0], element.dwell + control.wait + settling)
    stand(element.points(np.array([element.length]))[0], settling + 0.2)
    positions = np.concatenate([np.repeat(pieces[0][:1], FINE * 50, axis=0), *pieces])
    for time in control.filters:
        positions = averaged(positions, time / step)
    positions = positions[::FINE]
    return np.arange(len(positions)) * control.period, positions


def write(path: object, control: Control, program: str) -> None:
    """Writes the setpoints as CSV with a resolution of 1 nm."""
    times, positions = setpoints(control, program)
    rows = (f"{t:.6f},{x:.9f},{y:.9f},{z:.9f}\n" for t, (x, y, z) in zip(times, positions, strict=True))
    path.write_text("time,x,y,z\n" + "".join(rows))


def motion_time(control: Control, program: str) -> float:
    """Returns the time from the first to the last change of a position by more than 1 nm, s."""
    _, positions = setpoints(control, program)
    moved = np.flatnonzero(np.abs(np.diff(np.round(positions, 9), axis=0)).max(axis=1) > 0)
    return (moved[-1] + 1 - moved[0]) * control.period
