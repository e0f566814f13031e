"""Execution of a page."""

from __future__ import annotations

import difflib
from pathlib import Path

from .blocks import Block, Command, EditBlock, FileBlock, read
from .compare import difference
from .place import Place
from .terminal import Terminal

SECONDS = 240
"""Longest time of a command, unless `timeout=` says another."""
BACKGROUND_SECONDS = 30
"""Longest time until a command in the background has printed the shown output."""

SETTLE_SECONDS = 0.3
"""Time that a command in the background must outlive its first output."""


class Page:
    """One page: its blocks, and the terminals of a reader who follows it."""

    def __init__(self, file: Path, place: Place, *, marked_only: bool = False) -> None:
        """Reads the page and rejects commands that would not be executed."""
        self.file, self.place = file, place
        self.text = file.read_text(encoding="utf-8")
        self.items, self.options = read(self.text, marked_only=marked_only)
        if marked_only:
            self.options.setdefault("installed", "virtual_axes")
        self.outputs: list[tuple[Block, Command, list[str]]] = []
        """Commands whose output differs, with the output."""
        self.output_faults: list[str] = []
        """Faults that `update` mends."""
        self._terminals: dict[str, Terminal] = {}

    def run(self, *, keep_going: bool = False) -> list[str]:
        """Executes the page and returns its faults: the first, or with `keep_going` differing output of all."""
        faults: list[str] = []
        installed = self.options.get("installed")
        installs = {
            None: [],
            "virtual_axes": [self.place.install_command],
            "virtual_axes_py": [self.place.install_command, self.place.install_module],
            "workspace": [self.place.install_workspace],
        }
        if installed not in installs:
            return [f"installed={installed}: known are {', '.join(filter(None, installs))}"]
        for install in installs[installed]:
            install()
        try:
            for item in self.items:
                if isinstance(item, EditBlock):
                    faults += self._edit(item)
                else:
                    faults += self._file(item) if isinstance(item, FileBlock) else self._block(item)
                if faults and not keep_going:
                    break
        finally:
            for terminal in self._terminals.values():
                terminal.close()
            self.place.remove()
        return faults

    def _terminal(self, name: str) -> Terminal:
        if name not in self._terminals:
            self._terminals[name] = Terminal(self.place.work, self.place.environment)
        return self._terminals[name]

    def _file(self, item: FileBlock) -> list[str]:
        """Saves a file in the directory of the main terminal."""
        name = item.name.replace("~", str(self.place.home), 1) if item.name.startswith("~/") else item.name
        path = self._terminal("").directory / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(item.content, encoding="utf-8")
        return []

    def _edit(self, item: EditBlock) -> list[str]:
        """Applies the changes of a file."""
        path = self._terminal("").directory / item.name
        text = path.read_text(encoding="utf-8")
        for before, after in item.hunks:
            if (count := text.count(before)) != 1:
                return [f"{self.file.name}:{item.line}: {item.name} has {count} times, not once:\n{before}"]
            text = text.replace(before, after)
        path.write_text(text, encoding="utf-8")
        return []

    def _block(self, block: Block) -> list[str]:
        if block.is_covered:
            return []
        if "in" in block.options:
            checkout = self.place.copy_checkout()
            terminal = self._terminal(block.terminal)
            target = self.place.environment.get("CARGO_TARGET_DIR", "")
            terminal.run(f"cd '{checkout}'; export CARGO_TARGET_DIR='{target}'", 10)
        terminal = self._terminal(block.terminal)
        faults = []
        for command in block.commands:
            is_last = command is block.commands[-1]
            found = self._command(block, command, terminal, is_last)
            if found:
                faults.append(f"{self.file.name}:{command.line}: $ {command.text}\n  {found}")
                if not self.outputs or self.outputs[-1][1] is not command:
                    break
                self.output_faults.append(faults[-1])
        return faults

    def _command(self, block: Block, command: Command, terminal: Terminal, is_last: bool) -> str:
        """Executes a command and returns its fault, or an empty text."""
        terminal.start(self.place.command(command.text))
        in_background = is_last and "background" in block.options
        seconds = float(block.options.get("timeout", BACKGROUND_SECONDS if in_background else SECONDS))

        def is_shown(lines: list[str]) -> bool:
            return not difference(command.expected, [*map(self.place.shown, lines)], is_prefix=True)

        lines, status = terminal.wait(seconds, is_shown if in_background else None)
        if in_background and status is None:
            # Finds a command that ends directly after its output.
            lines, status = terminal.wait(SETTLE_SECONDS)
        lines = [*map(self.place.shown, lines)]
        text = "\n".join(f"  | {line}" for line in lines)
        wanted = int(block.options.get("status", 0)) if is_last else 0
        if in_background and status is not None:
            return f"ended with status {status}, expected to keep running; output:\n{text}"
        if not in_background and status is None:
            return f"did not end within {seconds:g} s; output:\n{text}"
        if not in_background and status != wanted:
            return f"status {status}, expected {wanted}; output:\n{text}"
        found = difference(command.expected, lines, is_prefix=in_background)
        if found:
            self.outputs.append((block, command, lines))
            return f"{found}; output:\n{text}"
        return ""

    def update(self) -> str:
        """Writes differing output into the page and returns the changes as a diff."""
        lines = self.text.splitlines()
        for block, command, output in reversed(self.outputs):
            start = command.first_output - 1
            indented = [f"{' ' * block.indent}{line}".rstrip() for line in output]
            lines[start : start + len(command.expected)] = indented
        updated = "\n".join(lines) + "\n"
        self.file.write_text(updated, encoding="utf-8")
        return "\n".join(difflib.unified_diff(self.text.splitlines(), updated.splitlines(), lineterm="", n=1))
