"""Execution of one page."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from .blocks import Block, Command, PageError, blocks
from .compare import mismatch
from .environment import environment
from .terminal import Terminal

ROOT = Path(__file__).resolve().parent.parent.parent
TIMEOUT_S = 600.0
"""Time limit of a command, s: it allows for a build from an empty cache."""
READY_S = 20.0
"""Time limit for the first output of a background command, s."""


@dataclass(frozen=True)
class Difference:
    """Difference between a page and its execution."""

    command: Command
    text: str
    actual: list[str]


def run_page(page: Path, directory: Path, domain: int) -> Iterator[Difference]:
    """Executes a page in an empty directory and yields the differences."""
    found = blocks(page)
    places = {"checkout": ROOT, "copy": directory / "virtual_axes"}
    if any(block.options.get("in") == "copy" for block in found):
        copy_checkout(places["copy"])
    home, start = directory / "home", directory / "start"
    home.mkdir()
    start.mkdir()
    terminals: dict[str, Terminal] = {}
    with ExitStack() as stack:
        for block in found:
            if "covered-by" in block.options:
                continue
            if block.terminal not in terminals:
                terminals[block.terminal] = Terminal(start, environment(home, directory, domain))
                stack.callback(terminals[block.terminal].close)
            if place := block.options.get("in"):
                terminals[block.terminal].execute(f"cd '{places[place]}'", 10)
            yield from _run_block(block, terminals[block.terminal])


def _run_block(block: Block, terminal: Terminal) -> Iterator[Difference]:
    if name := block.options.get("file"):
        _, folder = terminal.execute("pwd", 10)
        Path(folder[0], name).write_text(block.content, encoding="utf-8")
    for command in block.commands:
        if "background" in block.options and command is block.commands[-1]:
            expected = command.expected
            actual = terminal.start(command.text, lambda lines, e=expected: mismatch(e, lines) is None, READY_S)
            status = 0
        else:
            status, actual = terminal.execute(command.text, TIMEOUT_S)
        if status:
            yield Difference(command, f"exit status {status}", actual)
        elif text := mismatch(_without_blank_end(command.expected), actual):
            yield Difference(command, text, actual)


def _without_blank_end(lines: list[str]) -> list[str]:
    kept = list(lines)
    while kept and not kept[-1]:
        kept.pop()
    return kept


def copy_checkout(target: Path) -> None:
    """Copies the files of the checkout that are under version control, or would be."""
    listed = ["git", "-C", str(ROOT), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listed, check=True, capture_output=True, text=True, timeout=30).stdout.split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)


def update(page: Path, differences: list[Difference]) -> None:
    """Writes the actual output of the commands with differences into the page."""
    lines = page.read_text(encoding="utf-8").splitlines()
    for difference in sorted(differences, key=lambda one: one.command.line, reverse=True):
        command = difference.command
        first = command.line + command.text.count("\n")
        lines[first : command.end - 1] = difference.actual
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")


__all__ = ["Difference", "PageError", "copy_checkout", "run_page", "update"]
