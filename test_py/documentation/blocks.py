"""Blocks of a Markdown page that are executed, written to files, or forbidden."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field

RUN_KEYS = {"in", "terminal", "background", "covered-by", "status", "timeout"}
PAGE_KEYS = {"installed"}
PLACES = ["checkout", "copy"]
"""Values of `in`; both are a copy of the checkout."""
SHELLS = {"", "bash", "sh", "shell", "zsh", "shell-session", "bash-session"}
"""Languages of fences that may hide commands."""

COVERED_BY = "./test.sh"
"""Command of continuous integration, which may cover a block."""

FENCE = re.compile(r"^(?P<indent> *)(?P<ticks>`{3,}|~{3,})\s*(?P<language>[^`\s]*)[^`]*$")
COMMENT = re.compile(r"^\s*<!-- (?P<kind>run|file|edit|page): (?P<text>.*?) *-->\s*$")
LIST_ITEM = re.compile(r"^\s*([-*+]|\d+[.)]) ")


class PageError(Exception):
    """Fault of a page that is found before anything is executed."""


@dataclass
class Command:
    """One command with the output that the page shows."""

    line: int
    text: str
    expected: list[str] = field(default_factory=list)
    first_output: int = 0
    """Line of the page after the command, counted from 1."""


@dataclass
class Block:
    """Commands that one terminal executes in order."""

    line: int
    indent: int
    options: dict[str, str]
    commands: list[Command]

    @property
    def terminal(self) -> str:
        """Returns the name of the terminal; empty for the main one."""
        return self.options.get("terminal", "")

    @property
    def is_covered(self) -> bool:
        """Returns true if the block is executed elsewhere."""
        return "covered-by" in self.options


@dataclass
class FileBlock:
    """Content of a file that the reader saves."""

    line: int
    name: str
    content: str


@dataclass
class EditBlock:
    """Changes of a file that the reader makes in an editor, as a diff."""

    line: int
    name: str
    hunks: list[tuple[str, str]]
    """Lines before and after, each."""


@dataclass
class Fence:
    """Fenced block with the comment before it."""

    line: int
    indent: int
    language: str
    comment: tuple[str, str] | None
    lines: list[str]


def read(text: str, *, marked_only: bool = False) -> tuple[list[Block | FileBlock | EditBlock], dict[str, str]]:
    """Reads the blocks and the options of a page.

    With `marked_only`, only blocks after a comment are executed, and commands in other blocks are no fault.
    """
    items: list[Block | FileBlock | EditBlock] = []
    page: dict[str, str] = {}
    for element in _elements(text):
        if isinstance(element, tuple):
            line, indented = element
            if not marked_only:
                raise PageError(f"line {line}: indented code block ({indented.strip()}): use a fence of console")
        elif element.language == "page":
            page |= _options(element, PAGE_KEYS)
        elif element.comment or not marked_only:
            items += _items(element)
    return items, page


def _items(fence: Fence) -> list[Block | FileBlock | EditBlock]:
    kind, text = fence.comment or ("", "")
    if kind == "file":
        if not text or fence.language == "console":
            raise PageError(f"line {fence.line}: a file block needs a name and a language other than console")
        return [FileBlock(fence.line, text, "".join(f"{line}\n" for line in fence.lines))]
    if kind == "edit":
        return [EditBlock(fence.line, text, _hunks(fence))]
    if fence.language == "console":
        return [_block(fence)]
    if kind == "run":
        raise PageError(f"line {fence.line}: <!-- run --> belongs before a block of console, not '{fence.language}'")
    if fence.language in SHELLS or any(line.startswith("$ ") for line in fence.lines):
        raise PageError(f"line {fence.line}: block of '{fence.language}': commands stand in a block of console")
    if fence.language in ("python", "py"):
        raise PageError(f"line {fence.line}: Python without <!-- file: NAME --> is executed by no test")
    return []


def _hunks(fence: Fence) -> list[tuple[str, str]]:
    """Returns the hunks of a block of diff, which lines of `...` separate."""
    hunks = [([], [])]
    for line in fence.lines:
        if line == "...":
            hunks.append(([], []))
            continue
        if line[:1] not in (" ", "-", "+"):
            raise PageError(f"line {fence.line}: a line of an edit begins with a space, - or +: {line}")
        before, after = hunks[-1]
        if line[0] != "+":
            before.append(f"{line[1:]}\n")
        if line[0] != "-":
            after.append(f"{line[1:]}\n")
    return [("".join(before), "".join(after)) for before, after in hunks]


def _block(fence: Fence) -> Block:
    options = _options(fence, RUN_KEYS) if fence.comment else {}
    block = Block(fence.line, fence.indent, options, _commands(fence))
    if not block.commands:
        raise PageError(f"line {fence.line}: no command in a block of console")
    if options.get("in", PLACES[0]) not in PLACES:
        raise PageError(f"line {fence.line}: in={options['in']}: must be one of {', '.join(PLACES)}")
    if "background" in options and not block.terminal:
        raise PageError(f"line {fence.line}: a command in the background needs a terminal=NAME of its own")
    for number in ("status", "timeout"):
        if number in options and not options[number].isdigit():
            raise PageError(f"line {fence.line}: {number}={options[number]} is not a number")
    if (cover := options.get("covered-by", COVERED_BY)) != COVERED_BY:
        raise PageError(f"line {fence.line}: covered-by={cover}: continuous integration executes {COVERED_BY}")
    return block


def _commands(fence: Fence) -> list[Command]:
    commands: list[Command] = []
    for offset, line in enumerate(fence.lines, 1):
        number = fence.line + offset
        if line.startswith("$ "):
            commands.append(Command(number, line[2:], first_output=number + 1))
        elif not commands:
            raise PageError(f"line {number}: output before the first command")
        elif line.startswith("> ") and not commands[-1].expected:
            commands[-1].text += f"\n{line[2:]}"
            commands[-1].first_output = number + 1
        else:
            commands[-1].expected.append(line.rstrip())
    return commands


def _options(fence: Fence, allowed: set[str]) -> dict[str, str]:
    options = {}
    for word in shlex.split(fence.comment[1]):
        key, _, value = word.partition("=")
        if key not in allowed:
            raise PageError(f"line {fence.line}: unknown option {key}; allowed: {', '.join(sorted(allowed))}")
        options[key] = value
    return options


def _elements(text: str) -> Iterator[Fence | tuple[int, str]]:
    """Yields fences, options of the page as a fence of the language `page`, and lines of indented code."""
    comment: tuple[str, str] | None = None
    fence: Fence | None = None
    ticks, previous_blank, in_list = "", True, False
    for number, line in enumerate(text.splitlines(), 1):
        if fence:
            if line.strip().startswith(ticks) and not line.strip().strip(ticks[0]):
                yield fence
                fence = None
            else:
                fence.lines.append(line[min(fence.indent, len(line) - len(line.lstrip())) :])
            continue
        if match := FENCE.match(line):
            ticks = match["ticks"]
            fence = Fence(number, len(match["indent"]), match["language"].lower(), comment, [])
            comment, previous_blank = None, False
            continue
        if comment and line.strip():
            raise PageError(f"line {number}: the comment '{comment[0]}: {comment[1]}' is not directly before a block")
        if match := COMMENT.match(line):
            if match["kind"] == "page":
                yield Fence(number, 0, "page", ("page", match["text"]), [])
            else:
                comment = (match["kind"], match["text"])
            continue
        in_list = bool(LIST_ITEM.match(line)) or (in_list and (not line.strip() or line.startswith(" ")))
        if line.startswith(("    ", "\t")) and previous_blank and line.strip() and not in_list:
            yield number, line
        previous_blank = not line.strip()
    if fence:
        raise PageError(f"line {fence.line}: the block does not end")
    if comment:
        raise PageError(f"the comment '{comment[0]}: {comment[1]}' at the end is before no block")
