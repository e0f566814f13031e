"""The single-axis case in jaxonomy: a LeafSystem with one periodic update every 125 µs, compiled by JAX.

In float64, without recording, the compiled simulator reused for all runs (`jax.jit` of `Simulator.advance_to`, as
documented for repeated runs). The outer loops are selected by their instants inside the update: simultaneous periodic
updates all read the state before the update. Figures: the largest delay-compensated following error and current only.
Tracing and compilation are not timed.
"""

from __future__ import annotations

import jax

from protocol import Figures, figures, read_input, serve

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402  (after the choice of float64)
import jaxonomy  # noqa: E402
from jaxonomy.simulation import SimulatorOptions  # noqa: E402

from axis import CURRENT_PERIOD, TICKS_PER_POSITION, TICKS_PER_VELOCITY, Axis  # noqa: E402


def pi(gain, integral_gain, scale, limit, integral, error, feedforward):
    """Returns output and integral of a PI controller."""
    new = integral + integral_gain * error
    unlimited = (gain * error + new + feedforward) * scale
    output = jnp.clip(unlimited, -limit, limit)
    return output, jnp.where(error * (unlimited - output) > 0.0, integral, new)


class Drive(jaxonomy.LeafSystem):
    """One axis; its state is i, omega, theta, both integrals, held outputs of the loops, and the figures."""

    STATE = 10

    def __init__(self, axis: Axis, psec: list[float], start: int) -> None:
        super().__init__(name="drive")
        self.axis, self.psec, self.start_at = axis, jnp.array(psec), start
        initial = jnp.zeros(self.STATE).at[2].set(psec[0] / axis.ratio)
        self.declare_discrete_state(default_value=initial)
        self.declare_periodic_update(self.tick, period=CURRENT_PERIOD, offset=0.0)

    def tick(self, time, state, *_inputs, **_parameters):
        """Runs the loops that are due, then the plant."""
        p, psec = self.axis, self.psec
        (
            i, omega, theta, velocity_integral, current_integral,
            velocity_setpoint, current_setpoint, n, delay_compensated, peak,
        ) = state.discrete_state  # fmt: skip
        tick = n.astype(jnp.int64)
        t, k = tick % TICKS_PER_POSITION, tick // TICKS_PER_POSITION
        at = self.start_at + k - p.delay_periods
        is_position = t == 0
        error = psec[at] - theta * p.ratio
        delay_compensated = jnp.where(is_position, jnp.maximum(delay_compensated, jnp.abs(error)), delay_compensated)
        unlimited = jnp.clip(p.position_gain * (psec[at] / p.ratio - theta), -p.max_speed, p.max_speed)
        velocity_setpoint = jnp.where(is_position, unlimited, velocity_setpoint)

        at = at + (t >= p.delay_step)
        first, second = psec[at] - psec[at - 1], psec[at - 1] - psec[at - 2]
        output, integral = pi(
            p.velocity_gain, p.velocity_integral_gain, 1 / p.torque_constant, p.max_current, velocity_integral,
            velocity_setpoint + p.velocity_feedforward * first - omega, p.torque_feedforward * (first - second),
        )  # fmt: skip
        is_velocity = t % TICKS_PER_VELOCITY == 0
        current_setpoint = jnp.where(is_velocity, output, current_setpoint)
        velocity_integral = jnp.where(is_velocity, integral, velocity_integral)

        error = current_setpoint - i
        voltage, current_integral = pi(
            p.current_gain, p.current_integral_gain, 1.0, p.max_voltage, current_integral, error, 0.0
        )
        peak = jnp.maximum(peak, jnp.abs(i))
        v = jnp.abs(omega) * p.velocity_per_speed
        law = p.friction_a * jnp.exp(p.friction_b * v) + p.friction_c * jnp.exp(p.friction_d * v)
        bound = jnp.where(omega == 0.0, p.friction_i0, jnp.maximum(law, 0.0))

        def row(r, torque):
            return r[0] * i + r[1] * omega + r[2] * voltage + r[3] * torque

        stopping = row(p.speed, 0.0) / p.speed[3]
        friction = jnp.clip(stopping, -bound, bound)
        return jnp.stack(
            [
                row(p.current, -friction),
                jnp.where(friction == stopping, 0.0, row(p.speed, -friction)),
                theta + row(p.angle, -friction),
                velocity_integral, current_integral, velocity_setpoint, current_setpoint, n + 1,
                delay_compensated, peak,
            ]
        )  # fmt: skip


def main() -> None:
    """Runs the requests on standard input."""
    joint, axis, psec, values, start = read_input()
    system = Drive(axis, values, start)
    ticks = len(psec) * TICKS_PER_POSITION
    # The update at the end of the last cycle must not run.
    end = (ticks - 0.5) * CURRENT_PERIOD
    options = SimulatorOptions(precision="float64", save_time_series=False)
    context = system.create_context()
    simulator = jaxonomy.Simulator(system, options=options)
    advance = jax.jit(simulator.advance_to)

    def run() -> Figures:
        state = advance(end, context).context.discrete_state
        state = jax.block_until_ready(state)
        return figures(state[8], state[9], position=state[2] * axis.ratio)

    serve(run, joint)


if __name__ == "__main__":
    main()
