"""Launch file and files of the ros2_control plugin; `crates/c/tests/ros2_control.rs` runs the plugin itself."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from pathlib import Path

import pytest
import yaml
from urdf_parser_py.urdf import URDF

from launch_graph import ROOT, by_executable, nodes

FILE = "ros2_control.launch.py"
FOLDER = ROOT / "ros2_control"
JOINTS = ["x", "y", "z", "a", "c"]
STATES = ["position", "velocity", "effort", "current", "following_error"]


def block(**arguments: str) -> tuple[str, xml.Element]:
    """Returns the URDF that is published, and its element <ros2_control>."""
    [publisher] = by_executable(nodes(FILE, **arguments))["robot_state_publisher"]
    text = publisher.values["robot_description"]
    [found] = xml.fromstring(text).findall("ros2_control")
    return text, found


def test_manager_and_controllers_start():
    found = by_executable(nodes(FILE))
    assert sorted(found) == ["robot_state_publisher", "ros2_control_node", "spawner"]
    [manager], [spawner] = found["ros2_control_node"], found["spawner"]
    parameters = yaml.safe_load(Path(manager.files[0]).read_text())
    types = parameters["controller_manager"]["ros__parameters"]
    names = spawner.command[: spawner.command.index("--ros-args")]
    assert names == [name for name, value in types.items() if isinstance(value, dict)]
    assert parameters["joint_trajectory_controller"]["ros__parameters"]["joints"] == JOINTS


def test_urdf_names_the_exported_class_and_every_axis():
    text, found = block()
    assert len(URDF.from_xml_string(text).joints) == 8
    plugin = xml.parse(FOLDER / "virtual_axes_system.xml").getroot().find("class")
    assert plugin is not None and found.findtext("hardware/plugin") == plugin.get("name")
    source = (FOLDER / "src" / "virtual_axes_system.cpp").read_text()
    assert f"PLUGINLIB_EXPORT_CLASS({plugin.get('type')}, {plugin.get('base_class_type')})" in source
    assert [joint.get("name") for joint in found.findall("joint")] == JOINTS
    for joint in found.findall("joint"):
        assert [one.get("name") for one in joint.findall("command_interface")] == ["position"]
        assert [one.get("name") for one in joint.findall("state_interface")] == STATES


def test_controller_arrives_in_the_hardware_block():
    def parameters(found: xml.Element) -> dict[str | None, str | None]:
        return {item.get("name"): item.text for item in found.findall("hardware/param")}

    assert parameters(block()[1]) == {"machine": "mikron_ucp710"}
    assert parameters(block(controller="gpc")[1]) == {"machine": "mikron_ucp710", "controller": "gpc"}


def test_files_that_are_missing_or_no_hardware_are_rejected(tmp_path: Path):
    with pytest.raises(RuntimeError, match=r"hardware:=.*nowhere.xml: No such file"):
        nodes(FILE, hardware=str(tmp_path / "nowhere.xml"))
    other = tmp_path / "other.xml"
    other.write_text("<robot/>")
    with pytest.raises(RuntimeError, match="no element <ros2_control> with <hardware>"):
        nodes(FILE, hardware=str(other))
    other.write_text("<robot><ros2_control/></robot>")
    with pytest.raises(RuntimeError, match=r"urdf:=.*other.xml: it has an element <ros2_control>"):
        nodes(FILE, urdf=str(other))


def test_controllers_file_may_be_in_the_home_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    file = tmp_path / "controllers.yaml"
    file.write_text("controller_manager: {ros__parameters: {update_rate: 500}}\n")
    [manager] = by_executable(nodes(FILE, controllers="~/controllers.yaml"))["ros2_control_node"]
    assert Path(manager.files[0]) == file
