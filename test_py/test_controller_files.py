"""Parameter files of controllers: the node runs with each, and warns of each value that it cannot follow."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from virtual_axes_py.ros import AxesClient, joint_trajectory

FOLDER = Path(__file__).with_name("controllers")
OTHER_ROBOT = ["joints", "command_interfaces"]
"""Words of the warnings about each controller of another robot with other drives."""
WARNINGS = {
    "six_axis_arm": (
        "welding_arm_controller",
        ["joints", "state_publish_rate", "allow_partial_joints_goal"]
        + [f"constraints.{joint}.{kind}" for joint in ("base_swivel", "flange") for kind in ("trajectory", "goal")],
    ),
    "velocity_arm": (
        "reach_controller",
        [*OTHER_ROBOT, "open_loop_control", "interpolation_method", "gains.lift_axis.p", "constraints.tool_spin.goal"],
    ),
    "effort_arm": (
        "torque_arm_controller",
        [*OTHER_ROBOT, "update_rate", "is_async", "command_joints", "state_interfaces", "gains.q1.p"]
        + ["set_last_command_interface_value_as_state_on_activation", "constraints.decelerate_on_cancel"]
        + [f"constraints.q1.{kind}" for kind in ("trajectory", "goal", "max_deceleration_on_cancel")],
    ),
    "router_gantry": ("router_gantry", ["command_interfaces", "constraints.a.goal"]),
    "twin_gantry": (
        "/hall/portal_controller",
        ["joints", "action_monitor_rate", "supervisor_topic", "constraints.portal_left.trajectory"],
    ),
    "carrier_with_mast": ("mast_controller", ["robot_name", "joints", "state_publish_rate", "gains.mast_lift.p"]),
    "scaled_manipulator": (
        "scaled_controller",
        ["type", "joints", "fallback_controllers", "speed_scaling_interface_name"]
        + ["speed_scaling.initial_scaling_factor", "constraints.pan.trajectory", "constraints.pan.goal"],
    ),
    "swivel_table": ("swivel_table", []),
    "delta_slides": (
        "delta_controller",
        [*OTHER_ROBOT, "command_joints", "allow_integration_in_goal_trajectories", "constraints.slide_1.goal"],
    ),
    "base_with_boom": ("/site/boom_controller", ["joints", "constraints.turret.goal"]),
    "driven_base": (
        "base_controller",
        ["left_wheel_names", "right_wheel_names", "wheel_separation", "pose_covariance_diagonal", "open_loop"],
    ),
    "lathe_loader": ("loader", ["state_publish_rate", "angle_wraparound.x"]),
    "upper_body": (
        "upper_body_controller",
        [*OTHER_ROBOT, "state_interfaces", "gains.l_shoulder.p", "speed_scaling.topic", "speed_scaling_topic_name"]
        + ["default_acceleration_limit", "constraints.l_elbow.goal"],
    ),
    "wrong_types": (
        "loose_controller",
        [*OTHER_ROBOT, "state_interfaces", "action_monitor_rate", "interpolation_method", "cmd_timeout"]
        + ["allow_nonzero_velocity_at_trajectory_end", "constraints.goal_time", "constraints.x.goal"],
    ),
    "unset_values": ("commented_controller", []),
    "mirrored_gantry": ("gantry_controller", ["joints", "mimic.x2", "homing.order", "homing.speed"]),
    "all_defaults": (
        "tilt_controller",
        ["state_interfaces", "allow_partial_joints_goal", "interpolate_from_desired_state", "open_loop_control"]
        + ["thread_priority", "async_parameters.cpu_affinity", "gains.c.p"],
    ),
}
"""Node name of each file and the keys that it warns of, each once; the first key of gains stands for all."""
PRESENT = {
    "router_gantry": (["x", "y", "z"], {"constraints.x.goal": 0.002, "cmd_timeout": 5.0}),
    "twin_gantry": (list("xyzac"), {"constraints.x.trajectory": 0.05, "action_monitor_rate": 20.0}),
    "six_axis_arm": (list("xyzac"), {"goal_time_tolerance": 0.8, "action_monitor_rate": 25.0}),
    "swivel_table": (["a", "c"], {"constraints.cell_c.goal": 0.004}),
    "driven_base": (list("xyzac"), {"publish_rate": 50.0}),
    "lathe_loader": (["x", "y", "z"], {"constraints.x.goal": 0.001, "goal_time_tolerance": 1.0}),
    "unset_values": (["x", "y"], {"goal_time_tolerance": 0.0}),
    "mirrored_gantry": (list("xyzac"), {"constraints.z.goal": 0.0005, "goal_time_tolerance": 2.0}),
    "all_defaults": (["c", "a"], {"constraints.a.goal": 0.1}),
}
"""Joints and parameters with a file."""


@pytest.mark.parametrize("file", WARNINGS)
def test_the_node_runs_with_the_file_of_a_controller(start: Callable[..., AxesClient], file: str) -> None:
    name, keys = WARNINGS[file]
    namespace, _, base = name.rpartition("/")
    names = ["-r", f"__node:={base}", "-r", f"__ns:={namespace or '/'}"]
    drive = start(*names, "--params-file", str(FOLDER / f"{file}.yaml"), name=f"{namespace}/{base}")
    ignored = rf"{file}.yaml:\d+: (?:unknown parameter )?([\w.]+)(?::? .*)?; (?:.*; )?ignored$"
    found = re.findall(ignored, drive.process.output(), re.MULTILINE)
    assert sorted(found) == sorted(keys), drive.process.output()
    joints, parameters = PRESENT.get(file, (list("xyzac"), {}))
    if file != "swivel_table":
        assert drive.get_parameters(["joints", *parameters]) == {"joints": joints} | parameters
        drive.run(joint_trajectory([joints[0]], [0.0, 0.5], [[0.0], [0.002]]))


def test_a_slip_in_a_file_of_this_node_is_rejected(tmp_path: Path) -> None:
    from test_start import rejection

    file = tmp_path / "own.yaml"
    file.write_text("virtual_axes:\n  ros__parameters: {x.velocity_loop.gian: 4.0}\n")
    assert "the nearest is x.velocity_loop.gain" in rejection("--params-file", str(file))
    file.write_text("virtual_axes:\n  ros__parameters: {joints: [x, y, q]}\n")
    assert "q.type is missing" in rejection("--params-file", str(file))
