"""Tables of README.md: topics, services, actions and parameters."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

README = Path(__file__).resolve().parent.parent / "README.md"

INTERFACE_HEADINGS = ["direction", "name", "type", "unit, content", "QoS", "rate"]
PARAMETER_HEADINGS = ["key", "range", "default", "live", "for", "description"]
KINDS = {"in": "msg", "out": "msg", "service": "srv", "action": "action"}
"""Package of the types by kind of interface."""


def rows(headings: list[str]) -> list[list[str]]:
    """Returns the cells of the only table with these headings."""
    lines = README.read_text(encoding="utf-8").splitlines()
    table = [number for number, line in enumerate(lines) if _cells(line) == headings]
    assert len(table) == 1, f"README.md: {len(table)} tables with the headings {headings}"
    found = []
    for line in lines[table[0] + 2 :]:
        if not line.startswith("|"):
            break
        found.append(_cells(line))
        assert len(found[-1]) == len(headings), f"README.md: not {len(headings)} cells: {line}"
    return found


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")] if line.startswith("|") else []


# ------------------------------------------------------------------- topics, services and actions


@dataclass(frozen=True)
class Interface:
    """Topic, service or action of the README."""

    direction: str
    """Direction or kind: in, out, service or action."""
    name: str
    """Name as in a node: `x`, `/x` or `~/x`."""
    type: str
    """Full type name, as sensor_msgs/msg/JointState."""
    reliable: bool
    transient_local: bool
    depth: int | None
    """History depth, where the table states it."""
    condition: tuple[str, str] | None
    """Parameter and value that the interface requires."""

    def resolved(self, node: str, remaps: dict[str, str]) -> str:
        """Returns the name in the graph, for a node with this full name."""
        if self.name in remaps:
            return remaps[self.name]
        if self.name.startswith("~"):
            return node + self.name[1:]
        return self.name if self.name.startswith("/") else f"{node.rsplit('/', 1)[0]}/{self.name}"


def interfaces() -> list[Interface]:
    """Returns all topics, services and actions of the README."""
    found = []
    above = ""
    for direction, names, types, content, qos, _ in rows(INTERFACE_HEADINGS):
        above = qos = above if qos == "as above" else qos
        names = re.findall(r"`([^`]+)`", names)
        package, types = types.split("/", 1)
        types = types.split(", ")
        assert names and len(names) == len(types), f"README.md: {names} are of {types}"
        condition = re.match(r"with `(\w+): (\w+)`", content)
        depth = re.search(r"keep last (\d+)", qos)
        for name, kind in zip(names, types):
            found.append(
                Interface(
                    direction=direction,
                    name=name,
                    type=f"{package}/{KINDS[direction]}/{kind}",
                    reliable="best effort" not in qos,
                    transient_local="transient local" in qos,
                    depth=int(depth[1]) if depth else None,
                    condition=(condition[1], condition[2]) if condition else None,
                )
            )
    return found


# ------------------------------------------------------------------------------------- parameters


@dataclass(frozen=True)
class ParameterRow:
    """Row of the parameter table."""

    key: str
    """Parameter name; `<joint>.` stands for all joints of the kind."""
    range: str
    default: str
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
        found = re.match(r"(\S+) … (\S+)(?! numbers)", self.range)
        return (float(found[1]), float(found[2])) if found and " numbers" not in self.range else None

    @property
    def unit(self) -> str:
        """Returns the unit of a number or of list elements."""
        found = re.match(r"\S+ … \S+(?: numbers)?(?: in)? (.+)", self.range)
        return found[1] if found and found[1] != "numbers" else ""

    @property
    def constraint(self) -> str:
        """Returns the additional constraint of the descriptor, beside range and type."""
        if numbers := re.match(r"(\S+ … \S+) numbers", self.range):
            return f"must be a list of {numbers[1]} finite numbers"
        if self.bounds or self.range in ("text", "list of texts", "true, false"):
            return ""
        return "must be " + " or ".join(self.range.split(", "))

    def default_value(self, value: Any) -> Any:
        """Returns the default with the type of `value`; None where there is no default."""
        if self.default in ("none", "required"):
            return None
        if self.default == "empty":
            return ""
        if isinstance(value, bool):
            return {"true": True, "false": False}[self.default]
        return float(self.default) if isinstance(value, (int, float)) else self.default


def parameters() -> list[ParameterRow]:
    """Returns all rows of the parameter table."""
    found = []
    for key, limits, default, live, owner, description in rows(PARAMETER_HEADINGS):
        live = {"yes": True, "no": False}[live]
        found.append(ParameterRow(key.strip("`"), limits, default, live, owner, description))
    return found
