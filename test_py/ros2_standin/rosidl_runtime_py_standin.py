"""Stand-in for the part of `rosidl_runtime_py` that the `ros2` stand-in needs: messages from and to YAML."""

from __future__ import annotations

import array
import importlib
import re
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml


def get_interface(name: str, kind: str = "msg") -> Any:
    """Returns the class of an interface, named as package/msg/Name or package/Name."""
    parts = name.split("/")
    package, folder, own = parts if len(parts) == 3 else (parts[0], kind, parts[-1])
    try:
        return getattr(importlib.import_module(f"{package}.{folder}"), own)
    except (ImportError, AttributeError):
        sys.exit("The passed message type is invalid")


def set_fields(message: Any, values: Mapping[str, Any]) -> None:
    """Sets fields of a message from nested mappings and lists."""
    types = message.get_fields_and_field_types()
    for name, value in values.items():
        # YAML reads a bare y as a text here; booleans stay booleans.
        if name not in types:
            sys.exit(f"Failed to populate field: '{type(message).__name__}' object has no attribute '{name}'")
        setattr(message, name, _value(types[name], getattr(message, name), value))


def _value(kind: str, present: Any, value: Any) -> Any:
    if hasattr(present, "get_fields_and_field_types"):
        set_fields(present, value)
        return present
    if element := re.match(r"sequence<([^,>]+)", kind):
        return [_element(element[1], one) for one in value]
    return _element(kind, value)


def _element(kind: str, value: Any) -> Any:
    if "/" in kind:
        message = get_interface(kind)()
        set_fields(message, value)
        return message
    return float(value) if kind in ("double", "float") else str(value) if kind.startswith("string") else value


def to_yaml(value: Any) -> str:
    """Returns a message as YAML, another value as Python prints it, as `ros2 topic echo` does."""
    if hasattr(value, "get_fields_and_field_types"):
        return yaml.safe_dump(_plain(value), sort_keys=False, default_flow_style=False, allow_unicode=True)
    return f"{value!r}\n" if isinstance(value, array.array) else f"{value}\n"


def _plain(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (list, tuple, array.array, np.ndarray)):
        return [_plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value
