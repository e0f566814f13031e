"""One axis of the machine table in SI units, as plain numbers for all Python contenders."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

from scipy.linalg import expm

from cases import POSITION_PERIOD

VELOCITY_PERIOD = 250e-6
CURRENT_PERIOD = 125e-6
TICKS_PER_POSITION = round(POSITION_PERIOD / CURRENT_PERIOD)
TICKS_PER_VELOCITY = round(VELOCITY_PERIOD / CURRENT_PERIOD)

Row = tuple[float, float, float, float]


class Axis(NamedTuple):
    """Constants of an axis; the names are those of drive.h."""

    current: Row
    speed: Row
    angle: Row
    ratio: float
    torque_constant: float
    emf_constant: float
    resistance: float
    inductance: float
    inertia: float
    max_speed: float
    velocity_per_speed: float
    friction_a: float
    friction_b: float
    friction_c: float
    friction_d: float
    friction_i0: float
    position_gain: float
    velocity_feedforward: float
    torque_feedforward: float
    velocity_gain: float
    velocity_integral_gain: float
    max_current: float
    current_gain: float
    current_integral_gain: float
    max_voltage: float
    delay_periods: int
    delay_step: int


def read_axis(path: Path, joint: str) -> Axis:
    """Returns an axis of a table. Restricted to the single-axis case: no weight, and equal delays."""
    rows = [line.split() for line in path.read_text().splitlines() if line and not line.startswith("#")]
    table = {key: values for key, *values in rows}
    column = table["joint"].index(joint)

    def value(key: str) -> float:
        return float(table[key][column])

    if any(value(key) for key in ("weight_n", "tilt_nm", "rotary")):
        raise ValueError(f"{joint}: expected a linear axis without weight")
    if len({value(f"{delay}_ms") for delay in ("alpha", "beta", "gamma")}) != 1:
        raise ValueError(f"{joint}: alpha, beta and gamma must be equal")
    r = value("screw_lead_mm") * 1e-3 / (2 * math.pi)
    kt, ke, resistance = (value(k) for k in ("torque_constant_nm_a", "emf_constant_v_s_rad", "resistance_ohm"))
    inductance, inertia = value("inductance_mh") * 1e-3, value("inertia_kg_m2")
    # i, omega, theta, and the held u and torque.
    a = [[0.0] * 5 for _ in range(5)]
    a[0][0], a[0][1], a[0][3] = -resistance / inductance, -ke / inductance, 1 / inductance
    a[1][0], a[1][4] = kt / inertia, 1 / inertia
    a[2][1] = 1.0
    e = expm([[entry * CURRENT_PERIOD for entry in row] for row in a])
    rows_of_motor = [tuple(float(e[k, c]) for c in (0, 1, 3, 4)) for k in range(3)]
    kv, ki = value("velocity_gain"), value("current_gain")
    delay, step = divmod(round(value("alpha_ms") * 1e-3 / CURRENT_PERIOD), TICKS_PER_POSITION)
    return Axis(
        *rows_of_motor,
        ratio=r,
        torque_constant=kt,
        emf_constant=ke,
        resistance=resistance,
        inductance=inductance,
        inertia=inertia,
        max_speed=value("max_speed_rpm") * 2 * math.pi / 60,
        velocity_per_speed=r * 60,
        friction_a=kt * value("friction_a"),
        friction_b=value("friction_b"),
        friction_c=kt * value("friction_c"),
        friction_d=value("friction_d"),
        friction_i0=kt * value("friction_i0"),
        position_gain=value("position_gain") * 1000 / 60,
        velocity_feedforward=value("velocity_feedforward") / POSITION_PERIOD / r,
        torque_feedforward=value("torque_feedforward") / POSITION_PERIOD**2 / r,
        velocity_gain=kv,
        velocity_integral_gain=kv * VELOCITY_PERIOD / (value("velocity_time_ms") * 1e-3),
        max_current=value("max_current_a"),
        current_gain=ki,
        current_integral_gain=ki * CURRENT_PERIOD / (value("current_time_ms") * 1e-3),
        max_voltage=value("max_voltage_v"),
        delay_periods=delay + 1 if step else delay,
        delay_step=step if step else TICKS_PER_POSITION,
    )


def padded(psec: list[float], axis: Axis) -> tuple[list[float], int]:
    """Returns the setpoints with the first one repeated before the start, and the index of the start."""
    before = axis.delay_periods + 2
    return [psec[0]] * before + psec, before
