"""Stand-in for the `ros2` command against the node: the verbs that no page of the documentation uses yet."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from virtual_axes_py.ros import AxesClient

STANDIN = Path(__file__).parent / "ros2_standin"


def ros2(drive: AxesClient, *arguments: str, seconds: float = 30, status: int = 0) -> str:
    """Executes the command in the domain of the node and returns its output."""
    env = {**os.environ, "ROS_DOMAIN_ID": str(drive.process.domain_id)}
    command = [sys.executable, str(STANDIN), *arguments]
    result = subprocess.run(command, env=env, capture_output=True, text=True, timeout=seconds, check=False)
    assert result.returncode == status, result.stderr
    return result.stdout + result.stderr


def test_parameters(fast: AxesClient):
    """Values are printed with their types; a rejected value is reported with the reason."""
    assert ros2(fast, "param", "get", "/virtual_axes", "x.velocity_loop.gain") == "Double value is: 5.0\n"
    assert ros2(fast, "param", "set", "/virtual_axes", "x.velocity_loop.gain", "4.5") == "Set parameter successful\n"
    assert ros2(fast, "param", "get", "/virtual_axes", "x.velocity_loop.gain") == "Double value is: 4.5\n"
    ros2(fast, "param", "set", "/virtual_axes", "x.velocity_loop.gain", "5.0")
    rejected = ros2(fast, "param", "set", "/virtual_axes", "x.velocity_loop.gain", "-1.0")
    assert rejected.startswith("Setting parameter failed: ")
    assert "  x.velocity_loop.gain\n" in ros2(fast, "param", "list", "/virtual_axes")
    assert ros2(fast, "param", "get", "/virtual_axes", "x.no", status=1) == "Parameter not set\n"


def test_graph(fast: AxesClient):
    """Topics and nodes are listed, a service is called."""
    assert "/joint_states [sensor_msgs/msg/JointState]\n" in ros2(fast, "topic", "list", "-t")
    assert "/virtual_axes\n" in ros2(fast, "node", "list")
    assert "success=True" in ros2(fast, "service", "call", "/virtual_axes/reset", "std_srvs/srv/Trigger")


def test_topics(fast: AxesClient):
    """A published trajectory is accepted, its result is printed as YAML, and `echo` waits for a type."""
    values = "{joint_names: [x], points: [{positions: [0.01], time_from_start: {sec: 1}}]}"
    shown = ros2(fast, "topic", "pub", "--once", "/psec", "trajectory_msgs/msg/JointTrajectory", values)
    assert "publisher: beginning loop\npublishing #1: trajectory_msgs.msg.JointTrajectory(" in shown
    assert "positions=[0.01]" in shown
    shown = ros2(fast, "topic", "echo", "--once", "/virtual_axes/trajectory_result")
    assert re.match(r"trajectory_stamp:\n  sec: \d+\n  nanosec: \d+\n", shown[shown.index("trajectory_stamp") :])
    assert shown.endswith("\n---\n")
    assert (
        ros2(fast, "topic", "echo", "--once", "--field", "name", "/joint_states") == "['x', 'y', 'z', 'a', 'c']\n---\n"
    )
    assert "does not appear to be published" in ros2(fast, "topic", "echo", "/nothing", status=1)


@pytest.mark.parametrize("values", ["{no: 1}", "[1]"])
def test_wrong_values_are_rejected(fast: AxesClient, values: str):
    """A field that the type does not have, and YAML that is no dictionary, are errors."""
    ros2(fast, "topic", "pub", "--once", "/psec", "trajectory_msgs/msg/JointTrajectory", values, status=1)
