"""Topics, fields and frames in the configurations for RViz, PlotJuggler and Foxglove exist."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from urdf_parser_py.urdf import URDF

from launch_graph import by_executable, nodes
from virtual_axes_py.ros import AxesClient

ROOT = Path(__file__).resolve().parent.parent
JOINTS = 5
RVIZ_TYPES = {"Path": "nav_msgs/msg/Path", "Pose": "geometry_msgs/msg/PoseStamped"}
FRAMES = {"machine", "workpiece", "tool"}


@pytest.fixture(scope="module")
def topics(real: AxesClient) -> dict[str, str]:
    """Returns the types of the node's topics."""

    def listed() -> dict[str, str]:
        return {name: types[0] for name, types in real.node.get_topic_names_and_types()}

    paths = {"/virtual_axes/tool_path", "/virtual_axes/tool_path_setpoint"}
    real.wait_for(lambda: paths <= listed().keys(), 10, "topics of the paths")
    return listed()


def fields_of(kind: str) -> dict[str, str]:
    """Returns the fields of a message type with their types."""
    package, _, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name).get_fields_and_field_types()


def type_at(kind: str, fields: list[str]) -> str:
    """Follows a path of fields through a message and returns the type at its end."""
    for field in fields:
        name, index = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", field).groups()
        kind = fields_of(kind)[name]
        if index is not None:
            assert kind.startswith("sequence<"), field
            assert int(index) < JOINTS, field
            kind = kind.removeprefix("sequence<").removesuffix(">")
        if "/" in kind:
            kind = kind.replace("/", "/msg/", 1)
    return kind


def check(topics: dict[str, str], topic: str, fields: list[str]) -> None:
    """Asserts that the field path is a number."""
    assert topic in topics, topic
    assert type_at(topics[topic], fields) in ("double", "float", "boolean"), (topic, fields)


def rviz(name: str) -> dict:
    """Returns the visualization manager of an RViz configuration."""
    return yaml.safe_load((ROOT / "rviz" / name).read_text())["Visualization Manager"]


def frames_of(prefix: str = "") -> set[str]:
    """Returns the links of the built-in model."""
    robot = URDF.from_xml_string((ROOT / "urdf" / "mikron_ucp710.urdf").read_text())
    return {f"{prefix}{link}" for link in robot.link_map}


def test_rviz_shows_what_the_node_publishes(topics: dict[str, str]):
    """Model, frames, tool and both paths in two colors; each topic has the type of its display."""
    manager = rviz("virtual_axes.rviz")
    assert manager["Global Options"]["Fixed Frame"] in frames_of()
    assert frames_of() >= FRAMES
    shown = {}
    colors = []
    for display in manager["Displays"]:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        if kind in RVIZ_TYPES:
            topic = display["Topic"]["Value"]
            assert topics[topic] == RVIZ_TYPES[kind], topic
            shown[topic] = kind
        if kind == "Path":
            colors.append(display["Color"])
    assert shown.keys() == {f"/virtual_axes/{topic}" for topic in ("tool_pose", "tool_path", "tool_path_setpoint")}
    assert len(set(colors)) == 2
    kinds = [display["Class"].removeprefix("rviz_default_plugins/") for display in manager["Displays"]]
    assert {"RobotModel", "TF"} <= set(kinds)


def test_rviz_of_two_machines_has_the_names_of_the_launch_file():
    """Namespaces, prefixes and the common frame are those of the launch file."""
    found = by_executable(nodes("two_machines.launch.py", rviz="true"))
    manager = rviz("two_machines.rviz")
    placed = [node.arguments for node in found["static_transform_publisher"]]
    assert {arguments[arguments.index("--frame-id") + 1] for arguments in placed} == {
        manager["Global Options"]["Fixed Frame"]
    }
    models = [display for display in manager["Displays"] if display["Class"].endswith("RobotModel")]
    by_topic = {display["Description Topic"]["Value"]: display["TF Prefix"] for display in models}
    publishers = found["robot_state_publisher"]
    assert by_topic == {
        f"/{node.namespace}/robot_description": node.values["frame_prefix"].rstrip("/") for node in publishers
    }
    own = {display["Topic"]["Value"] for display in manager["Displays"] if "Topic" in display}
    names = ("tool_pose", "tool_path", "tool_path_setpoint")
    assert own == {f"/{node.namespace}/{node.name}/{n}" for node in found["virtual_axes_node"] for n in names}


def test_plotjuggler_plots_existing_fields(topics: dict[str, str]):
    """Each curve is /topic/field[index], or a pair of them."""
    root = ElementTree.parse(ROOT / "layouts" / "plotjuggler.xml").getroot()
    curves = [
        curve.get(key)
        for curve in root.iter("curve")
        for key in (("curve_x", "curve_y") if curve.get("curve_x") else ("name",))
    ]
    assert len(curves) > 30
    for curve in curves:
        topic = max((t for t in topics if curve.startswith(f"{t}/")), key=len, default=None)
        assert topic is not None, curve
        check(topics, topic, curve.removeprefix(f"{topic}/").split("/"))
    seen = {curve.split("/")[3].split("[")[0] for curve in curves if "drive_states" in curve}
    assert {"psec", "position", "synchronized_tracking_error", "tracking_error"} <= seen


def panels(layout: object) -> Iterator[str]:
    """Yields the names of the panels of a Foxglove layout."""
    if isinstance(layout, str):
        yield layout
    else:
        yield from panels(layout["first"])
        yield from panels(layout["second"])


def test_foxglove_plots_existing_fields(topics: dict[str, str]):
    """Each panel has a configuration, each path a number, each topic of the 3D panel a message."""
    layout = json.loads((ROOT / "layouts" / "foxglove.json").read_text())
    configurations = layout["configById"]
    assert sorted(panels(layout["layout"])) == sorted(configurations)
    paths = [path["value"] for panel in configurations.values() for path in panel.get("paths", [])]
    assert len(paths) >= 10
    for path in paths:
        topic, *fields = path.split(".")
        check(topics, topic, fields)
    scene = configurations["3D!machine"]
    assert scene["followTf"] in frames_of()
    assert scene["topics"].keys() <= topics.keys()
    [model] = scene["layers"].values()
    assert model["topic"] == "/robot_description"
