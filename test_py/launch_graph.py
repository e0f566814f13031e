"""Launch files, executed with the stand-in of launch, and the nodes that they would start."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import launch
from launch_ros import substitutions
from launch_ros.actions import Node as NodeAction

from node_process import node_binary

ROOT = Path(__file__).resolve().parent.parent
substitutions.PROGRAMS["virtual_axes", "virtual_axes"] = str(node_binary().with_name("virtual_axes"))
# Any executable file: these are not installed here, and launch only looks for them.
for program in ("rviz2", "robot_state_publisher"):
    substitutions.PROGRAMS[program, program] = sys.executable


def description(file: str) -> launch.LaunchDescription:
    """Executes a launch file and returns its description."""
    return runpy.run_path(str(ROOT / "launch" / file))["generate_launch_description"]()


def actions(file: str, **arguments: str) -> list[launch.Action]:
    """Returns the actions that `ros2 launch virtual_axes FILE name:=value` would execute."""
    return launch.run(description(file), arguments)


def nodes(file: str, **arguments: str) -> list[NodeAction]:
    """Returns the nodes among the actions of a launch file."""
    return [action for action in actions(file, **arguments) if isinstance(action, NodeAction)]


def by_executable(found: list[NodeAction]) -> dict[str, list[NodeAction]]:
    """Groups nodes by executable."""
    sorted_nodes: dict[str, list[NodeAction]] = {}
    for node in found:
        sorted_nodes.setdefault(node.executable, []).append(node)
    return sorted_nodes
