#!/usr/bin/env python3
"""Writes crates/core/tests/golden/backlash_cases.csv and backlash.csv: axes with backlash, exact between two events.

    pip install scipy==1.17.1
    python tools/golden_backlash.py

Nothing here is taken from the library. The equations are those of two masses with a spring and a damper in series
with a gap (Nordin, Galic and Gutman, 1997), on a structure with a mass, a spring and a damper, in Newton's form.
Between two events they are linear: matrix exponentials over a hundredth of a tick, with the instant of an event
found by Brent's method to 1e-16 s. Inputs are constant over a tick: a voltage and a torque at the load, both sines
of the tick. No friction.

Columns of the cases: inductance (H), resistance (ohm), torque constant (N m/A), back-EMF constant (V s), inertia of
the motor alone, stiffness (N m/rad), damping, inertia of the load, width of the gap (rad), modal inertia, frequency
(rad/s) and damping ratio of the structure (0: none), 1 for a direct drive, amplitude of the voltage (V), amplitude
of the torque (N m), its mean. Columns of the states: case, tick, i, omega, wind-up and load speed against the
environment, theta, number of events so far.
"""

import math

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from golden import write

TICK = 125e-6
TICKS = 1600
ROW_TICKS = 20
PARTS = 100
MOTOR = (8e-3, 0.5, 1.35, 1.35, 0.016)
# Stiffness, damping, load inertia, gap, structure (inertia, frequency, ratio), direct, voltage, torque, mean torque.
CASES = [
    (*MOTOR, 2000.0, 0.0, 0.012, 3e-3, 0.0, 0.0, 0.0, 0.0, 30.0, 0.0, 0.0),
    (*MOTOR, 2000.0, 1.5, 0.012, 3e-3, 0.0, 0.0, 0.0, 0.0, 30.0, 0.5, 0.0),
    (*MOTOR, 2000.0, 0.2, 0.012, 1e-2, 0.0, 0.0, 0.0, 0.0, 20.0, 2.0, -3.0),
    (*MOTOR, 50000.0, 5.0, 0.002, 1e-3, 0.0, 0.0, 0.0, 0.0, 15.0, 1.0, 0.0),
    (*MOTOR, 2000.0, 0.5, 0.012, 3e-3, 0.05, 300.0, 0.03, 0.0, 30.0, 1.0, 0.5),
    (0.02, 2.0, 100.0, 100.0, 80.0, 3e7, 2e4, 200.0, 2e-5, 900.0, 200.0, 0.02, 1.0, 60.0, 300.0, 0.0),
]
CURRENT, SPEED, ANGLE, LOAD_SPEED, WIND_UP, TWIST, VELOCITY, DISPLACEMENT, ONE = range(9)


def system(case, side, voltage, torque):
    """Returns the matrix of the affine equations; the last state is 1."""
    inductance, resistance, kt, ke, motor, stiffness, damping, load = case[:8]
    modal, frequency, ratio, direct = case[9:13]
    spring = np.zeros(9)
    if side:
        spring[TWIST] = stiffness
        spring[SPEED], spring[LOAD_SPEED] = damping, -damping
    force = np.zeros(9)
    force[CURRENT] = kt
    outer = np.zeros(9)
    outer[ONE] = torque
    matrix = np.zeros((9, 9))
    matrix[CURRENT, CURRENT], matrix[CURRENT, SPEED] = -resistance / inductance, -ke / inductance
    matrix[CURRENT, ONE] = voltage / inductance
    structure = np.zeros(9)
    if modal:
        structure[DISPLACEMENT] = -(frequency**2)
        structure[VELOCITY] = -2.0 * ratio * frequency
        structure -= (force if direct else spring) / modal
        matrix[DISPLACEMENT, VELOCITY] = 1.0
        matrix[VELOCITY] = structure
    matrix[SPEED] = (force - spring) / motor - direct * structure
    matrix[LOAD_SPEED] = (spring + outer) / load - structure
    matrix[ANGLE, SPEED] = 1.0
    matrix[WIND_UP, SPEED], matrix[WIND_UP, LOAD_SPEED] = 1.0, -1.0
    if side:
        matrix[TWIST] = matrix[WIND_UP]
    elif damping:
        matrix[TWIST, TWIST] = -stiffness / damping
    return matrix


def beyond(case, side, state):
    """Returns a number that is positive beyond the next event."""
    stiffness, damping, gap = case[5], case[6], case[8]
    if side == 0:
        return abs(state[WIND_UP] - state[TWIST]) - gap / 2.0
    return -side * (stiffness * state[TWIST] + damping * (state[SPEED] - state[LOAD_SPEED]))


def after_event(case, side, state):
    """Returns side and state after an event."""
    if side == 0:
        side = 1 if state[WIND_UP] > state[TWIST] else -1
        state[TWIST] = state[WIND_UP] - side * case[8] / 2.0
        return side, state
    if case[6] == 0.0:
        state[TWIST] = 0.0
    return 0, state


def solve(case):
    """Yields the states at each row."""
    state = np.zeros(9)
    state[ONE] = 1.0
    side, events = 0, 0
    for tick in range(TICKS):
        if tick % ROW_TICKS == 0 and tick:
            wind_up, load_speed = state[WIND_UP] - state[DISPLACEMENT], state[LOAD_SPEED] + state[VELOCITY]
            yield tick, state[CURRENT], state[SPEED], wind_up, load_speed, state[ANGLE], events
        voltage = case[13] * math.sin(0.02 * tick)
        torque = case[15] + case[14] * math.sin(0.031 * tick)
        left = TICK
        while left > 0.0:
            matrix = system(case, side, voltage, torque)
            step = min(left, TICK / PARTS)
            following = expm(matrix * step) @ state
            if beyond(case, side, following) > 0.0:
                now = state

                def crossing(time, matrix=matrix, side=side, now=now):
                    return beyond(case, side, expm(matrix * time) @ now)

                step = brentq(crossing, 0.0, step, xtol=1e-18) if crossing(0.0) < 0.0 else step
                side, state = after_event(case, side, expm(matrix * step) @ state)
                events += 1
            else:
                state = following
            left -= step
            left = left if left > 1e-17 else 0.0


def main():
    """Writes the tables."""
    rows = []
    for number, case in enumerate(CASES):
        for tick, *values, events in solve(case):
            rows.append([str(number), str(tick), *(f"{float(value):.15e}" for value in values), str(events)])
        print(rows[-1])
    columns = "inductance,resistance,torque_constant,emf_constant,inertia,stiffness,damping,load,gap,modal,"
    columns += "frequency,ratio,direct,voltage,torque,mean_torque"
    write("backlash_cases", columns.split(","), ([repr(float(value)) for value in case] for case in CASES))
    write("backlash", "case,tick,current,speed,wind_up,load_speed,angle,events".split(","), rows)


if __name__ == "__main__":
    main()
