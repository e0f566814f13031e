#!/usr/bin/env python3
"""Writes crates/core/tests/golden/two_masses.csv: two masses with a spring and a damper, simulated by MuJoCo.

    pip install mujoco==4.0.0
    python tools/golden_two_masses.py

Nothing here is taken from the library: two bodies slide on joints of their own, a tendon over the difference of both
positions is spring and damper, and forces on the bodies are held over intervals. The simulation runs with several steps
of the semi-implicit Euler method (order 1) and of the classical Runge-Kutta method (order 4).
"""

import pathlib

import mujoco

GOLDEN = pathlib.Path(__file__).parent.parent / "crates/core/tests/golden"
# Motor without load and load, kg m^2; N m/rad; N m s/rad; s.
OWN, LOAD = 0.016, 0.012
STIFFNESS, DAMPING = 2000.0, 0.15
TICK = 125e-6
TICKS_PER_INTERVAL = 20
# Torques at the motor and at the load in each interval, N m.
TORQUES = [(3.0, 0.0), (3.0, 0.0), (-1.5, 0.5), (0.0, -2.0), (6.0, -2.0), (-6.0, 1.0), (0.25, 0.0), (0.0, 0.0)] * 2
# Integrator, its order and its steps in a tick.
RUNS = [("Euler", 1, 16), ("Euler", 1, 32), ("Euler", 1, 64), ("RK4", 4, 1), ("RK4", 4, 2), ("RK4", 4, 4)]
MODEL = """
<mujoco>
  <option timestep="{step!r}" integrator="{integrator}" gravity="0 0 0"/>
  <worldbody>
    <body><joint name="motor" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="{own}" diaginertia="1 1 1"/></body>
    <body><joint name="load" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="{load}" diaginertia="1 1 1"/></body>
  </worldbody>
  <tendon>
    <fixed springlength="0" stiffness="{stiffness}" damping="{damping}">
      <joint joint="motor" coef="1"/><joint joint="load" coef="-1"/>
    </fixed>
  </tendon>
</mujoco>
"""


def main():
    """Simulates every run and writes the states at the ends of the intervals."""
    columns = ["order", "steps", "motor_torque", "load_torque", "angle", "speed", "wind_up", "load_speed"]
    lines = [",".join(columns)]
    for integrator, order, steps in RUNS:
        text = MODEL.format(
            step=TICK / steps, integrator=integrator, own=OWN, load=LOAD, stiffness=STIFFNESS, damping=DAMPING
        )
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        for torques in TORQUES:
            data.qfrc_applied[:] = torques
            for _ in range(TICKS_PER_INTERVAL * steps):
                mujoco.mj_step(model, data)
            (motor, load), (speed, load_speed) = data.qpos.tolist(), data.qvel.tolist()
            lines.append(",".join(map(repr, [order, steps, *torques, motor, speed, motor - load, load_speed])))
    (GOLDEN / "two_masses.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
