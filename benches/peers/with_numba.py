"""The single-axis case in numba: one compiled loop, all figures of the C loop.

fastmath is on, like -ffast-math of the C loop. Compilation is not timed.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from axis import CURRENT_PERIOD, TICKS_PER_POSITION, TICKS_PER_VELOCITY, Axis
from protocol import Figures, figures, read_input, serve


@njit(fastmath=True)
def clamp(value: float, limit: float) -> float:
    """Returns the value limited to ±limit."""
    return limit if value > limit else -limit if value < -limit else value


@njit(fastmath=True)
def pi(gain, integral_gain, scale, limit, integral, error, feedforward):
    """Returns output, integral and saturation of a PI controller."""
    new = integral + integral_gain * error
    unlimited = (gain * error + new + feedforward) * scale
    output = clamp(unlimited, limit)
    limited = unlimited != output
    return output, integral if limited and error * (unlimited - output) > 0.0 else new, limited


@njit(fastmath=True)
def row(r, i, omega, voltage, torque):
    """Returns a row of the discretized motor."""
    return r[0] * i + r[1] * omega + r[2] * voltage + r[3] * torque


@njit(fastmath=True)
def simulate(p: Axis, psec: np.ndarray, start: int):
    """Returns the figures of a run from rest at home."""
    i = omega = velocity_integral = current_integral = 0.0
    theta = psec[0] / p.ratio
    current_setpoint = 0.0
    max_tracking = max_delay_compensated = square_tracking = square_delay_compensated = 0.0
    peak = square_activity = last = 0.0
    saturated = 0
    current_limited = False
    inverse_kt, inverse_speed_per_torque = 1.0 / p.torque_constant, 1.0 / p.speed[3]
    for k in range(start, len(psec)):
        delayed = psec[k - p.delay_periods]
        unlimited = p.position_gain * (delayed / p.ratio - theta)
        velocity_setpoint = clamp(unlimited, p.max_speed)
        speed_limited = unlimited != velocity_setpoint
        tracking, delay_compensated = psec[k] - theta * p.ratio, delayed - theta * p.ratio
        max_tracking = max(max_tracking, abs(tracking))
        max_delay_compensated = max(max_delay_compensated, abs(delay_compensated))
        square_tracking += tracking * tracking
        square_delay_compensated += delay_compensated * delay_compensated
        for t in range(TICKS_PER_POSITION):
            if t % TICKS_PER_VELOCITY == 0:
                at = k - p.delay_periods + (1 if t >= p.delay_step else 0)
                first, second = psec[at] - psec[at - 1], psec[at - 1] - psec[at - 2]
                error = velocity_setpoint + p.velocity_feedforward * first - omega
                feedforward = p.torque_feedforward * (first - second)
                current_setpoint, velocity_integral, current_limited = pi(
                    p.velocity_gain, p.velocity_integral_gain, inverse_kt, p.max_current,
                    velocity_integral, error, feedforward,
                )  # fmt: skip
            if t == 0:
                if k > start:
                    square_activity += (current_setpoint - last) ** 2
                last = current_setpoint
            voltage, current_integral, voltage_limited = pi(
                p.current_gain, p.current_integral_gain, 1.0, p.max_voltage,
                current_integral, current_setpoint - i, 0.0,
            )  # fmt: skip
            peak = max(peak, abs(i))
            saturated += speed_limited | current_limited | voltage_limited
            if omega == 0.0:
                bound = p.friction_i0
            else:
                v = abs(omega) * p.velocity_per_speed
                bound = p.friction_a * math.exp(p.friction_b * v) + p.friction_c * math.exp(p.friction_d * v)
                bound = max(bound, 0.0)
            stopping = row(p.speed, i, omega, voltage, 0.0) * inverse_speed_per_torque
            friction = clamp(stopping, bound)
            theta += row(p.angle, i, omega, voltage, -friction)
            i_next = row(p.current, i, omega, voltage, -friction)
            omega = 0.0 if friction == stopping else row(p.speed, i, omega, voltage, -friction)
            i = i_next
    n = len(psec) - start
    return (
        max_tracking, math.sqrt(square_tracking / n), max_delay_compensated, math.sqrt(square_delay_compensated / n),
        peak, saturated * CURRENT_PERIOD, math.sqrt(square_activity / (n - 1)), theta * p.ratio,
    )  # fmt: skip


def main() -> None:
    """Runs the requests on standard input."""
    joint, axis, _, values, start = read_input()
    array = np.array(values)

    def run() -> Figures:
        found = simulate(axis, array, start)
        tracking, rms_tracking, delay_compensated, rms_delay_compensated, peak, saturation, activity, position = found
        return figures(
            delay_compensated,
            peak,
            max_following_error=tracking,
            rms_following_error=rms_tracking,
            rms_delay_compensated_following_error=rms_delay_compensated,
            saturation_time=saturation,
            control_activity=activity,
            position=position,
        )

    serve(run, joint)


if __name__ == "__main__":
    main()
