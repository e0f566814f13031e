#!/usr/bin/env python3
"""Writes drives.csv, loops.csv and transmissions.csv of crates/core/tests/golden, with 120 digits.

    pip install mpmath==1.4.1
    python tools/golden_drives.py

Nothing here is taken from the library: the differential equations and the laws of the controllers are those that are
printed in Prévost et al., and those of two masses with a spring and a damper, written as matrices. Inputs are f64
numbers; outputs are exact to the last digit of one. Drives are at the limits of their ranges.
"""

import itertools
import math
import random

import mpmath
from mpmath import mpf

import options
from golden import write

# Digits: the largest exponent has 14, the smallest significant entries need 60.
mpmath.mp.dps = 120
SEED = 8

# SI, minimum and maximum of the schema, deviations of the plant included; one value between them.
RANGES = {
    "inertia": (1e-10, 0.028, 1e7),
    "torque_constant": (1e-10, 2.64, 1e6),
    "emf_constant": (0.0, 0.88, 1e5),
    "resistance": (0.0, 0.46, 1e4),
    "inductance": (1e-9, 8.5e-3, 1e2),
    "tick": (1e-6, 125e-6, 50e-3),
}
# Smallest value drawn from a range that begins at 0.
SMALLEST = 1e-9
# Relative distances of the resistance from the value that gives a double pole.
NEAR = (0.0, 1e-15, 1e-12, 1e-8, 1e-4, 1e-2)
# The double pole times the tick.
DOUBLE = (0.01, 0.39, 0.41, 0.99, 1.01, 3.0, 30.0)


def exponential(matrix):
    """Returns e^matrix by a Taylor series with scaling and squaring."""
    norm = max(mpmath.fsum(abs(matrix[i, j]) for j in range(matrix.cols)) for i in range(matrix.rows))
    halvings = 0
    while norm > mpf("0.01"):
        norm, halvings = norm / 2, halvings + 1
    matrix = matrix / mpf(2) ** halvings
    total = term = mpmath.eye(matrix.rows)
    for k in range(1, 200):
        term = term * matrix / k
        total = total + term
        if mpmath.mnorm(term, 1) < mpf(10) ** -150:
            break
    for _ in range(halvings):
        total = total * total
    return total


def step(motor, tick):
    """Returns the step matrix of the states i, ω, θ and the held inputs u and τ over a tick."""
    j, kt, ke, r, ind = (mpf(motor[k]) for k in list(RANGES)[:5])
    a = mpmath.zeros(5)
    a[0, 0], a[0, 1], a[0, 3] = -r / ind, -ke / ind, 1 / ind
    a[1, 0], a[1, 4] = kt / j, 1 / j
    a[2, 1] = 1
    return exponential(a * mpf(tick))


def turns_back(motor, tick):
    """Returns true if a torque step reverses the sign of the speed within the tick: the condition of a rejection."""
    j, kt, ke, r, ind = (mpf(motor[k]) for k in list(RANGES)[:5])
    p, square = r / ind / 2, ke * kt / (j * ind)
    if square <= p * p:
        return False
    nu = mpmath.sqrt(square - p * p)
    # The response decreases from the angle π − atan(ν/p) on, for an angle of π.
    fall = mpmath.atan2(nu, -p)
    end = min(mpf(tick) * nu, fall + mpmath.pi)
    if end <= fall:
        return False
    return step_response(p, nu, square, end / nu) <= 0


def step_response(p, nu, square, t):
    """Returns J times ω after a torque of 1 from rest."""
    decay = mpmath.exp(-p * t)
    g = decay * mpmath.sin(nu * t) / nu
    integral = (1 - decay * (mpmath.cos(nu * t) + p / nu * mpmath.sin(nu * t))) / square
    return g + 2 * p * integral


def motors():
    """Returns motors at the limits of each value, pairs of limits, random values, and nearly double poles."""
    names = list(RANGES)
    middle = {name: RANGES[name][1] for name in names}
    yield dict(middle)
    for name in names:
        for edge in (0, 2):
            yield middle | {name: RANGES[name][edge]}
    for first, second in itertools.combinations(names, 2):
        for one, other in itertools.product((0, 2), repeat=2):
            yield middle | {first: RANGES[first][one], second: RANGES[second][other]}
    # All corners: the worst case need not be at a pair of limits.
    for corner in itertools.product((0, 2), repeat=len(names)):
        yield {name: RANGES[name][edge] for name, edge in zip(names, corner)}
    source = random.Random(SEED)
    for _ in range(300):
        yield {
            name: 10 ** source.uniform(mpmath.log10(low or SMALLEST), mpmath.log10(high))
            for name, (low, _, high) in RANGES.items()
        }
    # The winding alone decays at twice the double pole: R = 2 L x/T, and Ke Kt/(L J) = (x/T)².
    for pole, near, side in itertools.product(DOUBLE, NEAR, (-1, 1)):
        rate = pole / middle["tick"]
        resistance = 2 * middle["inductance"] * rate * (1 + side * near)
        inertia = middle["emf_constant"] * middle["torque_constant"] / (middle["inductance"] * rate**2)
        yield middle | {"resistance": resistance, "inertia": inertia}


def number(value):
    """Returns the text of an f64; numbers below the smallest f64 become 0."""
    value = float(value)
    return repr(0.0 if abs(value) < 1e-290 else value)


def drives():
    """Writes steps of drives."""
    rows = []
    for motor in motors():
        fields = [number(motor[name]) for name in RANGES]
        if turns_back(motor, motor["tick"]):
            rows.append([*fields, "1"] + ["0"] * 12)
            continue
        e = step(motor, motor["tick"])
        entries = [e[row, column] for row in range(3) for column in (0, 1, 3, 4)]
        rows.append([*fields, "0", *map(number, entries)])
    columns = [*RANGES, "rejected", *(f"{row}_{column}" for row in "iwt" for column in "iwuq")]
    write("drives", columns, rows)


# X axis of the default machine, in the units of machine files: value, and the factor to SI.
LOOPS = {
    "motor.inertia_kg_m2": (0.028, 1),
    "motor.torque_constant_nm_a": (2.64, 1),
    "motor.emf_constant_v_s_rad": (0.88, 1),
    "motor.resistance_ohm": (0.46, 1),
    "motor.inductance_mh": (8.5, 1e-3),
    "velocity_loop.gain": (5.0, 1),
    "velocity_loop.integral_time_ms": (4.0, 1e-3),
    "current_loop.gain": (13.0, 1),
    "current_loop.integral_time_ms": (2.0, 1e-3),
}
# Tsi in ns, Tsi in Tsv, Tsv in Tsp.
PERIODS = [
    (125_000, 2, 24),
    (1_000, 1, 1),
    (1_000, 1, 6_000),
    (1_000, 50_000, 1),
    (1_000, 1, 50_000),
    (1_000, 250, 200),
    (125_000, 400, 1),
    (62_500, 2, 8),
    (500_000, 100, 1),
]
# Position cycles of the impulse response.
IMPULSE = 12


def power(matrix, n):
    result = mpmath.eye(matrix.rows)
    while n:
        if n & 1:
            result = result * matrix
        matrix, n = matrix * matrix, n >> 1
    return result


def impulse(values, tick_ns, ticks, instants):
    """Returns θ at the position cycles after an impulse of Ω* of one cycle: loops as powers of matrices."""
    j, kt, ke, r, ind, kv, tv, ki, ti = (mpf(v) * mpf(repr(f)) for v, (_, f) in zip(values, LOOPS.values()))
    tick = mpf(tick_ns) / 10**9
    # i, ω, θ, integral of the velocity loop, of the current loop, held u, i*, Ω*.
    i, w, _, iv, ii, u, cs, ws = range(8)
    a = mpmath.zeros(8)
    a[i, i], a[i, w], a[i, u] = -r / ind, -ke / ind, 1 / ind
    a[w, i] = kt / j
    a[2, w] = 1
    plant = exponential(a * tick)

    def pi(gain, step, scale, integral, output, wanted, found):
        m = mpmath.eye(8)
        m[integral, wanted], m[integral, found] = step, -step
        m[output, output] = 0
        m[output, integral] = 1 / scale
        m[output, wanted], m[output, found] = (gain + step) / scale, -(gain + step) / scale
        return m

    current = pi(ki, ki * tick / ti, mpf(1), ii, u, cs, i)
    velocity = pi(kv, kv * tick * ticks / tv, kt, iv, cs, ws, w)
    period = power(power(plant * current, ticks) * velocity, instants)
    x = mpmath.zeros(8, 1)
    x[ws] = 1
    angles = []
    for _ in range(IMPULSE):
        x = period * x
        angles.append(x[2])
        x[ws] = 0
    return angles


def loops():
    """Writes impulse responses of the cascade."""
    mpmath.mp.dps = 80
    source = random.Random(SEED)
    names = list(LOOPS)
    middle = [value for value, _ in LOOPS.values()]
    cases = [(middle, periods) for periods in PERIODS]
    for index in range(len(names)):
        for factor in (1e-4, 0.1, 10, 1e4):
            for periods in PERIODS[:2]:
                cases.append(([v * factor if k == index else v for k, v in enumerate(middle)], periods))
    for _ in range(80):
        factors = [10 ** source.uniform(-2, 2) for _ in names]
        cases.append(([v * f for v, f in zip(middle, factors)], source.choice(PERIODS)))
    rows = []
    for values, periods in cases:
        angles = (number(min(abs(v), mpf("1e300")) * mpmath.sign(v)) for v in impulse(values, *periods))
        rows.append([*map(repr, values), *map(str, periods), *angles])
    columns = [*names, "tick_ns", "ticks", "instants", *(f"theta_{k + 1}" for k in range(IMPULSE))]
    write("loops", columns, rows)


# Motor: total inertia, Kt, Ke, R, L, tick; those of the default X axis and of drives far from it.
MOTORS = (
    (0.028, 2.64, 0.88, 0.46, 8.5e-3, 125e-6),
    (0.0021, 1.1, 0.64, 1.9, 4.1e-3, 125e-6),
    (0.4, 12.0, 6.9, 1.2, 2.0e-2, 250e-6),
    (850.0, 210.0, 70.0, 2.1, 1.5e-2, 100e-6),
    (0.0004, 0.4, 0.2, 0.02, 4.0e-4, 31.25e-6),
)
STATES = ("current", "speed", "wind_up", "load_speed", "angle")


def elastic_step(motor, transmission):
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


def transmissions():
    """Draws transmissions with resonances up to the Nyquist frequency of the ticks."""
    source = random.Random(31)
    columns = ["inertia", "torque_constant", "emf_constant", "resistance", "inductance", "tick"]
    columns += ["stiffness", "damping", "load_inertia"]
    columns += [f"{row}_by_{column}" for row in STATES for column in (*STATES[:4], "u", "motor", "load")]
    rows = []
    for index in range(60):
        motor = MOTORS[index % len(MOTORS)]
        load = motor[0] * source.uniform(0.05, 0.95)
        reduced = load * (motor[0] - load) / motor[0]
        resonance = math.tau * 10 ** source.uniform(0.5, math.log10(0.45 / motor[5]))
        stiffness = reduced * resonance**2
        ratio = source.choice((0.0, 10 ** source.uniform(-4, 0.3)))
        transmission = (stiffness, 2 * ratio * math.sqrt(stiffness * reduced), load)
        rows.append(map(repr, [*motor, *transmission, *map(float, elastic_step(motor, transmission))]))
    write("transmissions", columns, rows)


def main():
    options.parser(__doc__).parse_args()
    drives()
    transmissions()
    loops()


if __name__ == "__main__":
    main()
