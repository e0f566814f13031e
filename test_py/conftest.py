"""Fixtures: nodes under test, each in its own DDS domain on this machine only.

Needs the environment of .build/env.sh (created by `./test.sh`) and the node's program: by default
target/release/virtual_axes_node, another with VIRTUAL_AXES_NODE.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

# Set before rclpy creates its first context: no packet leaves this machine.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
for variable in ("ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ROS_DOMAIN_ID"):
    os.environ.pop(variable, None)

# launch is not on PyPI: its stand-in provides the names of the real package.
import launch_standin  # noqa: E402, F401
from motion import go_home  # noqa: E402
from node_process import Node, node_binary, use_private_shared_memory  # noqa: E402
from virtual_axes_py.ros import AxesClient  # noqa: E402

if TYPE_CHECKING:
    from action import Follow


use_private_shared_memory()


def pytest_sessionstart() -> None:
    """Reports a missing environment once, not once per test."""
    if not node_binary().exists():
        pytest.exit(f"no node to test at {node_binary()}: cargo build --release, or set VIRTUAL_AXES_NODE", 2)


@pytest.fixture(scope="module")
def real() -> Iterator[AxesClient]:
    """Yields axes in real time, shared by a module; motions there have at most 20 000 points."""
    with Node(["-p", "time:=real", "-p", "max_points:=20000"]) as process, AxesClient(process=process) as drive:
        yield drive


@pytest.fixture(scope="module")
def fast() -> Iterator[AxesClient]:
    """Yields axes in mode `fast`, shared by a module."""
    with Node(["-p", "time:=fast"]) as process, AxesClient(process=process) as drive:
        yield drive


@pytest.fixture(scope="module")
def following() -> Iterator[Follow]:
    """Yields an action client with its axes, with feedback at 50 Hz, shared by a module."""
    # Needs control_msgs, which the other tests do not need.
    from action import Follow

    args = ["-p", "time:=fast", "-p", "action_monitor_rate:=50.0"]
    with Node(args) as process, AxesClient(process=process) as drive, Follow(drive) as follow:
        yield follow


@pytest.fixture
def follow(following: Follow) -> Follow:
    """Yields the same client, with the axes at rest at home."""
    go_home(following.drive)
    return following


@pytest.fixture
def start() -> Iterator[Callable[..., AxesClient]]:
    """Starts nodes for one test: start(*ros_args, name=...) returns a connected AxesClient."""
    with ExitStack() as stack:

        def start_one(*ros_args: str, connect: bool = True, **options: object) -> AxesClient:
            process = stack.enter_context(Node(ros_args, **options))
            return stack.enter_context(AxesClient(process=process, connect=connect))

        yield start_one


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Names the stand-ins that the documentation test used, with the number of pages."""
    reports = [report for reports in terminalreporter.stats.values() for report in reports]
    used = [value for report in reports for name, value in getattr(report, "user_properties", []) if name == "stand-in"]
    for name in sorted(set(used)):
        terminalreporter.write_line(f"stand-in of the documentation test: {name} ({used.count(name)} pages)")
