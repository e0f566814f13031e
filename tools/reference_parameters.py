"""Pages of the parameters: one per group, and their index."""

from __future__ import annotations

import re
from typing import Any

from reference_markdown import page, table

GROUPS = {
    "machine": (
        "Machine and kinematics",
        "Name, axes, periods of the control loops, and dimensions of the kinematic chain. See also "
        "[Kinematics](../kinematics.md) and [Machines](../machines.md).",
    ),
    "axis": (
        "Axis, transmission and motor",
        "Type of each axis, its transmission, and the electrical and mechanical constants of its motor.",
    ),
    "friction": (
        "Friction and gravity",
        "Friction law and weight of each axis. [Identification](../../explanation/identification.md) finds these "
        "values from recordings.",
    ),
    "position-loop": (
        "Position loop",
        "Position controller of each axis and its tuning. "
        "[Predictive control](../../explanation/predictive-control.md) explains `gpc` and `rst`.",
    ),
    "inner-loops": (
        "Velocity loop, current loop, feedforward and delays",
        "PI controllers below the position loop, weights of the feedforward, and delays of the setpoint.",
    ),
    "limits": (
        "Limits and tolerances",
        "Limits of trajectories and controlled stops, and default tolerances of [action goals](../action.md).",
    ),
    "deviation": (
        "Deviation of the plant",
        "Factors on the simulated drive; the controllers are designed for the nominal values.",
    ),
    "node": ("Node", "Time, topics, action goals and recording of `virtual_axes_node`."),
    "qos": (
        "Quality of service",
        "QoS profile of each topic. The keys are `qos.TOPIC.reliability` (reliable, best_effort), "
        "`qos.TOPIC.durability` (volatile, transient_local) and `qos.TOPIC.depth` (1 … 100000, keep last), for example "
        "`-p qos.joint_states.depth:=100`.",
    ),
}
"""Title and introduction of the page of each group of parameters."""

POLICIES = ("reliability", "durability", "depth")

INTRODUCTION = (
    "All parameters of a machine and of the node. The same keys serve machine files, `-p KEY:=VALUE` of the node and "
    "`--set KEY=VALUE` of the command.\n\nKeys of an axis begin with the name of its joint, for example "
    "`x.velocity_loop.gain`. A live parameter can be set while the axes run (`ros2 param set`) and takes effect "
    'at the next position cycle; the others are read at the start. The column "for" names the machines, axes or motors '
    "that have the parameter. `virtual_axes parameters` prints all of them, `--json` as data and `--markdown` as one "
    "table."
)
HEADINGS = ["for", "type", "range", "default", "live"]


def parameter_pages(parameters: list[dict[str, Any]]) -> dict[str, str]:
    """Returns the pages by path in docs/reference."""
    unknown = {row["group"] for row in parameters} ^ set(GROUPS)
    if unknown:
        raise ValueError(f"parameter groups without page or parameters: {sorted(unknown)}")
    pages = {}
    links = []
    for group, (title, introduction) in GROUPS.items():
        keys: dict[str, list[dict[str, Any]]] = {}
        for row in parameters:
            if row["group"] == group:
                keys.setdefault(row["key"], []).append(row)
        parts = [qos_table(keys)] if group == "qos" else [definition(key, rows) for key, rows in keys.items()]
        pages[f"parameters/{group}.md"] = page(title, introduction, *parts)
        names = "`qos.TOPIC.*`" if group == "qos" else ", ".join(link(group, key) for key in keys)
        links.append(f"**[{title}]({group}.md)**: {names}")
    toctree = "\n".join(["```{toctree}", ":hidden:", "", *GROUPS, "```"])
    pages["parameters/index.md"] = page("Parameters", INTRODUCTION, *links, toctree)
    return pages


def link(group: str, key: str) -> str:
    """Returns a link to the section of a parameter; the anchor is that of Sphinx and of Git hosts."""
    return f"[`{key}`]({group}.md#{re.sub('[^a-z0-9_-]', '', key.lower())})"


def definition(key: str, rows: list[dict[str, Any]]) -> str:
    """Returns the section of a parameter, with a row for each kind of axis or motor that has another unit."""
    described = {row["description"]: row["owner"] for row in rows}
    if len(described) == 1:
        paragraphs = list(described)
    else:
        paragraphs = [f"{owner.capitalize()}: {text}" for text, owner in described.items()]
    cells = [
        [row["owner"], row["type"], row["range"], default_text(row), "yes" if row["live"] else "no"] for row in rows
    ]
    return "\n\n".join([f"## `{key}`", *paragraphs, table(HEADINGS, cells)])


def qos_table(keys: dict[str, list[dict[str, Any]]]) -> str:
    """Returns one row per topic for the parameters of its QoS policies."""
    defaults = {key: str(row["default"]) for key, (row,) in keys.items()}
    prefixes = list(dict.fromkeys(key.rpartition(".")[0] for key in defaults))
    cells = [[f"`{prefix}.*`", *(defaults.pop(f"{prefix}.{policy}") for policy in POLICIES)] for prefix in prefixes]
    if defaults:
        raise ValueError(f"no QoS policies: {sorted(defaults)}")
    return table(["keys", *POLICIES], cells)


def default_text(row: dict[str, Any]) -> str:
    """Returns the default of a parameter."""
    if row["required"]:
        return "required"
    if row["default"] is None:
        return "none"
    if isinstance(row["default"], bool):
        return str(row["default"]).lower()
    if isinstance(row["default"], float):
        return f"{row['default']:g}"
    return str(row["default"]) or "empty"
