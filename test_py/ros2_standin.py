"""Stand-in for the `ros2` command, which is not on PyPI: the verbs that the documentation executes.

    ros2 run PACKAGE PROGRAM ARGUMENT...
    ros2 launch PACKAGE FILE NAME:=VALUE...
    ros2 topic pub -w COUNT --once TOPIC TYPE YAML
    ros2 topic echo --once --field FIELD TOPIC

Same arguments and form of output as ros2cli of ROS 2 Jazzy; others are errors. `launch` starts the nodes of the package
itself, since PyPI has no other.
"""

from __future__ import annotations

import argparse
import importlib
import os
import runpy
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import rclpy
import yaml
from ament_index_python.packages import get_package_prefix
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

import launch_standin

DISCOVERY_S = 8.0
"""Longest wait for a topic; the real command's daemon knows it already."""


def run(arguments: argparse.Namespace) -> None:
    """Executes a program of a package."""
    path = Path(get_package_prefix(arguments.package)) / "lib" / arguments.package / arguments.program
    os.execv(path, [str(path), *arguments.arguments])


def launch(arguments: argparse.Namespace) -> None:
    """Starts the nodes of a launch file, prints their output, and ends them by Ctrl+C."""
    package, prefix = arguments.package, Path(get_package_prefix(arguments.package))
    programs = {(package, path.name): str(path) for path in (prefix / "lib" / package).iterdir()}
    # Any executable file: launch files only look for it.
    programs["robot_state_publisher", "robot_state_publisher"] = sys.executable
    launch_standin.PROGRAMS.update(programs)
    file = runpy.run_path(str(prefix / "share" / package / "launch" / arguments.file))
    values = dict(one.split(":=", 1) for one in arguments.arguments)
    actions = launch_standin.run(file["generate_launch_description"](), values)
    nodes = [one for one in actions if isinstance(one, launch_standin.Node) and one.package == package]
    started = []
    for number, node in enumerate(nodes, 1):
        command = [programs[package, node.executable], *node.command]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        name = f"{node.executable}-{number}"
        print(f"[INFO] [{name}]: process started with pid [{process.pid}]", flush=True)
        thread = threading.Thread(target=forward, args=(name, process))
        thread.start()
        started.append(thread)
    # The nodes get Ctrl+C from the terminal, too.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for thread in started:
        thread.join()


def forward(name: str, process: subprocess.Popen[str]) -> None:
    """Prints the output of a node, each line with its name, until the node ends."""
    assert process.stdout is not None
    for line in process.stdout:
        print(f"[{name}] {line}", end="", flush=True)
    process.wait()


def message_type(name: str) -> type:
    """Returns the class of a type such as std_msgs/msg/String."""
    package, *_, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)


def filled(name: str, values: dict[str, object]) -> object:
    """Returns a message with fields from YAML."""
    message = message_type(name)()
    for field, value in values.items():
        kind = message.get_fields_and_field_types()[field]
        element = kind.removeprefix("sequence<").removesuffix(">")

        def converted(item: object, element: str = element) -> object:
            return filled(element, item) if "/" in element else float(item) if element == "double" else item

        setattr(message, field, converted(value) if element == kind else list(map(converted, value)))
    return message


def spin(node: rclpy.node.Node, until: Callable[[], object]) -> object:
    """Spins until a result is true, and returns it."""
    deadline = time.monotonic() + DISCOVERY_S
    while not (result := until()):
        if time.monotonic() > deadline:
            raise SystemExit("no such topic, or no message")
        rclpy.spin_once(node, timeout_sec=0.05)
    return result


def pub(arguments: argparse.Namespace) -> None:
    """Publishes a message once."""
    message = filled(arguments.type, yaml.safe_load(arguments.values))
    node = rclpy.create_node("_ros2cli", start_parameter_services=False, enable_rosout=False)
    profile = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(type(message), arguments.topic, profile)
    if publisher.get_subscription_count() < arguments.wait:
        print(f"Waiting for at least {arguments.wait} matching subscription(s)...", flush=True)
    spin(node, lambda: publisher.get_subscription_count() >= arguments.wait)
    print(f"publisher: beginning loop\npublishing #1: {message!r}\n", flush=True)
    publisher.publish(message)
    time.sleep(0.1)
    node.destroy_node()


def echo(arguments: argparse.Namespace) -> None:
    """Prints a field of one message."""
    node = rclpy.create_node("_ros2cli", start_parameter_services=False, enable_rosout=False)
    [name] = spin(node, lambda: dict(node.get_topic_names_and_types()).get(arguments.topic))
    messages: list[object] = []
    node.create_subscription(message_type(name), arguments.topic, messages.append, qos_profile_sensor_data)
    spin(node, lambda: messages)
    print(f"{getattr(messages[0], arguments.field)}\n---")
    node.destroy_node()


def main() -> None:
    """Executes a verb."""
    parser = argparse.ArgumentParser(prog="ros2")
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("run")
    command.add_argument("package")
    command.add_argument("program")
    command.add_argument("arguments", nargs=argparse.REMAINDER)
    command.set_defaults(handler=run)
    command = commands.add_parser("launch")
    command.add_argument("package")
    command.add_argument("file")
    command.add_argument("arguments", nargs="*")
    command.set_defaults(handler=launch)
    verbs = commands.add_parser("topic").add_subparsers(required=True)
    for handler, words in ((pub, ["topic", "type", "values"]), (echo, ["topic"])):
        verb = verbs.add_parser(handler.__name__)
        verb.add_argument("--once", action="store_true", required=True)
        for word in words:
            verb.add_argument(word)
        verb.set_defaults(handler=handler)
    verbs.choices["pub"].add_argument("-w", dest="wait", type=int, default=1)
    verbs.choices["echo"].add_argument("--field", required=True)
    arguments = parser.parse_args()
    if arguments.handler in (pub, echo):
        rclpy.init()
    arguments.handler(arguments)


if __name__ == "__main__":
    main()
