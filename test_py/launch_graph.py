"""Launch files executed on the stand-in, and the nodes that they would start."""

from __future__ import annotations

import runpy
from pathlib import Path

import launch
from launch_ros import substitutions
from launch_ros.actions import Node as NodeAction

from drive import node_binary

ROOT = Path(__file__).resolve().parent.parent
substitutions.PROGRAMS["virtual_axes", "virtual_axes"] = str(node_binary().with_name("virtual_axes"))


def description(file: str) -> launch.LaunchDescription:
    """Execute a launch file and have it make its description."""
    return runpy.run_path(str(ROOT / "launch" / file))["generate_launch_description"]()


def actions(file: str, **arguments: str) -> list[launch.Action]:
    """All that `ros2 launch virtual_axes FILE name:=value` would execute."""
    return launch.run(description(file), arguments)


def nodes(file: str, **arguments: str) -> list[NodeAction]:
    """Make the nodes among them."""
    return [action for action in actions(file, **arguments) if isinstance(action, NodeAction)]


def by_executable(found: list[NodeAction]) -> dict[str, list[NodeAction]]:
    """Sort them by what they run."""
    sorted_nodes: dict[str, list[NodeAction]] = {}
    for node in found:
        sorted_nodes.setdefault(node.executable, []).append(node)
    return sorted_nodes
