"""Launch files, executed with a stand-in of launch's interface, and nodes with the resulting arguments."""

from __future__ import annotations

import re
import subprocess
from contextlib import ExitStack
from pathlib import Path

import launch
import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from launch.actions import DeclareLaunchArgument, LogInfo
from launch_ros import substitutions
from launch_ros.actions import Node as NodeAction
from urdf_parser_py.urdf import URDF

from launch_graph import ROOT, actions, by_executable, description, nodes
from node_process import Node, node_binary
from virtual_axes_py.ros import AxesClient, joint_trajectory

ONE, TWO = "virtual_axes.launch.py", "two_machines.launch.py"


def process(node: NodeAction, stack: ExitStack, domain_id: int | None = None) -> Node:
    """Returns the process of this package's node with the arguments from launch."""
    assert node.command[0] == "--ros-args"
    name = f"/{node.namespace.strip('/')}/{node.name}" if node.namespace else f"/{node.name}"
    return stack.enter_context(Node(node.command[1:], name=name, domain_id=domain_id))


@pytest.mark.parametrize("file", [ONE, TWO])
def test_arguments_are_described_and_have_defaults(file: str):
    """`ros2 launch -s` shows a description for each argument, and none is required."""
    declared = [entity for entity in description(file).entities if isinstance(entity, DeclareLaunchArgument)]
    assert len(declared) > 8
    for argument in declared:
        assert argument.description and argument.default_value is not None, argument.name


def test_by_default_the_node_and_its_model_start():
    """Without arguments: no RViz, no recording, real time; the model is the checked-in URDF."""
    found = by_executable(nodes(ONE))
    assert sorted(found) == ["robot_state_publisher", "virtual_axes_node"]
    [node], [publisher] = found["virtual_axes_node"], found["robot_state_publisher"]
    assert node.values == {"time": "real", "joint_prefix": "", "workpiece_frame": "workpiece"}
    assert node.files[0] == str(ROOT / "config" / "mikron_ucp710.yaml")
    built_in = (ROOT / "urdf" / "mikron_ucp710.urdf").read_text()
    assert publisher.values["robot_description"] == built_in
    assert publisher.values["use_sim_time"] is False


def test_every_argument_arrives(tmp_path: Path):
    """The given values are passed to the nodes."""
    arguments = {
        "machine": "linear_motor_center",
        "controller": "gpc",
        "namespace": "cell",
        "name": "mill",
        "joint_prefix": "m_",
        "frame_prefix": "cell/",
        "time": "fast",
        "rviz": "true",
        "record": str(tmp_path / "run.mcap"),
        "log_level": "debug",
    }
    found = by_executable(nodes(ONE, **arguments))
    [node], [publisher], [rviz] = (found[e] for e in ("virtual_axes_node", "robot_state_publisher", "rviz2"))
    assert {f"{joint}.position_loop.controller" for joint in "xyzac"} <= node.values.keys()
    assert node.values["x.position_loop.controller"] == "gpc"
    assert node.values["record"] == arguments["record"]
    assert (node.values["time"], node.values["workpiece_frame"]) == ("fast", "cell/workpiece")
    assert node.command[1:3] == ["--log-level", "debug"]
    assert "__node:=mill" in node.command and "__ns:=/cell" in node.command
    robot = URDF.from_xml_string(publisher.values["robot_description"])
    assert {"m_x", "m_c"} <= robot.joint_map.keys()
    assert (publisher.namespace, publisher.values["frame_prefix"]) == ("cell", "cell/")
    assert publisher.values["use_sim_time"] is True and rviz.values["use_sim_time"] is True
    config = yaml.safe_load(Path(rviz.arguments[1]).read_text())["Visualization Manager"]
    assert config["Global Options"]["Fixed Frame"] == "cell/machine"
    topics = {d["Topic"]["Value"] for d in config["Displays"] if "Topic" in d}
    assert topics == {f"/cell/mill/{topic}" for topic in ("tool_pose", "tool_path", "tool_path_setpoint")}
    [model] = [d for d in config["Displays"] if d["Class"].endswith("RobotModel")]
    assert (model["Description Topic"]["Value"], model["TF Prefix"]) == ("/cell/robot_description", "cell")


def test_simulated_time_is_use_sim_time():
    """The node gets no `time` parameter; the model can be left out."""
    [node] = nodes(ONE, time="sim", robot_state_publisher="false")
    assert node.values["use_sim_time"] is True
    assert "time" not in node.values


@pytest.mark.parametrize("file", [ONE, TWO])
def test_use_sim_time_is_time_sim(file: str):
    """`use_sim_time:=true` alone selects simulated time for every node; `false` keeps real and fast."""
    found = by_executable(nodes(file, use_sim_time="true"))
    for node in found["virtual_axes_node"] + found["robot_state_publisher"]:
        assert node.values["use_sim_time"] is True and "time" not in node.values
    for time in ("real", "fast"):
        first, *others = by_executable(nodes(file, use_sim_time="false", time=time))["virtual_axes_node"]
        assert first.values["time"] == time and "use_sim_time" not in first.values
        # Only one node may publish the clock.
        assert all(other.values.get("use_sim_time", False) == (time == "fast") for other in others)


@pytest.mark.parametrize("file", [ONE, TWO])
@pytest.mark.parametrize(("use_sim_time", "time"), [("true", "fast"), ("false", "sim")])
def test_contradicting_time_arguments_are_rejected(file: str, use_sim_time: str, time: str):
    """The message contains both arguments."""
    with pytest.raises(RuntimeError, match=f"use_sim_time:={use_sim_time} contradicts time:={time}"):
        nodes(file, use_sim_time=use_sim_time, time=time)


@pytest.mark.parametrize("file", [ONE, TWO])
def test_rviz_without_its_package_is_rejected(file: str, monkeypatch: pytest.MonkeyPatch):
    """The message names the Debian packages."""
    monkeypatch.delitem(substitutions.PROGRAMS, ("rviz2", "rviz2"))
    with pytest.raises(RuntimeError, match=r"ros-\$ROS_DISTRO-rviz2 ros-\$ROS_DISTRO-rviz-default-plugins"):
        nodes(file, rviz="true", robot_state_publisher="false")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"machine": "no_such"}, ["no_such", "mikron_ucp710", "linear_motor_center"]),
        ({"controller": "pid"}, ["controller", "pid", "cascade"]),
        ({"time": "slow"}, ["time", "slow", "real"]),
        ({"rviz": "yes"}, ["rviz", "yes", "true"]),
    ],
)
def test_what_cannot_be_is_rejected(arguments: dict[str, str], words: list[str]):
    """The message names the argument, the value found and the allowed values."""
    with pytest.raises(RuntimeError) as error:
        nodes(ONE, **arguments)
    for word in words:
        assert word in str(error.value)


def test_a_machine_without_kinematics_is_rejected_unless_the_model_is_off(tmp_path: Path):
    """The message contains the command's own reason."""
    text = (ROOT / "config" / "mikron_ucp710.yaml").read_text()
    changed = text.replace('"a", "c"]', '"a", "b"]').replace("\n    c:\n", "\n    b:\n")
    assert changed.count("b:") > text.count("b:")
    machine = tmp_path / "b.yaml"
    machine.write_text(changed)
    with pytest.raises(RuntimeError, match=r"joint b \(rotary\) has no role.*robot_state_publisher:=false"):
        nodes(ONE, machine=str(machine))
    assert len(nodes(ONE, machine=str(machine), robot_state_publisher="false")) == 1


def test_without_the_command_the_built_in_model_is_used(monkeypatch: pytest.MonkeyPatch):
    """A log message reports the fallback; another machine is rejected."""
    only = {key: path for key, path in substitutions.PROGRAMS.items() if key[0] == "robot_state_publisher"}
    monkeypatch.setattr(substitutions, "PROGRAMS", only)
    found = actions(ONE)
    [message] = [action.msg for action in found if isinstance(action, LogInfo)]
    assert "mikron_ucp710.urdf" in message
    with pytest.raises(RuntimeError, match="no URDF of .*linear_motor_center"):
        nodes(ONE, machine="linear_motor_center")


@pytest.mark.parametrize("file", [ONE, TWO])
def test_without_robot_state_publisher_no_node_is_started(monkeypatch: pytest.MonkeyPatch, file: str):
    """The error names the package and the argument that leaves it out, with which the nodes start."""
    only = {key: path for key, path in substitutions.PROGRAMS.items() if key[0] != "robot_state_publisher"}
    monkeypatch.setattr(substitutions, "PROGRAMS", only)
    executed = launch.visit(launch.LaunchContext(), [description(file)])
    started = []
    with pytest.raises(
        RuntimeError,
        match=r"robot_state_publisher not found.*ros-\$ROS_DISTRO-robot-state-publisher.*robot_state_publisher:=false",
    ):
        started += [action for action in executed if isinstance(action, NodeAction)]
    assert not started
    assert by_executable(nodes(file, robot_state_publisher="false")).keys() == {"virtual_axes_node"}


def test_the_node_runs_with_the_arguments_from_launch():
    """Names, controller and prefix have the given values."""
    [node] = nodes(
        ONE, namespace="cell", name="mill", joint_prefix="m_", controller="gpc", robot_state_publisher="false"
    )
    with ExitStack() as stack:
        drive = stack.enter_context(AxesClient(process=process(node, stack)))
        assert set(drive.latest("controller").values()) == {"gpc"}
        assert sorted(drive.latest()) == [f"m_{joint}" for joint in "acxyz"]
        assert drive.get_parameters(["workpiece_frame"]) == {"workpiece_frame": "workpiece"}


def test_two_machines_run_in_one_domain():
    """Each machine has its namespace, controller and frames; setpoints of one leave the other at rest."""
    found = by_executable(nodes(TWO, right_controller="gpc", rviz="true"))
    left, right = found["virtual_axes_node"]
    assert (left.namespace, right.namespace) == ("left", "right")
    frames = {tuple(node.arguments[-4:]) for node in found["static_transform_publisher"]}
    assert frames == {
        ("--frame-id", "world", "--child-frame-id", "left/machine"),
        ("--frame-id", "world", "--child-frame-id", "right/machine"),
    }
    assert [node.values["frame_prefix"] for node in found["robot_state_publisher"]] == ["left/", "right/"]
    assert [node.namespace for node in found["robot_state_publisher"]] == ["left", "right"]
    assert len(found["rviz2"]) == 1
    with ExitStack() as stack:
        first = process(left, stack)
        second = process(right, stack, first.domain_id)
        drives = [stack.enter_context(AxesClient(process=started)) for started in (first, second)]
        assert [set(drive.latest("controller").values()) for drive in drives] == [{"cascade"}, {"gpc"}]
        poses: list[PoseStamped] = []
        drives[1].node.create_subscription(PoseStamped, "/right/virtual_axes/tool_pose", poses.append, 10)
        drives[0].run(joint_trajectory(["x"], [0.3], [[0.01]]), settle=0.1)
        assert drives[0].latest()["x"] == pytest.approx(0.01, abs=1e-3)
        assert drives[1].latest()["x"] == 0.0
        drives[1].wait_for(lambda: poses, 10, "pose of the right tool")
        assert poses[0].header.frame_id == "right/workpiece"


def test_recordings_of_two_machines_are_separate_files(tmp_path: Path):
    """One file each, in the given folder."""
    found = by_executable(nodes(TWO, record=str(tmp_path), robot_state_publisher="false"))
    recorded = [node.values["record"] for node in found["virtual_axes_node"]]
    assert recorded == [str(tmp_path / "left.mcap"), str(tmp_path / "right.mcap")]
    assert list(found) == ["virtual_axes_node"]


def test_the_stand_in_scopes_arguments_as_launch_does():
    """Arguments of an include stay set afterwards unless a group restores them."""
    context = launch.LaunchContext()
    context.launch_configurations["machine"] = "outer"
    include = launch.actions.IncludeLaunchDescription
    source = launch.launch_description_sources.PythonLaunchDescriptionSource(str(ROOT / "launch" / ONE))
    arguments = {"machine": "mikron_ucp710", "robot_state_publisher": "false"}
    list(launch.visit(context, [launch.actions.GroupAction([include(source, launch_arguments=arguments.items())])]))
    assert context.launch_configurations == {"machine": "outer"}
    list(launch.visit(context, [include(source, launch_arguments=arguments.items())]))
    assert context.launch_configurations["machine"] == "mikron_ucp710"


def test_files_of_the_launch_files_are_installed():
    """Folders in CMakeLists.txt, packages in package.xml; RViz is optional, since it needs a display."""
    cmake = (ROOT / "CMakeLists.txt").read_text()
    [folders] = re.findall(r"foreach\(folder ([^)]*)\)", cmake)
    assert {"config", "launch", "layouts", "rviz", "urdf"} <= set(folders.split())
    manifest = (ROOT / "package.xml").read_text()
    packages = {node.package for node in nodes(TWO, rviz="true")} - {"virtual_axes", "rviz2"}
    assert "<exec_depend>rviz" not in manifest
    for package in packages | {"launch", "launch_ros", "geometry_msgs", "nav_msgs"}:
        assert f"<exec_depend>{package}</exec_depend>" in manifest, package


def test_the_command_prints_the_tool_pose():
    """A joint that the machine does not have is rejected, with status 2 and no output."""
    program = node_binary().with_name("virtual_axes")
    command = [program, "pose", "--joints", "q=1"]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert "q" in answer.stderr and "x, y, z, a, c" in answer.stderr
