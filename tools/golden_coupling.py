#!/usr/bin/env python3
"""Writes workpieces.csv and workpiece_motion.csv of crates/core/tests/golden: a body on two tables, computed by MuJoCo.

    pip install mujoco==4.0.0
    python tools/golden_coupling.py

Nothing here is taken from the library: MuJoCo gets the bodies and their joints, A about -X through its pivot and C
about -Z through its own, and computes mass matrices, gravity, velocity torques and motion. workpieces.csv has random
workpieces in random states; workpiece_motion.csv has a motion after torques of 48 ms at both joints, by the classical
Runge-Kutta method with small steps. Lengths in m, angles in rad, torques in N m.
"""

import math
import pathlib
import random

import mujoco
import numpy

GOLDEN = pathlib.Path(__file__).parent.parent / "crates/core/tests/golden"
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


def write(name, columns, rows):
    """Writes a table."""
    lines = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in rows)]
    (GOLDEN / name).write_text("\n".join(lines) + "\n")


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
        rows.append([*points, *body, *position, *velocity, *matrix, *gravity, *both])
    columns = [*POINTS, *BODY, "a", "c", "velocity_a", "velocity_c", "m_aa", "m_ac", "m_ca", "m_cc"]
    columns += ["gravity_a", "gravity_c", "gravity_and_velocity_a", "gravity_and_velocity_c"]
    write("workpieces.csv", columns, rows)


def write_motion():
    """Simulates a motion."""
    model = model_of(MOTION_POINTS, MOTION_BODY, ARMATURES, INTERVAL / STEPS)
    data = mujoco.MjData(model)
    rows = []
    for interval in range(INTERVALS):
        data.qfrc_applied[:] = TORQUES if interval == 0 else (0.0, 0.0)
        for _ in range(STEPS):
            mujoco.mj_step(model, data)
        rows.append([*data.qpos.tolist(), *data.qvel.tolist()])
    write("workpiece_motion.csv", ["a", "c", "velocity_a", "velocity_c"], rows)


if __name__ == "__main__":
    write_states()
    write_motion()
