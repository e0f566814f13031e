#!/usr/bin/env python3
"""Writes crates/core/tests/golden/presliding.csv: the LuGre friction model with the parameters of its authors.

    pip install scipy==1.17.1
    python tools/golden_presliding.py

Nothing here is taken from the library. The equations are those of Canudas de Wit, Olsson, Åström and Lischinsky, "A new
model for control of systems with friction", IEEE Transactions on Automatic Control 40 (1995), with the parameters of
its table 1, solved by the Radau IIA method with tolerances of 1e-11. Columns: case, time (s), position (m), velocity
(m/s), friction force (N). Cases: 0, presliding: a force on a mass of 1 kg rises to 95 % of the breakaway force, changes
its sign and rises again; 1, stick-slip: a spring of 2 N/m, whose end moves at 0.1 m/s, pulls the mass.
"""

import math
from pathlib import Path

from scipy.integrate import solve_ivp

STIFFNESS = 1e5
DAMPING = math.sqrt(1e5)
VISCOUS = 0.4
COULOMB = 1.0
BREAKAWAY = 1.5
STRIBECK_VELOCITY = 0.001
MASS = 1.0
GOLDEN = Path(__file__).resolve().parents[1] / "crates/core/tests/golden"


def bristle_speed(velocity, deflection):
    """Returns dz/dt."""
    law = COULOMB + (BREAKAWAY - COULOMB) * math.exp(-((velocity / STRIBECK_VELOCITY) ** 2))
    return velocity - STIFFNESS * abs(velocity) / law * deflection


def friction(velocity, deflection):
    """Returns the friction force, N."""
    return STIFFNESS * deflection + DAMPING * bristle_speed(velocity, deflection) + VISCOUS * velocity


def alternating_force(time, _position):
    """Returns a force between ±95 % of the breakaway force, N: a triangle with a period of 4 s."""
    phase = time % 4.0
    return 1.425 * (phase if phase < 1.0 else 2.0 - phase if phase < 3.0 else phase - 4.0)


def spring_force(time, position):
    """Returns the force of the spring, N."""
    return 2.0 * (0.1 * time - position)


def solve(force, end, rows, max_step):
    """Yields time, position, velocity and friction of a mass under a force."""

    def slope(time, state):
        position, velocity, deflection = state
        acceleration = (force(time, position) - friction(velocity, deflection)) / MASS
        return [velocity, acceleration, bristle_speed(velocity, deflection)]

    times = [end * k / rows for k in range(1, rows + 1)]
    solution = solve_ivp(slope, (0.0, end), [0.0, 0.0, 0.0], "Radau", times, rtol=1e-11, atol=1e-14, max_step=max_step)
    if not solution.success:
        raise RuntimeError(solution.message)
    for time, position, velocity, deflection in zip(times, *solution.y, strict=True):
        yield time, position, velocity, friction(velocity, deflection)


def main():
    """Writes the table."""
    lines = ["case,time,position,velocity,friction"]
    for case, rows in enumerate([solve(alternating_force, 8.0, 160, 0.01), solve(spring_force, 20.0, 200, 0.01)]):
        lines += [f"{case}," + ",".join(f"{value:.12e}" for value in row) for row in rows]
    (GOLDEN / "presliding.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
