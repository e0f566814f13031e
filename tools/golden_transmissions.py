#!/usr/bin/env python3
"""Writes crates/core/tests/golden/transmissions.csv: steps of a motor with an elastic load, computed with 120 digits.

    pip install mpmath==1.4.1
    python tools/golden_transmissions.py

Nothing here is taken from the library: the differential equations of two masses with a spring and a damper are written
as a matrix, whose exponential is the Taylor series with scaling and squaring of `golden_drives.py`.
"""

import math
import random

import mpmath
from mpmath import mpf

from golden_drives import GOLDEN, exponential

SEED = 31
COUNT = 60
# Motor: total inertia, Kt, Ke, R, L, tick; those of the default X axis and of drives far from it.
MOTORS = (
    (0.028, 2.64, 0.88, 0.46, 8.5e-3, 125e-6),
    (0.0021, 1.1, 0.64, 1.9, 4.1e-3, 125e-6),
    (0.4, 12.0, 6.9, 1.2, 2.0e-2, 250e-6),
    (850.0, 210.0, 70.0, 2.1, 1.5e-2, 100e-6),
    (0.0004, 0.4, 0.2, 0.02, 4.0e-4, 31.25e-6),
)
STATES = ("current", "speed", "wind_up", "load_speed", "angle")


def step(motor, transmission):
    """Returns rows of i, ω, δ, ω_load and θ by i, ω, δ, ω_load, u, the torque at the motor and that at the load."""
    inertia, torque, emf, resistance, inductance, tick = map(mpf, motor)
    stiffness, damping, load = map(mpf, transmission)
    own = inertia - load
    a = mpmath.zeros(8, 8)
    a[0, 0], a[0, 1], a[0, 5] = -resistance / inductance, -emf / inductance, 1 / inductance
    a[1, 0], a[1, 1], a[1, 2], a[1, 3], a[1, 6] = torque / own, -damping / own, -stiffness / own, damping / own, 1 / own
    a[2, 1], a[2, 3] = 1, -1
    a[3, 1], a[3, 2], a[3, 3], a[3, 7] = damping / load, stiffness / load, -damping / load, 1 / load
    a[4, 1] = 1
    e = exponential(a * tick)
    return [e[row, column] for row in range(5) for column in (0, 1, 2, 3, 5, 6, 7)]


def main():
    """Draws transmissions with resonances up to the Nyquist frequency of the ticks."""
    source = random.Random(SEED)
    columns = ["inertia", "torque_constant", "emf_constant", "resistance", "inductance", "tick"]
    columns += ["stiffness", "damping", "load_inertia"]
    columns += [f"{row}_by_{column}" for row in STATES for column in (*STATES[:4], "u", "motor", "load")]
    lines = [",".join(columns)]
    for index in range(COUNT):
        motor = MOTORS[index % len(MOTORS)]
        load = motor[0] * source.uniform(0.05, 0.95)
        reduced = load * (motor[0] - load) / motor[0]
        resonance = math.tau * 10 ** source.uniform(0.5, math.log10(0.45 / motor[5]))
        stiffness = reduced * resonance**2
        ratio = source.choice((0.0, 10 ** source.uniform(-4, 0.3)))
        transmission = (stiffness, 2 * ratio * math.sqrt(stiffness * reduced), load)
        values = [*motor, *transmission, *map(float, step(motor, transmission))]
        lines.append(",".join(map(repr, values)))
    (GOLDEN / "transmissions.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
