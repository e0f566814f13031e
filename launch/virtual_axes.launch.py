"""Starts the virtual axes in a ROS 2 graph, with a model of the machine for RViz.

ros2 launch virtual_axes virtual_axes.launch.py machine:=my_machine.yaml controller:=gpc rviz:=true
ros2 launch virtual_axes virtual_axes.launch.py namespace:=cell frame_prefix:=cell/ time:=fast record:=run.mcap
"""

import subprocess
import tempfile
from pathlib import Path

import yaml
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import ExecutableInPackage

PACKAGE = "virtual_axes"
SHARE = Path(__file__).resolve().parent.parent
DEFAULT_MACHINE = "mikron_ucp710"
PUBLISH_FREQUENCY = 50.0
"""Publish rate of robot_state_publisher, Hz; its default of 20 is not smooth."""

ARGUMENTS = [
    ("machine", DEFAULT_MACHINE, None, "Machine file (ROS 2 parameters), or the name of a built-in machine"),
    (
        "controller",
        "as_machine",
        ["as_machine", "cascade", "gpc", "rst"],
        "Position controller of every joint; as_machine: as in the machine file",
    ),
    ("namespace", "", None, "Namespace of the nodes"),
    ("name", PACKAGE, None, "Name of the node"),
    (
        "jtc_names",
        "false",
        ["true", "false"],
        "Receive trajectories on ~/joint_trajectory instead of psec, as a joint_trajectory_controller with this `name`",
    ),
    (
        "lifecycle",
        "false",
        ["true", "false"],
        "Start as a managed node, which `ros2 lifecycle` or a manager configures and activates",
    ),
    ("joint_prefix", "", None, "Prefix of the joint names"),
    ("frame_prefix", "", None, "Prefix of the frame names, as in cell/"),
    (
        "time",
        "real",
        ["real", "fast", "sim"],
        "Real time; as fast as possible with its own /clock; or following an external /clock",
    ),
    ("use_sim_time", "as_time", ["as_time", "true", "false"], "true: as time:=sim; as_time: as `time` has it"),
    ("robot_state_publisher", "true", ["true", "false"], "Publish the model of the machine and its transforms"),
    ("rviz", "false", ["true", "false"], "Show the machine in RViz (package rviz2)"),
    ("record", "", None, "MCAP file that the node records its topics to; empty: none"),
    ("log_level", "info", None, "Log level of the node"),
    (
        "respawn",
        "false",
        ["true", "false"],
        "Start the node again when it has died, with the same parameters; the log names what is lost. "
        "Invalid arguments (status 2) end the launch",
    ),
    (
        "memory_limit",
        "",
        None,
        "Largest address space of the node, MB, at which it ends (prlimit of util-linux); empty: none",
    ),
]
RESPAWN_DELAY = 1.0
"""Time between the end of the node and its next start, s."""
USAGE_ERROR = 2
"""Exit status of the node for invalid arguments, which a restart does not mend."""
LOST = (
    "lost are the positions (the axes start at 0), running and waiting trajectories, goals and programs, "
    "feed override, loads, and parameters set at run time; kept are all parameters given at the start"
)


def time_source(time: str, use_sim_time: str) -> str:
    """Returns the time source: `time`, or sim if use_sim_time:=true. Rejects contradictions."""
    if (use_sim_time, time) in (("true", "fast"), ("false", "sim")):
        raise RuntimeError(
            f"use_sim_time:={use_sim_time} contradicts time:={time}; use_sim_time:=true is time:=sim, "
            "and with time:=fast the node publishes /clock itself: give only one of the two arguments"
        )
    return "sim" if use_sim_time == "true" else time


def require_rviz(context: LaunchContext) -> None:
    """Rejects rviz:=true without the package rviz2."""
    try:
        ExecutableInPackage("rviz2", "rviz2").perform(context)
    except Exception as error:
        raise RuntimeError(
            "rviz:=true: package rviz2 not found; install it with "
            "apt install ros-$ROS_DISTRO-rviz2 ros-$ROS_DISTRO-rviz-default-plugins, or leave out rviz:=true"
        ) from error


def require_robot_state_publisher(context: LaunchContext) -> None:
    """Rejects robot_state_publisher:=true without its package, before any node starts."""
    try:
        ExecutableInPackage("robot_state_publisher", "robot_state_publisher").perform(context)
    except Exception as error:
        raise RuntimeError(
            "package robot_state_publisher not found; install it with "
            "apt install ros-$ROS_DISTRO-robot-state-publisher, or give robot_state_publisher:=false"
        ) from error


def after_exit(event: ProcessExited, _context: LaunchContext) -> list[object]:
    """Logs what the restart of a node loses, or ends the launch where a restart does not help."""
    if event.returncode == USAGE_ERROR:
        return [Shutdown(reason=f"{event.process_name} has invalid arguments")]
    status = f"{event.process_name} ended with status {event.returncode}"
    return [LogInfo(msg=f"{status} and is started again; {LOST}")] if event.returncode else []


def supervision(argument: dict[str, str]) -> dict[str, object]:
    """Returns the arguments of a node for its restart and its memory limit."""
    found: dict[str, object] = {}
    if argument["respawn"] == "true":
        if argument["record"]:
            raise RuntimeError(
                "respawn:=true contradicts record:=FILE, which exists at the restart; record with ros2 bag record"
            )
        found |= {"respawn": True, "respawn_delay": RESPAWN_DELAY, "on_exit": after_exit}
    if limit := argument["memory_limit"]:
        if not limit.isdecimal() or int(limit) == 0:
            raise RuntimeError(f"memory_limit:={limit} is not a positive whole number of MB")
        found["prefix"] = f"prlimit --as={int(limit) * 1_000_000}"
    return found


def machine_file(machine: str) -> Path:
    """Returns the parameter file of a machine: a path, or the name of a built-in one."""
    built_in = SHARE / "config" / f"{machine}.yaml"
    for path in (Path(machine).expanduser(), built_in):
        if path.is_file():
            return path.resolve()
    names = ", ".join(sorted(path.stem for path in built_in.parent.glob("*.yaml")))
    raise RuntimeError(f"machine:={machine}: file not found; built-in machines: {names}")


def joints_of(machine: Path) -> list[str]:
    """Returns the joint names of a machine."""

    def found(node: object) -> list[str]:
        if not isinstance(node, dict):
            return []
        own = node.get("ros__parameters")
        if isinstance(own, dict):
            return [str(joint) for joint in own.get("joints") or []]
        return next((joints for value in node.values() if (joints := found(value))), [])

    with machine.open(encoding="utf-8") as file:
        joints = found(yaml.safe_load(file))
    if not joints:
        raise RuntimeError(f"{machine}: no joints under ros__parameters")
    return joints


def controller_parameters(controller: str, machine: Path) -> dict[str, object]:
    """Returns the parameters that select this controller for every joint."""
    if controller == "as_machine":
        return {}
    return {f"{joint}.position_loop.controller": controller for joint in joints_of(machine)}


def robot_description(context: LaunchContext, machine: Path, joint_prefix: str) -> tuple[str, list[LogInfo]]:
    """Returns the URDF of the machine from the package's command, and messages for the log."""
    try:
        program = ExecutableInPackage(PACKAGE, PACKAGE).perform(context)
    except Exception as error:
        if machine.stem != DEFAULT_MACHINE or joint_prefix:
            raise RuntimeError(f"no URDF of {machine}: {error}") from error
        installed = SHARE / "urdf" / f"{DEFAULT_MACHINE}.urdf"
        return installed.read_text(encoding="utf-8"), [LogInfo(msg=f"{error}; taking {installed}")]
    command = [program, "urdf", "--machine", str(machine), "--joint-prefix", joint_prefix]
    result = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    if result.returncode:
        raise RuntimeError(f"{result.stderr.strip()} (without the model: robot_state_publisher:=false)")
    return result.stdout, []


def rviz_config(namespace: str, name: str, frame_prefix: str) -> Path:
    """Returns the RViz configuration for these names: the installed one, or a copy with other names."""
    installed = SHARE / "rviz" / "virtual_axes.rviz"
    if not namespace and name == PACKAGE and not frame_prefix:
        return installed
    prefix = f"/{namespace.strip('/')}" if namespace else ""

    def renamed(value: object, key: str = "") -> object:
        if isinstance(value, dict):
            return {inner: renamed(content, inner) for inner, content in value.items()}
        if isinstance(value, list):
            return [renamed(content) for content in value]
        if key == "TF Prefix":
            return frame_prefix.rstrip("/")
        if key in ("Fixed Frame", "Reference Frame") and value == "machine":
            return f"{frame_prefix}{value}"
        if isinstance(value, str) and value.startswith(f"/{PACKAGE}/"):
            return f"{prefix}/{name}/{value.removeprefix(f'/{PACKAGE}/')}"
        return f"{prefix}{value}" if value == "/robot_description" else value

    content = renamed(yaml.safe_load(installed.read_text(encoding="utf-8")))
    with tempfile.NamedTemporaryFile("w", prefix=f"{PACKAGE}_", suffix=".rviz", delete=False) as file:
        yaml.safe_dump(content, file, sort_keys=False)
    return Path(file.name)


def start(context: LaunchContext) -> list[object]:
    """Returns the nodes."""
    argument = {key: LaunchConfiguration(key).perform(context) for key, *_ in ARGUMENTS}
    machine = machine_file(argument["machine"])
    namespace, name, frame_prefix = argument["namespace"], argument["name"], argument["frame_prefix"]
    time = time_source(argument["time"], argument["use_sim_time"])
    clock = {"use_sim_time": time != "real"}

    parameters: dict[str, object] = controller_parameters(argument["controller"], machine)
    parameters |= {"use_sim_time": True} if time == "sim" else {"time": time}
    parameters["joint_prefix"] = ParameterValue(argument["joint_prefix"], value_type=str)
    parameters["workpiece_frame"] = ParameterValue(f"{frame_prefix}workpiece", value_type=str)
    if argument["record"]:
        parameters["record"] = ParameterValue(argument["record"], value_type=str)
    actions: list[object] = [
        Node(
            package=PACKAGE,
            executable="virtual_axes_node",
            name=name,
            namespace=namespace,
            parameters=[str(machine), parameters],
            arguments=["--lifecycle"] if argument["lifecycle"] == "true" else [],
            remappings=[("psec", "~/joint_trajectory")] if argument["jtc_names"] == "true" else [],
            ros_arguments=["--log-level", argument["log_level"]],
            output="screen",
            **supervision(argument),
        )
    ]
    if argument["robot_state_publisher"] == "true":
        require_robot_state_publisher(context)
        description, messages = robot_description(context, machine, argument["joint_prefix"])
        actions += messages
        actions.append(
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                namespace=namespace,
                parameters=[
                    {
                        "robot_description": ParameterValue(description, value_type=str),
                        "frame_prefix": ParameterValue(frame_prefix, value_type=str),
                        "publish_frequency": PUBLISH_FREQUENCY,
                        **clock,
                    }
                ],
            )
        )
    if argument["rviz"] == "true":
        require_rviz(context)
        actions.append(
            Node(
                package="rviz2",
                executable="rviz2",
                namespace=namespace,
                arguments=["-d", str(rviz_config(namespace, name, frame_prefix))],
                parameters=[clock],
            )
        )
    return actions


def generate_launch_description() -> LaunchDescription:
    """Declares the arguments and starts the nodes."""
    declared = [
        DeclareLaunchArgument(key, default_value=default, choices=choices, description=description)
        for key, default, choices, description in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
