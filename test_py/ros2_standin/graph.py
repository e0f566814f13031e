"""Node of the stand-in, types by name, and values from and to YAML."""

from __future__ import annotations

import array
import importlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import rclpy
import yaml
from rclpy.node import Node

DISCOVERY_SECONDS = 8.0
"""Longest wait for a topic, node or service; the real command's daemon knows them already."""


class Failure(Exception):
    """Error that the command prints."""


@contextmanager
def node() -> Iterator[Node]:
    """Yields a hidden node."""
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    created = Node(f"_ros2cli_{time.time_ns() % 10**6}", start_parameter_services=False, enable_rosout=False)
    try:
        yield created
    finally:
        created.destroy_node()
        rclpy.shutdown()


def wait_for(own: Node, found: Callable[[], object], seconds: float = DISCOVERY_SECONDS) -> object:
    """Returns the first true result within the time, or the last one."""
    deadline = time.monotonic() + seconds
    while not (result := found()) and time.monotonic() < deadline:
        rclpy.spin_once(own, timeout_sec=0.05)
    return result


def interface(name: str, folder: str) -> type:
    """Returns the class of a type such as std_msgs/msg/String; `folder` is msg or srv."""
    package, _, rest = name.partition("/")
    kind = rest.rpartition("/")[2]
    try:
        return getattr(importlib.import_module(f"{package}.{folder}"), kind)
    except (ModuleNotFoundError, AttributeError) as error:
        raise Failure(f"The passed {'message' if folder == 'msg' else 'service'} type is invalid") from error


def fill(message: object, values: dict[str, object]) -> None:
    """Sets fields of a message from parsed YAML."""
    types = message.get_fields_and_field_types()
    for name, value in values.items():
        if name not in types:
            raise Failure(f"Failed to populate field: '{type(message).__name__}' object has no attribute '{name}'")
        current, kind = getattr(message, name), types[name]
        if hasattr(current, "get_fields_and_field_types"):
            fill(current, value)
        elif "/" in kind:
            element = kind.removeprefix("sequence<").partition(">")[0].partition(",")[0].partition("[")[0]
            package, _, name_of_type = element.partition("/")
            members = []
            for item in value:
                member = interface(f"{package}/msg/{name_of_type}", "msg")()
                fill(member, item)
                members.append(member)
            setattr(message, name, members)
        elif isinstance(value, list):
            number = float if "double" in kind or "float" in kind else None
            setattr(message, name, [number(item) for item in value] if number else value)
        else:
            setattr(message, name, type(current)(value))


def plain(value: object, limit: int | None) -> object:
    """Converts a message to dictionaries and lists; longer sequences end in '...' after `limit` elements."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name), limit) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return int.from_bytes(value)
    if isinstance(value, list | tuple | array.array | np.ndarray):
        items = value.tolist() if isinstance(value, np.ndarray | array.array) else list(value)
        cut = limit is not None and len(items) > limit
        return [plain(item, limit) for item in items[:limit]] + (["..."] if cut else [])
    return value


def to_yaml(value: object, *, full: bool = False, flow: bool = False) -> str:
    """Returns a message as YAML, as `ros2 topic echo` prints it."""
    content = plain(value, None if full else 128)
    text = yaml.safe_dump(content, width=float("inf"), sort_keys=False, allow_unicode=True, default_flow_style=flow)
    return text.rstrip("\n")


def parse(text: str) -> dict[str, object]:
    """Returns the fields of a message in YAML."""
    values = yaml.safe_load(text) or {}
    if not isinstance(values, dict):
        raise Failure("The passed value needs to be a dictionary in YAML format")
    return values
