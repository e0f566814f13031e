"""Interface of the node as the command `virtual_axes` prints it; the pages of docs/reference are written from it."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from functools import cache
from typing import Any

from node_process import node_binary


@cache
def printed(command: str) -> Any:
    """Returns the output of `virtual_axes COMMAND --json`."""
    program = node_binary().parent / "virtual_axes"
    result = subprocess.run([program, command, "--json"], check=True, capture_output=True, text=True, timeout=60)
    return json.loads(result.stdout)


# ------------------------------------------------------------------- topics, services and actions


@dataclass(frozen=True)
class Interface:
    """Topic, service or action."""

    direction: str
    """Direction or kind: in, out, service or action."""
    name: str
    """Name as in a node: `x`, `/x` or `~/x`."""
    type: str
    """Full type name, as sensor_msgs/msg/JointState."""
    qos: dict[str, Any] | None
    """Reliability, durability, depth, and the prefix of their parameters, if any; None of a service or action."""
    conditions: tuple[tuple[str, str], ...]
    """Parameters and values of which one is required; empty if the interface always exists."""

    def resolved(self, node: str, remaps: dict[str, str]) -> str:
        """Returns the name in the graph, for a node with this full name."""
        if self.name in remaps:
            return remaps[self.name]
        if self.name.startswith("~"):
            return node + self.name[1:]
        return self.name if self.name.startswith("/") else f"{node.rsplit('/', 1)[0]}/{self.name}"

    def exists(self, settings: dict[str, str]) -> bool:
        """Returns true if a node with these parameters has the interface."""
        return not self.conditions or any(settings.get(key) == value for key, value in self.conditions)


def interfaces() -> list[Interface]:
    """Returns all topics, services and actions."""
    description = printed("interface")
    found = []
    for row in description["topics"]:
        conditions = tuple((condition["parameter"], condition["value"]) for condition in row["conditions"])
        found.append(Interface(row["direction"], row["name"], row["type"], row["qos"], conditions))
    for direction in ("service", "action"):
        found += [Interface(direction, row["name"], row["type"], None, ()) for row in description[f"{direction}s"]]
    return found


# ------------------------------------------------------------------------------------- parameters


@dataclass(frozen=True)
class ParameterRow:
    """Definition of a parameter."""

    key: str
    """Parameter name; `<joint>.` stands for all joints of the kind."""
    type: str
    allowed: dict[str, Any] | None
    """Minimum and maximum, lengths, or choices."""
    unit: str
    required: bool
    default: Any
    live: bool
    owner: str
    """Scope: machine, node, or the kind of axis."""
    description: str

    def names(self, joints: dict[str, set[str]]) -> list[str]:
        """Returns the parameters of a machine that match this row; `joints` holds the kinds of each joint."""
        if not self.key.startswith("<joint>."):
            return [self.key]
        return [self.key.replace("<joint>", joint) for joint, kinds in joints.items() if self.owner in kinds]

    @property
    def bounds(self) -> tuple[float, float] | None:
        """Returns minimum and maximum of a number."""
        return (self.allowed["min"], self.allowed["max"]) if self.allowed and "min" in self.allowed else None

    @property
    def constraint(self) -> str:
        """Returns the additional constraint of the descriptor, beside range and type."""
        if self.allowed and "choices" in self.allowed:
            return "must be " + " or ".join(self.allowed["choices"])
        if self.allowed and "max_length" in self.allowed:
            return f"must be a list of {self.allowed['min_length']} … {self.allowed['max_length']} finite numbers"
        return ""


def parameters() -> list[ParameterRow]:
    """Returns the definitions of all parameters."""
    names = set(ParameterRow.__dataclass_fields__)
    return [ParameterRow(**{key: value for key, value in row.items() if key in names}) for row in printed("parameters")]
