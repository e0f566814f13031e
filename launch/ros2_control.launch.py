"""Starts ros2_control with simulated drives in place of mock_components/GenericSystem, and its controllers.

ros2 launch virtual_axes ros2_control.launch.py
ros2 launch virtual_axes ros2_control.launch.py controllers:=my_controllers.yaml controller:=gpc
"""

import xml.etree.ElementTree as xml
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = Path(__file__).resolve().parent.parent
CONFIG = SHARE / "ros2_control" / "config"
DEFAULTS = {
    "urdf": SHARE / "urdf" / "mikron_ucp710.urdf",
    "hardware": CONFIG / "mikron_ucp710.ros2_control.xml",
    "controllers": CONFIG / "controllers.yaml",
}
"""Files for empty arguments."""
CONTROLLERS = ["joint_state_broadcaster", "joint_trajectory_controller"]

ARGUMENTS = [
    (
        "urdf",
        "",
        None,
        "Model without `ros2_control` element; empty: urdf/mikron_ucp710.urdf of this package",
    ),
    (
        "hardware",
        "",
        None,
        "File with the `ros2_control` element: plugin, machine, joints; empty: that of mikron_ucp710 with five joints",
    ),
    (
        "controllers",
        "",
        None,
        "Parameters of the controller manager and its controllers; empty: ros2_control/config/controllers.yaml",
    ),
    (
        "controller",
        "as_machine",
        ["as_machine", "cascade", "gpc", "rst"],
        "Position controller of every joint; as_machine: as in the machine file",
    ),
]


def read_file(argument: str, path: str) -> str:
    """Returns the text of a file that an argument names."""
    try:
        return Path(path).expanduser().read_text(encoding="utf-8")
    except OSError as error:
        raise RuntimeError(f"{argument}:={path}: {error.strerror or error}") from error


def robot_description(urdf: str, hardware: str, controller: str) -> str:
    """Returns the URDF with the element <ros2_control>, and in it the position controller."""
    try:
        robot = xml.fromstring(read_file("urdf", urdf))
    except xml.ParseError as error:
        raise RuntimeError(f"urdf:={urdf}: {error}") from error
    try:
        block = xml.fromstring(read_file("hardware", hardware))
    except xml.ParseError as error:
        raise RuntimeError(f"hardware:={hardware}: {error}") from error
    if robot.find("ros2_control") is not None:
        raise RuntimeError(f"urdf:={urdf}: it has an element <ros2_control>; hardware:= gives it in a file of its own")
    found = block.find("hardware")
    if block.tag != "ros2_control" or found is None:
        raise RuntimeError(f"hardware:={hardware}: no element <ros2_control> with <hardware>")
    if controller != "as_machine":
        for old in [item for item in found.findall("param") if item.get("name") == "controller"]:
            found.remove(old)
        xml.SubElement(found, "param", name="controller").text = controller
    robot.append(block)
    return xml.tostring(robot, encoding="unicode")


def start(context: LaunchContext) -> list[object]:
    """Returns the nodes."""
    argument = {key: LaunchConfiguration(key).perform(context) for key, *_ in ARGUMENTS}
    argument |= {key: str(path) for key, path in DEFAULTS.items() if not argument[key]}
    description = robot_description(argument["urdf"], argument["hardware"], argument["controller"])
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            parameters=[{"robot_description": ParameterValue(description, value_type=str)}],
            output="screen",
        ),
        Node(
            package="controller_manager",
            executable="ros2_control_node",
            parameters=[str(Path(argument["controllers"]).expanduser())],
            output="screen",
        ),
        Node(
            package="controller_manager",
            executable="spawner",
            arguments=CONTROLLERS,
            output="screen",
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """Declares the arguments and starts the nodes."""
    declared = [
        DeclareLaunchArgument(key, default_value=default, choices=choices, description=description)
        for key, default, choices, description in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
