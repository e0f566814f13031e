"""The single-axis case in Drake, in Python: PyPI has the library without its headers, so that no C++ can be built.

A LeafSystem whose only periodic event updates the discrete state every 125 µs, the usual form of a sampled system in
Drake. The arithmetic uses plain Python floats, which is faster than numpy for this small state; the outer loops are
called at their instants by the same event, since simultaneous events all read the state before the update.
Figures: the largest delay-compensated following error and current only. Building the diagram is not timed.
"""

from __future__ import annotations

import math

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

from axis import CURRENT_PERIOD, TICKS_PER_POSITION, TICKS_PER_VELOCITY, Axis
from protocol import Figures, figures, read_input, serve


class Drive(LeafSystem):
    """One axis; its state is i, omega, theta, both integrals, held outputs of the loops, and the figures."""

    STATE = 11

    def __init__(self, axis: Axis, psec: list[float], start: int) -> None:
        super().__init__()
        self.axis, self.psec, self.start = axis, psec, start
        self.state = self.DeclareDiscreteState(self.STATE)
        self.DeclarePeriodicDiscreteUpdateEvent(CURRENT_PERIOD, 0.0, self.tick)

    def tick(self, context: Context, values: DiscreteValues) -> EventStatus:
        """Runs the loops that are due, then the plant."""
        p, psec = self.axis, self.psec
        (
            i, omega, theta, velocity_integral, current_integral,
            velocity_setpoint, current_setpoint, n, delay_compensated, peak, index,
        ) = context.get_discrete_state(self.state).value().tolist()  # fmt: skip
        t = int(n)
        at = self.start + int(index) - p.delay_periods
        if t == 0:
            error = psec[at] - theta * p.ratio
            delay_compensated = max(delay_compensated, abs(error))
            unlimited = p.position_gain * (psec[at] / p.ratio - theta)
            velocity_setpoint = min(max(unlimited, -p.max_speed), p.max_speed)
        if t % TICKS_PER_VELOCITY == 0:
            if t >= p.delay_step:
                at += 1
            first, second = psec[at] - psec[at - 1], psec[at - 1] - psec[at - 2]
            error = velocity_setpoint + p.velocity_feedforward * first - omega
            integral = velocity_integral + p.velocity_integral_gain * error
            unlimited = (
                p.velocity_gain * error + integral + p.torque_feedforward * (first - second)
            ) / p.torque_constant
            current_setpoint = min(max(unlimited, -p.max_current), p.max_current)
            if error * (unlimited - current_setpoint) <= 0.0:
                velocity_integral = integral
        error = current_setpoint - i
        integral = current_integral + p.current_integral_gain * error
        unlimited = p.current_gain * error + integral
        voltage = min(max(unlimited, -p.max_voltage), p.max_voltage)
        if error * (unlimited - voltage) <= 0.0:
            current_integral = integral
        peak = max(peak, abs(i))
        if omega == 0.0:
            bound = p.friction_i0
        else:
            v = abs(omega) * p.velocity_per_speed
            law = p.friction_a * math.exp(p.friction_b * v) + p.friction_c * math.exp(p.friction_d * v)
            bound = max(law, 0.0)
        r = p.speed
        free = r[0] * i + r[1] * omega + r[2] * voltage
        stopping = free / r[3]
        friction = min(max(stopping, -bound), bound)
        a, c = p.angle, p.current
        theta += a[0] * i + a[1] * omega + a[2] * voltage - a[3] * friction
        i = c[0] * i + c[1] * omega + c[2] * voltage - c[3] * friction
        omega = 0.0 if friction == stopping else free - r[3] * friction
        t += 1
        if t == TICKS_PER_POSITION:
            t, index = 0, index + 1
        values.set_value(
            (
                i, omega, theta, velocity_integral, current_integral,
                velocity_setpoint, current_setpoint, t, delay_compensated, peak, index,
            )
        )  # fmt: skip
        return EventStatus.Succeeded()


def main() -> None:
    """Runs the requests on standard input."""
    joint, axis, psec, values, start = read_input()
    simulator = Simulator(Drive(axis, values, start))
    context = simulator.get_mutable_context()
    initial = [0.0, 0.0, psec[0] / axis.ratio] + [0.0] * (Drive.STATE - 3)
    # The update at the end of the last cycle must not run.
    end = (len(psec) * TICKS_PER_POSITION - 0.5) * CURRENT_PERIOD

    def run() -> Figures:
        context.SetTime(0.0)
        context.SetDiscreteState(initial)
        simulator.Initialize()
        simulator.AdvanceTo(end)
        state = context.get_discrete_state_vector().value()
        return figures(state[8], state[9], position=state[2] * axis.ratio)

    serve(run, joint)


if __name__ == "__main__":
    main()
