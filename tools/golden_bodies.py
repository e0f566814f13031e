#!/usr/bin/env python3
"""Writes workpieces.csv, workpiece_motion.csv and two_masses.csv of crates/core/tests/golden, computed by MuJoCo.

    pip install mujoco==4.0.0
    python tools/golden_bodies.py

Nothing here is taken from the library. For a body on two tables MuJoCo gets the bodies and their joints, A about -X
through its pivot and C about -Z through its own, and computes mass matrices, gravity, velocity torques and motion.
workpieces.csv has random workpieces in random states; workpiece_motion.csv has a motion after torques of 48 ms at both
joints, by the classical Runge-Kutta method with small steps. two_masses.csv has a motor with an elastic load: two
bodies slide on joints of their own, a tendon over the difference of both positions is spring and damper, and forces are
held over intervals; with several steps of the semi-implicit Euler method (order 1) and of the classical Runge-Kutta
method (order 4). Lengths in m, angles in rad, torques in N m.
"""

import math
import random

import mujoco
import numpy

from golden import write

SEED = 17
COUNT = 40
POINTS = ("pivot_a_y", "pivot_a_z", "pivot_c_x", "pivot_c_y", "workpiece_x", "workpiece_y", "workpiece_z")
BODY = ("mass", "center_x", "center_y", "center_z", "inertia_x", "inertia_y", "inertia_z")
# The tilting table itself has the smallest mass that MuJoCo accepts.
# Body of the motion: no gravity torque at home; inertias of both axes; torques of the first 48 ms.
MOTION_POINTS = (0.03, -0.05, 0.01, 0.02, 0.0, 0.0, 0.1)
MOTION_BODY = (400.0, 0.2, 0.03, 0.05, 12.0, 9.0, 15.0)
ARMATURES = (0.001 * 180**2, 0.001 * 120**2)
TORQUES = (900.0, -500.0)
# Torques act over the first of the intervals; steps in an interval.
INTERVAL = 0.048
INTERVALS = 20
STEPS = 4800
MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step!r}" integrator="RK4" gravity="0 0 -9.80665"/>
  <worldbody>
    <body name="tilting" pos="0 {pivot_a_y!r} {pivot_a_z!r}">
      <joint name="a" type="hinge" axis="-1 0 0" armature="{armature_a!r}"/>
      <inertial pos="0 0 0" mass="1e-14" diaginertia="1e-14 1e-14 1e-14"/>
      <body name="rotary" pos="{c_x!r} {c_y!r} {c_z!r}">
        <joint name="c" type="hinge" axis="0 0 -1" armature="{armature_c!r}"/>
        <inertial pos="{x!r} {y!r} {z!r}" mass="{mass!r}" diaginertia="{inertia_x!r} {inertia_y!r} {inertia_z!r}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def model_of(points, body, armatures=(0.0, 0.0), step=1e-5):
    """Returns the model of a body on both tables."""
    p, b = dict(zip(POINTS, points, strict=True)), dict(zip(BODY, body, strict=True))
    text = MODEL.format(
        **p,
        **b,
        step=step,
        armature_a=armatures[0],
        armature_c=armatures[1],
        c_x=p["pivot_c_x"],
        c_y=p["pivot_c_y"] - p["pivot_a_y"],
        c_z=-p["pivot_a_z"],
        x=p["workpiece_x"] + b["center_x"] - p["pivot_c_x"],
        y=p["workpiece_y"] + b["center_y"] - p["pivot_c_y"],
        z=p["workpiece_z"] + b["center_z"],
    )
    return mujoco.MjModel.from_xml_string(text)


def torques(model, position, velocity):
    """Returns the mass matrix and the torques that gravity and velocities need, in a state."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = position, velocity
    mujoco.mj_forward(model, data)
    matrix = numpy.zeros((2, 2))
    mujoco.mj_fullM(model, data, matrix)
    return matrix.ravel().tolist(), data.qfrc_bias.tolist()


def write_states():
    """Draws workpieces and states."""
    source = random.Random(SEED)
    rows = []
    for _ in range(COUNT):
        points = [source.uniform(-0.3, 0.3) for _ in POINTS]
        sides = [source.uniform(0.05, 0.8) for _ in range(3)]
        mass = 10 ** source.uniform(-1, 3)
        squares = [side**2 for side in sides]
        inertia = [mass * (sum(squares) - square) / 12 for square in squares]
        body = [mass, *(source.uniform(-0.4, 0.4) for _ in range(3)), *inertia]
        position = [source.uniform(-math.pi, math.pi) for _ in range(2)]
        velocity = [source.uniform(-3, 3) for _ in range(2)]
        model = model_of(points, body)
        matrix, both = torques(model, position, velocity)
        gravity = torques(model, position, [0.0, 0.0])[1]
        rows.append(map(repr, [*points, *body, *position, *velocity, *matrix, *gravity, *both]))
    columns = [*POINTS, *BODY, "a", "c", "velocity_a", "velocity_c", "m_aa", "m_ac", "m_ca", "m_cc"]
    columns += ["gravity_a", "gravity_c", "gravity_and_velocity_a", "gravity_and_velocity_c"]
    write("workpieces", columns, rows)


def write_motion():
    """Simulates a motion."""
    model = model_of(MOTION_POINTS, MOTION_BODY, ARMATURES, INTERVAL / STEPS)
    data = mujoco.MjData(model)
    rows = []
    for interval in range(INTERVALS):
        data.qfrc_applied[:] = TORQUES if interval == 0 else (0.0, 0.0)
        for _ in range(STEPS):
            mujoco.mj_step(model, data)
        rows.append(map(repr, [*data.qpos.tolist(), *data.qvel.tolist()]))
    write("workpiece_motion", ["a", "c", "velocity_a", "velocity_c"], rows)


# Motor without load and load, kg m^2; N m/rad; N m s/rad; s.
OWN, LOAD = 0.016, 0.012
STIFFNESS, DAMPING = 2000.0, 0.15
TICK = 125e-6
TICKS_PER_INTERVAL = 20
# Torques at the motor and at the load in each interval, N m.
HELD_TORQUES = [(3.0, 0.0), (3.0, 0.0), (-1.5, 0.5), (0.0, -2.0), (6.0, -2.0), (-6.0, 1.0), (0.25, 0.0), (0.0, 0.0)] * 2
# Integrator, its order and its steps in a tick.
RUNS = [("Euler", 1, 16), ("Euler", 1, 32), ("Euler", 1, 64), ("RK4", 4, 1), ("RK4", 4, 2), ("RK4", 4, 4)]
TWO_MASSES = """
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


def write_two_masses():
    """Simulates every run of two masses and writes the states at the ends of the intervals."""
    columns = ["order", "steps", "motor_torque", "load_torque", "angle", "speed", "wind_up", "load_speed"]
    rows = []
    for integrator, order, steps in RUNS:
        text = TWO_MASSES.format(
            step=TICK / steps, integrator=integrator, own=OWN, load=LOAD, stiffness=STIFFNESS, damping=DAMPING
        )
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        for torques in HELD_TORQUES:
            data.qfrc_applied[:] = torques
            for _ in range(TICKS_PER_INTERVAL * steps):
                mujoco.mj_step(model, data)
            (motor, load), (speed, load_speed) = data.qpos.tolist(), data.qvel.tolist()
            rows.append(map(repr, [order, steps, *torques, motor, speed, motor - load, load_speed]))
    write("two_masses", columns, rows)


if __name__ == "__main__":
    write_states()
    write_motion()
    write_two_masses()
