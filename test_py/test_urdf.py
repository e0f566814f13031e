"""The URDF: read by ROS's own parsers, limits compared with the machine file, geometry with the kinematics.

`urdf_parser_py` and `check_urdf` (urdfdom, which robot_state_publisher uses) come from PyPI.
"""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from urdf_parser_py.urdf import URDF, Joint

from node_process import node_binary
from reference_kinematics import OFFSETS, tool_pose

ROOT = Path(__file__).resolve().parent.parent
TWO_TABLES = ["mikron_ucp710", "linear_motor_center"]
MACHINES = [*TWO_TABLES, "vmc", "hmc", "gantry_router", "bc_center", "ac_center", "vmc_a", "fork_head"]


def command(*arguments: str) -> str:
    """Runs `virtual_axes` beside the node and returns its output."""
    program = node_binary().with_name("virtual_axes")
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True, timeout=60).stdout


def machine_file(name: str) -> dict:
    """Reads the parameters of a built-in machine with another YAML parser."""
    return yaml.safe_load((ROOT / "config" / f"{name}.yaml").read_text())["/**"]["ros__parameters"]


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Returns the rotation by `angle` about the unit vector `axis` (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def transform(joint: Joint, value: float) -> np.ndarray:
    """Returns the pose of the child in the parent, by the URDF specification."""
    roll, pitch, yaw = joint.origin.rpy
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(np.eye(3)[2], yaw) @ rotation(np.eye(3)[1], pitch) @ rotation(np.eye(3)[0], roll)
    matrix[:3, 3] = joint.origin.xyz
    motion = np.eye(4)
    if joint.type == "prismatic":
        motion[:3, 3] = value * np.array(joint.axis)
    elif joint.type != "fixed":
        motion[:3, :3] = rotation(np.array(joint.axis), value)
    return matrix @ motion


def frame(robot: URDF, link: str, joints: dict[str, float]) -> np.ndarray:
    """Returns the pose of the link in the root."""
    matrix = np.eye(4)
    for name in robot.get_chain(robot.get_root(), link, links=False):
        joint = robot.joint_map[name]
        matrix = matrix @ transform(joint, joints.get(name, 0.0))
    return matrix


@pytest.mark.parametrize("machine", MACHINES)
def test_limits_equal_the_machine_file(machine: str):
    """Names and kinds as in joint_states; travel limits, velocity and effort in SI."""
    robot = URDF.from_xml_string(command("urdf", "--machine", machine, "--joint-prefix", "mill_"))
    parameters = machine_file(machine)
    moving = {name: joint for name, joint in robot.joint_map.items() if joint.type != "fixed"}
    assert sorted(moving) == sorted(f"mill_{joint}" for joint in parameters["joints"])
    for name in parameters["joints"]:
        axis, joint = parameters[name], moving[f"mill_{name}"]
        limits, motor, transmission = axis["limits"], axis["motor"], axis["transmission"]
        linear = axis["type"] == "linear"
        velocity = limits["velocity_m_min"] / 60 if linear else limits["velocity_rpm"] * 2 * math.pi / 60
        ends = [limits.get(f"travel_{end}_{'mm' if linear else 'deg'}") for end in ("min", "max")]
        if ends == [None, None] and not linear:
            assert joint.type == "continuous"
        else:
            assert joint.type == ("prismatic" if linear else "revolute")
            unit = 1e-3 if linear else math.pi / 180
            travel = [end * unit for end in ends]
            assert [joint.limit.lower, joint.limit.upper] == pytest.approx(travel, rel=1e-12)
        if transmission.get("direct"):
            ratio = 1.0
        else:
            ratio = transmission["screw_lead_mm"] * 1e-3 / (2 * math.pi) if linear else 1 / transmission["gear_ratio"]
        torque = motor["force_constant_n_a"] if "force_constant_n_a" in motor else motor["torque_constant_nm_a"]
        assert joint.limit.velocity == pytest.approx(velocity, rel=1e-12)
        assert joint.limit.effort == pytest.approx(torque * motor["max_current_a"] / ratio, rel=1e-12)


@pytest.mark.parametrize("machine", MACHINES)
def test_the_tool_in_the_workpiece_equals_the_kinematics(machine: str):
    """URDF, `virtual_axes pose` and, for two tables, the documented equations, with all offsets."""
    offsets = OFFSETS | {"pivot_b_x": 19.0, "pivot_b_z": 43.0}
    settings = [text for key, value in offsets.items() for text in ("--set", f"kinematics.{key}_mm={value}")]
    robot = URDF.from_xml_string(command("urdf", "--machine", machine, *settings))
    assert robot.get_root() == "machine"
    random = np.random.default_rng(710)
    names = machine_file(machine)["joints"]
    bounds = [{"x": 0.3, "y": 0.2, "z": 0.2, "a": math.pi, "b": math.pi, "c": 20.0}[name] for name in names]
    trials = random.uniform(np.negative(bounds), bounds, (60, len(names)))
    positions = [f"--joints={','.join(f'{n}={v!r}' for n, v in zip(names, row))}" for row in trials.tolist()]
    poses = json.loads(command("pose", "--machine", machine, "--json", *settings, *positions))
    largest = 0.0
    for row, pose in zip(trials.tolist(), poses, strict=True):
        joints = dict(zip(names, row))
        seen = np.linalg.inv(frame(robot, "workpiece", joints)) @ frame(robot, "tool", joints)
        x, y, z, w = pose["orientation"]
        sine = math.sqrt(x * x + y * y + z * z)
        turned = rotation(np.array([x, y, z]) / (sine or 1.0), 2 * math.atan2(sine, w))
        errors = [seen[:3, 3] - pose["tip"], seen[:3, 2] - pose["axis"], seen[:3, :3] - turned]
        if machine in TWO_TABLES:
            tip, orientation = tool_pose(**joints)
            errors += [tip - pose["tip"], orientation[:, 2] - pose["axis"]]
        largest = max(largest, *(np.abs(error).max() for error in errors))
    print(f"{machine}: largest difference {largest:.1e}")
    assert largest < 1e-9


def test_a_positive_joint_moves_the_tool_relative_to_the_workpiece():
    """ISO 841 for each axis: rotations relative to the table, with the tool at home."""
    robot = URDF.from_xml_string(command("urdf"))

    def tool(**joints: float) -> np.ndarray:
        return np.linalg.inv(frame(robot, "workpiece", joints)) @ frame(robot, "tool", joints)

    for index, name in enumerate("xyz"):
        assert tool(**{name: 0.1})[:3, 3] - tool()[:3, 3] == pytest.approx(0.1 * np.eye(3)[index], abs=1e-15)
    # A right-handed rotation of the tool about X turns its axis from Z towards -Y; about Z, X towards Y.
    assert tool(a=math.pi / 2)[:3, 2] == pytest.approx([0.0, -1.0, 0.0], abs=1e-15)
    assert tool(c=math.pi / 2)[:3, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    # The tables rotate in the opposite direction.
    assert frame(robot, "cradle", {"a": math.pi / 2})[:3, 2] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    assert frame(robot, "table", {"c": math.pi / 2})[:3, 0] == pytest.approx([0.0, -1.0, 0.0], abs=1e-15)


@pytest.mark.parametrize("machine", MACHINES)
def test_urdfdom_parses_it(machine: str, tmp_path: Path):
    """The parser of robot_state_publisher reads one tree without errors."""
    path = tmp_path / "machine.urdf"
    command("urdf", "--machine", machine, "--out", str(path))
    answer = subprocess.run(["check_urdf", path], capture_output=True, text=True, timeout=20, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert "root Link: machine has 3 child(ren)" in answer.stdout
    assert answer.stderr == ""


@pytest.mark.parametrize("machine", MACHINES)
def test_every_body_has_collision_shapes_and_inertia(machine: str):
    """Gazebo drops links without inertia, and MoveIt plans through links without shapes; KDL wants none at the root."""
    robot = URDF.from_xml_string(command("urdf", "--machine", machine))
    assert robot.link_map[robot.get_root()].inertial is None
    bodies = {name: link for name, link in robot.link_map.items() if link.visuals}
    assert robot.link_map.keys() - bodies.keys() <= {"machine", "workpiece", "tool"}
    for name, link in bodies.items():
        shapes = [(shape.origin.xyz, shape.origin.rpy, vars(shape.geometry)) for shape in link.visuals]
        assert [(shape.origin.xyz, shape.origin.rpy, vars(shape.geometry)) for shape in link.collisions] == shapes
        inertia = link.inertial.inertia.to_matrix()
        moments = np.linalg.eigvalsh(inertia)
        # A rigid body: positive, and no moment is larger than the sum of the others.
        assert moments[0] > 0 and moments[2] < moments[0] + moments[1], name
        # The same by points at random in the shapes.
        random = np.random.default_rng(1)
        points, masses = [], []
        for origin, (_, pitch, _), geometry in shapes:
            if "size" in geometry:
                cloud = random.uniform(-0.5, 0.5, (200_000, 3)) * geometry["size"]
                mass = 1800 * np.prod(geometry["size"])
            else:
                radius, length = geometry["radius"], geometry["length"]
                angle, share = random.uniform(0, 2 * math.pi, 200_000), np.sqrt(random.uniform(0, 1, 200_000))
                x, y = radius * share * np.cos(angle), radius * share * np.sin(angle)
                cloud = np.column_stack([x, y, random.uniform(-0.5, 0.5, 200_000) * length])
                mass = 1800 * math.pi * radius**2 * length
            points.append(cloud @ rotation(np.array([0.0, 1.0, 0.0]), pitch).T + origin)
            masses.append(np.full(len(cloud), mass / len(cloud)))
        cloud, weights = np.concatenate(points), np.concatenate(masses)
        assert link.inertial.mass == pytest.approx(weights.sum(), rel=1e-9)
        center = weights @ cloud / weights.sum()
        assert link.inertial.origin.xyz == pytest.approx(center, abs=3e-3)
        offsets = cloud - link.inertial.origin.xyz
        sampled = np.eye(3) * (weights @ (offsets**2).sum(1)) - (offsets.T * weights) @ offsets
        assert inertia == pytest.approx(sampled, abs=1e-2 * moments[2])
