#!/usr/bin/env python3
"""Writes the generated pages of docs/reference from the built programs, msg/ and launch/.

    cargo build --release && tools/reference.py           # status 1 if a stored page is out of date
    tools/reference.py --write                            # rewrites the pages

Sources: `virtual_axes interface --json`, `virtual_axes parameters --json`, help texts, msg/action/*.action,
msg/*.msg, launch/*.launch.py, and crates/py/python.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import options
from reference_markdown import MARK, console, page, section, table
from reference_parameters import parameter_pages
from reference_python import python_page
from reference_sources import MessageSection, action, help_texts, launch_file, message

ROOT = Path(__file__).resolve().parent.parent
PROGRAMS = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release"
PAGES = ROOT / "docs" / "reference"
DIFFERENCE_LINES = 12
"""Printed lines of the difference between a stored page and the generated one."""


def output(*arguments: str) -> Any:
    """Returns the JSON output of `virtual_axes`."""
    command = [PROGRAMS / "virtual_axes", *arguments, "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout)


class Reference:
    """Data of the pages."""

    def __init__(self) -> None:
        self.interface = output("interface")
        self.parameters = output("parameters")
        self.groups = {row["key"]: row["group"] for row in self.parameters}

    def linked(self, text: str) -> str:
        """Returns a text of the interface with links to the parameters that it names."""

        def link(found: re.Match[str]) -> str:
            key = found[1].split(":")[0]
            return f"[`{found[1]}`](parameters/{self.groups[key]}.md#{key})" if key in self.groups else found[0]

        return re.sub(r"`([^`]+)`", link, text)

    def pages(self) -> dict[str, str]:
        """Returns all generated pages by path in docs/reference."""
        pages = {
            "topics.md": self.topics(),
            "python.md": python_page(),
            "rejections.md": self.rejections(),
            "diagnostics.md": self.diagnostics(),
            "messages.md": messages(),
            "launch.md": launch(),
            "command-line.md": command_line(),
            "scenarios.md": scenarios(),
        }
        return pages | parameter_pages(self.parameters)

    # ------------------------------------------------------------------------------ interface

    def topics(self) -> str:
        """Returns the page of topics, services and actions."""
        parts = []
        for direction, title in (("in", "Subscribed topics"), ("out", "Published topics")):
            topics = [topic for topic in self.interface["topics"] if topic["direction"] == direction]
            overview = [[f"`{topic['name']}`", type_link(topic["type"])] for topic in topics]
            parts += [f"## {title}", table(["name", "type"], overview), *(self.topic(topic) for topic in topics)]
        services = [[f"`{row['name']}`", type_link(row["type"]), row["content"]] for row in self.interface["services"]]
        parts.append("## Services\n\n" + table(["name", "type", "content"], services))
        parts.append("## Actions")
        for row in self.interface["actions"]:
            facts = [f"Type: {type_link(row['type'])}", f"Rate: {self.linked(row['rate'])}"]
            parts.append(section(f"`{row['name']}`", self.linked(row["content"]), facts))
        codes = [[str(row["code"]), row["name"], row["meaning"]] for row in self.interface["action_error_codes"]]
        parts.append(
            "[Action](action.md) describes tolerances and cancellation, [part programs](part-programs.md) the action "
            "`~/run_program`; its error codes are among the [messages](messages.md#runprogram). Values of `error_code` "
            "in the result of `~/follow_joint_trajectory`:"
        )
        parts += [table(["`error_code`", "name", "reason"], codes), DELIVERY]
        return page(
            "Topics, services and actions",
            "Everything that the node `virtual_axes_node` has in the ROS 2 graph. Units are those of ROS: m, rad, s, "
            "A, N, N·m.\n\nNames in a namespace and `~` follow ROS (`~` is the name of the node, "
            "`/virtual_axes` by default); every name can be remapped. QoS profiles are the defaults. "
            "`virtual_axes interface` prints this page as text, `virtual_axes interface --json` as data.",
            *parts,
        )

    def topic(self, topic: dict[str, Any]) -> str:
        """Returns the section of a topic."""
        qos = topic["qos"]
        profile = f"{qos['reliability']}, {qos['durability']}, keep last {qos['depth']}".replace("_", " ")
        changed = "constant" if qos["parameters"] is None else f"[`{qos['parameters']}.*`](parameters/qos.md)"
        facts = [
            f"Type: {type_link(topic['type'])}",
            f"Rate: {self.linked(topic['rate'])}",
            f"QoS: {profile} ({changed})",
        ]
        if topic["conditions"]:
            conditions = (f"`{row['parameter']}: {row['value']}`" for row in topic["conditions"])
            facts.append(f"Exists only with {self.linked(' or '.join(conditions))}")
        return section(f"`{topic['name']}`", self.linked(topic["content"]), facts)

    def rejections(self) -> str:
        """Returns the page of rejection codes."""
        sections = message(ROOT / "msg" / "TrajectoryResult.msg")
        constants = {name: (int(value), text) for section in sections for _, name, value, text in section.constants}
        rows = []
        for row in self.interface["rejection_codes"]:
            code, text = constants[row["name"]]
            if code != row["code"]:
                raise ValueError(f"TrajectoryResult.msg: {row['name']} is {code}, in the program {row['code']}")
            numbers = re.search(r"\bvalue\b.*", text)
            cells = [str(code), row["name"], self.linked(row["meaning"]), numbers[0] if numbers else "–"]
            rows.append(cells)
        return page(
            "Rejection codes",
            "Reasons for which the node rejects a trajectory on `psec` or a goal of `~/follow_joint_trajectory`.\n\n"
            "An invalid trajectory is rejected as a whole; active motions continue unchanged. `code`, `joint`, "
            "`point_index`, `value` and `limit` of [TrajectoryResult](messages.md#trajectoryresult) on "
            "`~/trajectory_result` contain the reason, and the log has it as text. `virtual_axes run` applies the same "
            "checks to files. [Trajectories](trajectories.md) describes the accepted ones.",
            table(["code", "name", "reason", "`value` and `limit`"], rows),
        )

    def diagnostics(self) -> str:
        """Returns the page of the keys of /diagnostics."""
        parts = []
        for kind in self.interface["diagnostics"]:
            rows = [[f"`{row['key']}`", row["unit"] or "–", row["description"]] for row in kind["keys"]]
            parts.append(f"## Status `{kind['status']}`\n\n{table(['key', 'unit', 'meaning'], rows)}")
        return page(
            "Diagnostics",
            "Keys of the statuses that the node publishes on `/diagnostics` "
            f"({type_link('diagnostic_msgs/msg/DiagnosticArray')}), once a second of the wall clock.\n\n"
            "Counts are since the start of the node. A status is WARN if a fault was counted since the previous "
            "message, while a stream is ignored after a stop, and after the end of a recording. NODE is the full name "
            "of the node, JOINT the name of a joint. [Clocks](clocks.md) and [Streams](streams.md) explain the terms.",
            *parts,
        )


DELIVERY = """## Delivery

Stamps lie on the grid of the position cycles, without gaps. In real time subscribers never delay the axes: a topic with
slow subscribers drops samples, and [`/diagnostics`](diagnostics.md) counts them. With `time: fast` the axes wait for
their subscribers, at most 30 s for one that takes no samples; idle axes run at wall-clock rate. A client that submits
many trajectories at once needs a queue for two messages of `~/trajectory_result` per trajectory. Up to 64 trajectories
wait on `psec`, so the memory of the node grows to 64 times the largest message. A service response has at most
65 380 octets; `describe_parameters` shortens the descriptions where many parameters are requested at once."""


def type_link(name: str) -> str:
    """Returns a type name with a link to its definition: own messages here, others in the documentation of ROS 2."""
    package, _, kind = name.split("/")
    if package == "virtual_axes":
        return f"[{package}/{kind}](messages.md#{kind.lower()})"
    return f"[{package}/{kind}](https://docs.ros.org/en/jazzy/p/{package}/)"


def messages() -> str:
    """Returns the page of the package's own messages."""
    parts = []
    for path in sorted((ROOT / "msg").glob("*.msg")):
        parts += [f"## {path.stem}", *definition_parts(message(path))]
    for path in sorted((ROOT / "msg" / "action").glob("*.action")):
        parts.append(f"## {path.stem}")
        for name, sections in action(path).items():
            parts += [f"### {path.stem}: {name.lower()}", *definition_parts(sections)]
    return page(
        "Messages",
        "Messages and actions that the package `virtual_axes` defines, with the unit of each field. "
        "[Topics](topics.md) says where the node has them.",
        *parts,
    )


def definition_parts(sections: list[MessageSection]) -> list[str]:
    """Returns comments and tables of a message definition."""
    parts = []
    for block in sections:
        if block.comment:
            parts.append(block.comment)
        constants = [[f"`{name}`", value, kind, text] for kind, name, value, text in block.constants]
        if constants:
            parts.append(table(["constant", "value", "type", "meaning"], constants))
        fields = [[f"`{name}`", f"`{kind}`", text] for kind, name, text in block.fields]
        if fields:
            parts.append(table(["field", "type", "meaning"], fields))
    return parts


def launch() -> str:
    """Returns the page of the launch files."""
    parts = []
    for path in sorted((ROOT / "launch").glob("*.launch.py"), reverse=True):
        file = launch_file(path)
        blocks = file.documentation.split("\n\n")
        paragraphs = [console(block) if block.startswith("ros2 ") else block for block in blocks]
        rows = [
            [f"`{name}`", default or "empty", ", ".join(choices) if choices else "any", meaning]
            for name, default, choices, meaning in file.arguments
        ]
        parts += [f"## {file.name}", *paragraphs, table(["argument", "default", "values", "meaning"], rows)]
    return page(
        "Launch files",
        "Arguments of the launch files, given as `NAME:=VALUE` behind `ros2 launch virtual_axes FILE`. "
        "`ros2 launch virtual_axes FILE --show-args` prints them.",
        *parts,
    )


def command_line() -> str:
    """Returns the page of the help texts of both programs."""
    parts = []
    for name in ("virtual_axes", "virtual_axes_node"):
        for command, text in help_texts(PROGRAMS / name).items():
            level = "##" if len(command) < 2 else "###"
            parts.append(f"{level} {' '.join([name, *command])}\n\n```text\n{text}\n```")
    return page(
        "Command line",
        "Help texts of the command `virtual_axes`, which needs no ROS, and of the node `virtual_axes_node`.\n\n"
        "Exit status and JSON keys are in [JSON output](json.md), input and output files in "
        "[File formats](file-formats.md), search and cost of `tune` in [Tuning](tuning.md), environment variables of "
        "the node in [Environment](environment.md).",
        *parts,
    )


def scenarios() -> str:
    """Returns the page of the built-in scenarios."""
    rows = [[f"`{row['name']}`", row["description"], row["source"] or "–"] for row in output("scenarios")]
    return page(
        "Scenarios",
        "Built-in motions and part programs for `virtual_axes run`, `tune`, `robustness` and `psec`. "
        "`virtual_axes scenarios --show NAME` prints one as a template for your own; [File formats](file-formats.md) "
        "describes the keys, [Part programs](part-programs.md) the G code. The column of the source names the "
        "figure or section of Prévost, Lavernhe, Lartigue and "
        "Dumur.",
        table(["scenario", "motion", "source"], rows),
    )


def differences(pages: dict[str, str]) -> list[str]:
    """Returns a text for each stored page that differs from the generated one, is missing or is not generated."""
    found = []
    for name, text in pages.items():
        path = PAGES / name
        stored = path.read_text(encoding="utf-8") if path.is_file() else ""
        if stored != text:
            versions = (stored.splitlines(), text.splitlines())
            lines = list(difflib.unified_diff(*versions, "stored", "generated", n=0, lineterm=""))
            shown = "\n".join(f"    {line}" for line in lines[:DIFFERENCE_LINES])
            found.append(f"{path.relative_to(ROOT)} is out of date:\n{shown}")
    for path in sorted(PAGES.rglob("*.md")):
        if path.relative_to(PAGES).as_posix() not in pages and MARK in path.read_text(encoding="utf-8"):
            found.append(f"{path.relative_to(ROOT)} is no longer generated: delete it")
    return found


def main() -> int:
    """Writes or checks the pages; returns the exit status."""
    parser = options.parser(__doc__)
    parser.add_argument("--write", action="store_true", help="write the pages instead of comparing them")
    arguments = parser.parse_args()
    pages = Reference().pages()
    if arguments.write:
        for name, text in pages.items():
            (PAGES / name).parent.mkdir(exist_ok=True)
            (PAGES / name).write_text(text, encoding="utf-8")
    found = differences(pages)
    for text in found:
        print(f"reference: {text}", file=sys.stderr)
    if found:
        print("reference: run `cargo build --release && tools/reference.py --write`", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
