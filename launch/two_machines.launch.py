"""Two machines side by side in the namespaces left and right, for comparison.

ros2 launch virtual_axes two_machines.launch.py right_controller:=gpc rviz:=true

Give both the same setpoints, on /left/psec and /right/psec. With time:=fast the left one publishes
the clock that the right one follows.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    GroupAction,
    IncludeLaunchDescription,
    OpaqueFunction,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

SHARE = Path(__file__).resolve().parent.parent
CONTROLLERS = ["as_machine", "cascade", "gpc", "rst"]
ARGUMENTS = [
    ("left_machine", "mikron_ucp710", None, "Machine on the left: a file, or the name of a built-in machine"),
    ("right_machine", "mikron_ucp710", None, "Machine on the right"),
    ("left_controller", "as_machine", CONTROLLERS, "Position controller of every joint on the left"),
    ("right_controller", "as_machine", CONTROLLERS, "Position controller of every joint on the right"),
    ("distance", "2.5", None, "Distance of the right machine frame from the left one along X, m"),
    ("time", "real", ["real", "fast", "sim"], "As in virtual_axes.launch.py; with fast the right machine follows"),
    ("use_sim_time", "as_time", ["as_time", "true", "false"], "As in virtual_axes.launch.py"),
    ("robot_state_publisher", "true", ["true", "false"], "Publish models and transforms"),
    ("rviz", "false", ["true", "false"], "Show both in RViz (package rviz2)"),
    ("record", "", None, "Folder for the recordings left.mcap and right.mcap; empty: none"),
    ("log_level", "info", None, "Log level of the nodes"),
    ("respawn", "false", ["true", "false"], "As in virtual_axes.launch.py, for each node"),
    ("memory_limit", "", None, "As in virtual_axes.launch.py, of each node"),
]
SIDES = ["left", "right"]
PASSED = ["time", "use_sim_time", "robot_state_publisher", "log_level", "respawn", "memory_limit"]
"""Arguments of both machines."""


def require_rviz(context: LaunchContext) -> None:
    """Rejects rviz:=true without the package rviz2."""
    try:
        ExecutableInPackage("rviz2", "rviz2").perform(context)
    except Exception as error:
        raise RuntimeError(
            "rviz:=true: package rviz2 not found; install it with "
            "apt install ros-$ROS_DISTRO-rviz2 ros-$ROS_DISTRO-rviz-default-plugins, or leave out rviz:=true"
        ) from error


def start(context: LaunchContext) -> list[object]:
    """Returns both machines, and the common frame `world`."""
    argument = {key: LaunchConfiguration(key).perform(context) for key, *_ in ARGUMENTS}
    clock = {"use_sim_time": argument["time"] != "real" or argument["use_sim_time"] == "true"}
    source = str(SHARE / "launch" / "virtual_axes.launch.py")
    actions: list[object] = []
    for index, side in enumerate(SIDES):
        of_side = {
            "machine": argument[f"{side}_machine"],
            "controller": argument[f"{side}_controller"],
            "namespace": side,
            "name": "virtual_axes",
            "joint_prefix": "",
            "frame_prefix": f"{side}/",
            "rviz": "false",
            "record": str(Path(argument["record"], f"{side}.mcap")) if argument["record"] else "",
            **{key: argument[key] for key in PASSED},
        }
        if argument["time"] == "fast" and index > 0:
            # Only one node may publish the clock.
            of_side |= {"time": "sim", "use_sim_time": "as_time"}
        # In a group: the arguments of one must not reach the other.
        include = IncludeLaunchDescription(PythonLaunchDescriptionSource(source), launch_arguments=of_side.items())
        actions.append(GroupAction([include]))
        if argument["robot_state_publisher"] == "true":
            x = float(argument["distance"]) * index
            actions.append(
                Node(
                    package="tf2_ros",
                    executable="static_transform_publisher",
                    name=f"world_to_{side}",
                    arguments=["--x", str(x), "--frame-id", "world", "--child-frame-id", f"{side}/machine"],
                )
            )
    if argument["rviz"] == "true":
        require_rviz(context)
        config = SHARE / "rviz" / "two_machines.rviz"
        actions.append(Node(package="rviz2", executable="rviz2", arguments=["-d", str(config)], parameters=[clock]))
    return actions


def generate_launch_description() -> LaunchDescription:
    """Declares the arguments and starts the nodes."""
    declared = [
        DeclareLaunchArgument(key, default_value=default, choices=choices, description=description)
        for key, default, choices, description in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
