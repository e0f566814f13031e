"""Blocks of a page that are executed, and the files that a page creates."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

OPTIONS = {"in", "terminal", "background", "covered-by", "file"}
COVERED_BY = {"./test.sh"}
"""Commands that CI executes and that a page therefore only shows."""
PLACES = ["checkout", "copy"]
"""Directories of the package: the checkout itself, or a copy of it without build folders."""
SHELL_LANGUAGES = {"", "bash", "sh", "shell", "zsh", "terminal", "text"}
"""Languages of a block that must not contain commands, since they would not be executed."""
FENCE = re.compile(r"^(\s*)```(\S*)\s*$")
COMMENT = re.compile(r"^\s*<!-- (run|file): (.*) -->\s*$")


class PageError(Exception):
    """Invalid block of a page."""


@dataclass
class Command:
    """Command with its expected output."""

    text: str
    line: int
    """Line of the page, from 1."""
    expected: list[str] = field(default_factory=list)
    end: int = 0
    """Line after the expected output, from 1."""


@dataclass
class Block:
    """Block of commands, or file."""

    line: int
    options: dict[str, str]
    commands: list[Command] = field(default_factory=list)
    content: str = ""
    """Content of a file block."""

    @property
    def terminal(self) -> str:
        """Returns the name of the shell."""
        return self.options.get("terminal", "main")


def blocks(page: Path) -> list[Block]:
    """Returns the blocks of a page in their order; raises PageError for an invalid one."""
    lines = page.read_text(encoding="utf-8").splitlines()
    found: list[Block] = []
    options: dict[str, str] = {}
    index = 0
    while index < len(lines):
        line = lines[index]
        index += 1
        if comment := COMMENT.match(line):
            options = _options(comment[1], comment[2], f"{page.name}:{index}")
            continue
        fence = FENCE.match(line)
        if not fence:
            if options:
                raise PageError(f"{page.name}:{index}: a block must follow the comment")
            if re.match(r"^(    |\t)\$ ", line):
                raise PageError(f"{page.name}:{index}: a command outside a ```console block is not executed")
            continue
        start, body = index, []
        while index < len(lines) and lines[index].strip() != "```":
            body.append(lines[index].removeprefix(fence[1]))
            index += 1
        if index == len(lines):
            raise PageError(f"{page.name}:{start}: the block has no end")
        index += 1
        block = _block(fence[2], body, start, options, page.name)
        found += [block] if block else []
        options = {}
    return found


def _options(kind: str, text: str, place: str) -> dict[str, str]:
    if kind == "file":
        return {"file": text}
    options = dict(word.partition("=")[::2] for word in text.split())
    if unknown := set(options) - OPTIONS:
        raise PageError(f"{place}: unknown option {', '.join(sorted(unknown))}; allowed: {', '.join(sorted(OPTIONS))}")
    if options.get("in", PLACES[0]) not in PLACES:
        raise PageError(f"{place}: in={options['in']}: must be one of {', '.join(PLACES)}")
    if options.get("covered-by", "./test.sh") not in COVERED_BY:
        raise PageError(f"{place}: covered-by={options['covered-by']}: must be {' or '.join(COVERED_BY)}")
    return options


def _block(language: str, body: list[str], start: int, options: dict[str, str], page: str) -> Block | None:
    if "file" in options:
        return Block(start, options, content="\n".join(body) + "\n")
    if language != "console":
        if options:
            raise PageError(f"{page}:{start}: a `run` comment needs a ```console block, not ```{language}")
        if language in SHELL_LANGUAGES:
            raise PageError(f"{page}:{start}: ```{language} is not executed; use ```console, or name the language")
        return None
    commands: list[Command] = []
    for number, line in enumerate(body, start + 1):
        if line.startswith("$ "):
            commands.append(Command(line[2:], number))
        elif not commands:
            raise PageError(f"{page}:{number}: a ```console block must begin with a command, `$ …`")
        elif line.startswith("> ") and not commands[-1].expected:
            commands[-1].text += "\n" + line[2:]
        else:
            commands[-1].expected.append(line.rstrip())
        commands[-1].end = number + 1
    return Block(start, options, commands)
