"""The single-axis case in CasADi: `mapaccum` over the position cycles, as C code compiled by gcc.

A position cycle is one SX function (its 48 ticks unrolled), `mapaccum` carries the state through all of them, and
CasADi's code generator translates it to C, compiled with the flags of the C loop and called through `external`: the
fastest documented way. Branches of the model are `if_else`; CasADi evaluates both sides.
Figures: the largest delay-compensated following error and current only. Generation and compilation are not timed.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

import casadi as ca
import numpy as np

from axis import TICKS_PER_POSITION, TICKS_PER_VELOCITY, Axis
from protocol import Figures, figures, read_input, serve

FLAGS = ("-O3", "-march=native", "-ffast-math", "-fPIC", "-shared")


def clamp(value: ca.SX, limit: ca.SX | float) -> ca.SX:
    """Returns the value limited to ±limit."""
    return ca.fmax(ca.fmin(value, limit), -limit)


def pi(gain, integral_gain, scale, limit, integral, error, feedforward):
    """Returns output and integral of a PI controller."""
    new = integral + integral_gain * error
    unlimited = (gain * error + new + feedforward) * scale
    output = clamp(unlimited, limit)
    return output, ca.if_else(error * (unlimited - output) > 0, integral, new)


def position_period(p: Axis) -> ca.Function:
    """Returns the map from state and setpoints (delayed, then those of both feedforwards) to the next state."""
    state = ca.SX.sym("state", 7)
    psec = ca.SX.sym("psec", 4)
    i, omega, theta, velocity_integral, current_integral, delay_compensated, peak = ca.vertsplit(state)
    # Newest first: one after the delayed setpoint, the delayed setpoint, and two before it.
    after, delayed, before, oldest = ca.vertsplit(psec)
    delay_compensated = ca.fmax(delay_compensated, ca.fabs(delayed - theta * p.ratio))
    velocity_setpoint = clamp(p.position_gain * (delayed / p.ratio - theta), p.max_speed)
    differences = ((delayed - before, before - oldest), (after - delayed, delayed - before))
    current_setpoint = ca.SX(0)
    for t in range(TICKS_PER_POSITION):
        if t % TICKS_PER_VELOCITY == 0:
            first, second = differences[t >= p.delay_step]
            error = velocity_setpoint + p.velocity_feedforward * first - omega
            current_setpoint, velocity_integral = pi(
                p.velocity_gain, p.velocity_integral_gain, 1 / p.torque_constant, p.max_current,
                velocity_integral, error, p.torque_feedforward * (first - second),
            )  # fmt: skip
        voltage, current_integral = pi(
            p.current_gain, p.current_integral_gain, 1, p.max_voltage, current_integral, current_setpoint - i, 0
        )
        peak = ca.fmax(peak, ca.fabs(i))
        v = ca.fabs(omega) * p.velocity_per_speed
        law = p.friction_a * ca.exp(p.friction_b * v) + p.friction_c * ca.exp(p.friction_d * v)
        bound = ca.if_else(omega == 0, p.friction_i0, ca.fmax(law, 0))

        def row(r, torque, now=(i, omega, voltage)):
            return r[0] * now[0] + r[1] * now[1] + r[2] * now[2] + r[3] * torque

        stopping = row(p.speed, 0) / p.speed[3]
        friction = clamp(stopping, bound)
        theta = theta + row(p.angle, -friction)
        i = row(p.current, -friction)
        omega = ca.if_else(friction == stopping, 0, row(p.speed, -friction))
    end = ca.vertcat(i, omega, theta, velocity_integral, current_integral, delay_compensated, peak)
    return ca.Function("period", [state, psec], [end])


def compiled(function: ca.Function) -> ca.Function:
    """Returns the function compiled as C code."""
    with tempfile.TemporaryDirectory() as folder:
        here = os.getcwd()
        os.chdir(folder)
        try:
            function.generate("generated.c")
            subprocess.run(["gcc", *FLAGS, "-o", "generated.so", "generated.c", "-lm"], check=True)
            return ca.external(function.name(), str(Path(folder) / "generated.so"))
        finally:
            os.chdir(here)


def main() -> None:
    """Runs the requests on standard input."""
    joint, axis, psec, values, start = read_input()
    array = np.array(values)
    count = len(values) - start
    at = np.arange(start, len(values)) - axis.delay_periods
    # Before its switch the zero-order hold behind the delay has the delayed setpoint, then the next one.
    shifted = ca.DM(np.vstack([array[at + 1], array[at], array[at - 1], array[at - 2]]))
    function = compiled(position_period(axis).mapaccum("run", count, {"base": count}))
    initial = ca.DM([0, 0, psec[0] / axis.ratio, 0, 0, 0, 0])
    # The call's buffers are allocated once: CasADi's call without conversions.
    buffer, call = function.buffer()
    arguments = [np.array(initial).ravel(order="F"), np.array(shifted).ravel(order="F")]
    result = np.zeros(function.nnz_out(0))
    for index, argument in enumerate(arguments):
        buffer.set_arg(index, memoryview(argument))
    buffer.set_res(0, memoryview(result))

    def run() -> Figures:
        call()
        end = result[-7:]
        return figures(end[5], end[6], position=end[2] * axis.ratio)

    serve(run, joint)


if __name__ == "__main__":
    main()
