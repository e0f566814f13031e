"""Reference implementation of the documented kinematics: tool tip and tool axis, with all offsets."""

from __future__ import annotations

import math

import numpy as np

# All offsets of the kinematics, all different so that swapped offsets are detected, mm.
OFFSETS = {
    "tool_length": 123.0,
    "pivot_a_y": 11.0,
    "pivot_a_z": -37.0,
    "pivot_c_x": 5.0,
    "pivot_c_y": -7.0,
    "workpiece_x": 60.0,
    "workpiece_y": 17.0,
    "workpiece_z": -29.0,
}


def turn(axis: int, angle: float) -> np.ndarray:
    """Returns the right-handed rotation about X (0) or Z (2)."""
    i, j = {0: (1, 2), 2: (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = math.cos(angle)
    matrix[i, j], matrix[j, i] = -math.sin(angle), math.sin(angle)
    return matrix


def tool_pose(x: float, y: float, z: float, a: float, c: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns tip (m) and orientation of the tool in the workpiece frame; the last column is the tool axis."""
    p = {key: value * 1e-3 for key, value in OFFSETS.items()}
    pivot_a = np.array([0.0, p["pivot_a_y"], p["pivot_a_z"]])
    pivot_c = np.array([p["pivot_c_x"], p["pivot_c_y"], 0.0])
    workpiece = np.array([p["workpiece_x"], p["workpiece_y"], p["workpiece_z"]])
    tip = turn(0, a) @ (np.array([x, y, z - p["tool_length"]]) - pivot_a) + pivot_a - pivot_c
    return turn(2, c) @ tip + pivot_c - workpiece, turn(2, c) @ turn(0, a)
