#!/usr/bin/env python3
"""Writes gms.csv and presliding.csv of crates/core/tests/golden: generalized Maxwell-slip and LuGre friction models.

    pip install scipy==1.17.1
    python tools/golden_friction.py

Nothing here is taken from the library. The equations are those of Al-Bender, Lampaert and Swevers, "The generalized
Maxwell-slip model: a novel model for friction simulation and compensation", IEEE Transactions on Automatic Control 50
(2005). No table of parameters from a publication on this model could be cited with certainty: friction law and mass are
those of table 1 of Canudas de Wit, Olsson, Åström and Lischinsky, IEEE Transactions on Automatic Control 40 (1995), and
the elements and their attraction are chosen for this test. Between two events the equations are solved by an explicit
Runge-Kutta method of order 8 with tolerances of 1e-11; events are the start of slip of an element and the reversal of
the velocity.

The LuGre equations and parameters are those of the second paper, solved by the Radau IIA method. Its cases: 0,
presliding: a force on a mass of 1 kg rises to 95 % of the breakaway force, changes its sign and rises again; 1,
stick-slip: a spring of 2 N/m, whose end moves at 0.1 m/s, pulls the mass.

Columns: case, time (s), position (m), velocity (m/s), friction force (N). Cases of gms.csv: 0, presliding: a force with
two frequencies, at most 91 % of the breakaway force, on a mass of 1 kg, with a viscous friction of 200 N/(m/s), since
elements that stick have no damping; 1, stick-slip: a spring of 200 N/m, whose end moves at 1 mm/s, pulls the mass, with
40 N/(m/s); 2, frictional lag: the velocity is a sine around 1.5 mm/s, without reversals, with 0.4 N/(m/s); 3, case 1,
in which the force of a slipping element grows at most as fast as that of its spring. Without this limit a slider can
move along the motion faster than the mass and supply energy.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

from golden import write

STIFFNESS = np.array([5e4, 2.5e4, 1.5e4, 1e4])
SHARE = np.array([0.2, 0.25, 0.25, 0.3])
ATTRACTION = 40.0
COULOMB = 1.0
BREAKAWAY = 1.5
STRIBECK_VELOCITY = 0.001
MASS = 1.0
LUGRE_STIFFNESS, LUGRE_DAMPING, LUGRE_VISCOUS = 1e5, math.sqrt(1e5), 0.4
COLUMNS = ("case", "time", "position", "velocity", "friction")


def law(velocity):
    """Returns g, N."""
    return COULOMB + (BREAKAWAY - COULOMB) * math.exp(-((velocity / STRIBECK_VELOCITY) ** 2))


def two_frequencies(time, _position):
    """Returns the force of case 0, N."""
    angle = math.tau * time / 4.0
    return 1.9 * (0.65 * math.sin(angle) + 0.35 * math.sin(3.0 * angle))


def spring_force(time, position):
    """Returns the force of the spring, N."""
    return 200.0 * (0.001 * time - position)


def lag_motion(time):
    """Returns velocity and acceleration of case 2, m/s and m/s²."""
    angle = math.tau * time
    return 1.5e-3 + 1.2e-3 * math.sin(angle), 1.2e-3 * math.tau * math.cos(angle)


def on_mass(force, viscous):
    """Returns the acceleration of a mass under a force."""
    return lambda time, state: (force(time, state[0]) - viscous * state[1] - sum(state[2:])) / MASS


class Phase:
    """Motion in one direction with the elements that slip."""

    def __init__(self, acceleration, direction, slips, is_limited):
        """Starts a motion in `direction`; the elements with a True in `slips` slip, limited as in case 3 or not."""
        self.acceleration, self.direction, self.slips, self.is_limited = acceleration, direction, slips, is_limited

    def slope(self, time, state):
        """Returns the derivative of position, velocity and forces."""
        velocity, forces = state[1], state[2:]
        growth = ATTRACTION * (SHARE - self.direction * forces / law(velocity))
        if self.is_limited:
            growth = np.minimum(growth, self.direction * STIFFNESS * velocity)
        change = np.where(self.slips, self.direction * growth, STIFFNESS * velocity)
        return np.concatenate([[velocity, self.acceleration(time, state)], change])

    def events(self):
        """Returns the functions that cross 0 at the reversal and at the start of slip of each element that sticks."""

        def reversal(_time, state):
            return self.direction * state[1]

        def slip(element):
            return lambda _time, state: self.direction * state[2 + element] - SHARE[element] * law(state[1])

        reversal.terminal, reversal.direction = True, -1.0
        found = [(reversal, None)]
        for element in np.flatnonzero(~self.slips):
            event = slip(element)
            event.terminal, event.direction = True, 1.0
            found.append((event, element))
        return found


def solve(acceleration, start, end, rows, is_limited):
    """Yields time and state at the times of the rows, from event to event."""
    times = [end * k / rows for k in range(1, rows + 1)]
    time, state = 0.0, np.array(start)
    phase = Phase(acceleration, 1.0, np.zeros(len(SHARE), bool), is_limited)
    while time < end:
        events = phase.events()
        solution = solve_ivp(
            phase.slope,
            (time, end),
            state,
            "DOP853",
            dense_output=True,
            events=[event for event, _ in events],
            rtol=1e-11,
            atol=[1e-14, 1e-13] + [1e-12] * len(SHARE),
            max_step=0.01,
        )
        if not solution.success:
            raise RuntimeError(solution.message)
        reached = solution.t[-1]
        for row in [row for row in times if time < row <= reached]:
            yield row, solution.sol(row)
        duration, time, state = reached - time, reached, solution.y[:, -1].copy()
        for (_, element), instants in zip(events, solution.t_events, strict=True):
            if len(instants) == 0:
                continue
            if element is None:
                state[1] = 0.0
                direction = math.copysign(1.0, acceleration(time, state))
                # A velocity that only touches 0 goes on in its direction.
                direction = -phase.direction if duration < 1e-9 else direction
                # An element that is already at its limit slips at once.
                slips = direction * state[2:] > SHARE * law(0.0) * (1.0 - 1e-12)
                phase = Phase(acceleration, direction, slips, is_limited)
            else:
                phase.slips[element] = True


def gms():
    """Writes the table of the generalized Maxwell-slip model."""
    table = []
    cases = [
        (on_mass(two_frequencies, 200.0), 0.0, 8.0, 160, 200.0, False),
        (on_mass(spring_force, 40.0), 0.0, 20.0, 100, 40.0, False),
        (lambda time, _state: lag_motion(time)[1], lag_motion(0.0)[0], 2.0, 200, 0.4, False),
        (on_mass(spring_force, 40.0), 0.0, 20.0, 100, 40.0, True),
    ]
    for case, (acceleration, velocity, end, rows, viscous, is_limited) in enumerate(cases):
        for time, state in solve(acceleration, [0.0, velocity] + [0.0] * len(SHARE), end, rows, is_limited):
            friction = sum(state[2:]) + viscous * state[1]
            table.append([str(case), *(f"{value:.12e}" for value in (time, state[0], state[1], friction))])
    write("gms", COLUMNS, table)


def bristle_speed(velocity, deflection):
    """Returns dz/dt."""
    return velocity - LUGRE_STIFFNESS * abs(velocity) / law(velocity) * deflection


def friction(velocity, deflection):
    """Returns the friction force, N."""
    return LUGRE_STIFFNESS * deflection + LUGRE_DAMPING * bristle_speed(velocity, deflection) + LUGRE_VISCOUS * velocity


def alternating_force(time, _position):
    """Returns a force between ±95 % of the breakaway force, N: a triangle with a period of 4 s."""
    phase = time % 4.0
    return 1.425 * (phase if phase < 1.0 else 2.0 - phase if phase < 3.0 else phase - 4.0)


def solve_lugre(force, end, rows, max_step):
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


def lugre():
    """Writes the table of the LuGre model."""
    table = []
    cases = (alternating_force, 8.0, 160), (lambda time, position: 2.0 * (0.1 * time - position), 20.0, 200)
    for case, (force, end, rows) in enumerate(cases):
        for row in solve_lugre(force, end, rows, 0.01):
            table.append([str(case), *(f"{value:.12e}" for value in row)])
    write("presliding", COLUMNS, table)


if __name__ == "__main__":
    gms()
    lugre()
