"""Sources of the reference pages beside the command's JSON: message definitions, launch files and help texts."""

from __future__ import annotations

import ast
import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

CONSTANT = re.compile(r"(\w+) (\w+)=(\S+)\s*(?:#\s*(.*))?")
FIELD = re.compile(r"([\w/\[\]]+) (\w+)\s*(?:#\s*(.*))?")
COMMAND = re.compile(r"^  ([a-z-]+) +\S", re.MULTILINE)


@dataclass
class MessageSection:
    """Constants and fields of a message without an empty line between them, with the comment above them."""

    comment: str = ""
    constants: list[tuple[str, str, str, str]] = field(default_factory=list)
    """Type, name, value and meaning."""
    fields: list[tuple[str, str, str]] = field(default_factory=list)
    """Type, name and meaning."""


def message(path: Path) -> list[MessageSection]:
    """Returns the sections of a message definition; the first one holds the description of the message."""
    return definition(path.read_text(encoding="utf-8"), path)


def action(path: Path) -> dict[str, list[MessageSection]]:
    """Returns the sections of goal, result and feedback of an action definition."""
    parts = path.read_text(encoding="utf-8").split("\n---\n")
    return {name: definition(part, path) for name, part in zip(("Goal", "Result", "Feedback"), parts, strict=True)}


def definition(text: str, path: Path) -> list[MessageSection]:
    """Returns the sections of a definition in the file `path`."""
    sections = []
    for block in text.strip().split("\n\n"):
        section = MessageSection()
        for line in block.splitlines():
            if line.startswith("#"):
                text = line.removeprefix("#").strip()
                section.comment += f" {text}" if text else "\n\n"
            elif found := CONSTANT.fullmatch(line):
                section.constants.append((found[1], found[2], found[3], found[4] or ""))
            elif found := FIELD.fullmatch(line):
                section.fields.append((found[1], found[2], found[3] or ""))
            else:
                raise ValueError(f"{path}: neither comment, constant nor field: {line}")
        section.comment = section.comment.strip().replace("\n\n ", "\n\n")
        sections.append(section)
    return sections


@dataclass
class LaunchFile:
    """Documentation and arguments of a launch file."""

    name: str
    documentation: str
    arguments: list[tuple[str, str, list[str] | None, str]]
    """Name, default, choices and meaning."""


def launch_file(path: Path) -> LaunchFile:
    """Returns the contents of a launch file without importing ROS: its constants and the list ARGUMENTS."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    constants: dict[str, Any] = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            try:
                constants[node.targets[0].id] = _literal(node.value, constants)
            except ValueError:
                continue
    if "ARGUMENTS" not in constants:
        raise ValueError(f"{path}: no list ARGUMENTS of literals")
    return LaunchFile(path.name, ast.get_docstring(tree) or "", constants["ARGUMENTS"])


def _literal(node: ast.expr, constants: dict[str, Any]) -> Any:
    """Returns the value of a literal that may contain names of `constants`."""
    if isinstance(node, ast.Name) and node.id in constants:
        return constants[node.id]
    if isinstance(node, (ast.List, ast.Tuple)):
        return [_literal(element, constants) for element in node.elts]
    return ast.literal_eval(node)


def help_texts(program: Path, *command: str) -> dict[tuple[str, ...], str]:
    """Returns the help of a command and of its subcommands, in their order."""
    text = subprocess.run([program, *command, "--help"], check=True, capture_output=True, text=True, timeout=60).stdout
    lines = [line.rstrip() for line in text.strip().splitlines()]
    texts = {command: "\n".join(lines)}
    _, _, listed = text.partition("\nCommands:\n")
    for name in COMMAND.findall(listed.split("\n\n")[0]):
        if name != "help":
            texts |= help_texts(program, *command, name)
    return texts
