#!/usr/bin/env python3
"""Checks language and names: doc comments, banned words, spelling, public type names, paths in ARCHITECTURE.md.

    tools/check_style.py [--root DIR]    prints each violation as FILE:LINE: RULE: TEXT; exit status 1 if there is any

The rules are listed in CONTRIBUTING.md.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
SUFFIXES = {".rs", ".py", ".md", ".toml", ".yaml", ".sh", ".msg", ".xml", ".rviz", ".css"}
SKIPPED = {"target", ".venv", ".build", ".git", "__pycache__", "corpus", "artifacts", "seeds", "LICENSE"}
SKIPPED |= {"check_style.py", "test_check_style.py"}

OPENING = re.compile(
    r"^\s*//[/!] (What|Who|How|Whether|Whoever|Where|When|Why|As|Likewise|So|Such|Nobody|Somebody|None|Of)\b"
)
VERB = re.compile(r"[A-Z][a-z]+s\b")
FUNCTION = re.compile(r"^\s*(pub(\([a-z:\s]+\))? )?(const |async |unsafe |extern \"C\" )*fn (\w+)")
BANNED = re.compile(r"\b(?:nobody|somebody|anybody|whoever|hears|(?:is|are) told|set-points?)\b", re.IGNORECASE)
BRITISH = re.compile(
    r"\b\w*(?:metres?|centred?|centres|colours?|coloured|neighbours?|behaviours?|licence|cancelled|cancelling|"
    r"labelled|modelled|(?<!Feed drive )modelling|"
    r"(?:synchron|discret|minim|maxim|normal|serial|optim|initial|linear|quant|parametr|"
    r"recogn|organ|summar|util|stabil|visual|vector|general|special)is(?:e[ds]?|ing|ation)s?)\b",
    re.IGNORECASE,
)
TYPE = re.compile(r"^\s*pub(?:\([a-z:\s]+\))? (?:struct|enum|trait|union|type) (\w+)")


class Violation(NamedTuple):
    """One line that breaks a rule."""

    file: str
    line: int
    rule: str
    text: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.rule}: {self.text.strip()}"


def sources(root: Path) -> Iterator[Path]:
    """Yields the text files that the rules apply to."""
    for path in sorted(root.rglob("*")):
        parts = path.relative_to(root).parts
        if path.suffix in SUFFIXES and not SKIPPED.intersection(parts) and path.is_file():
            if not any(parent.is_symlink() for parent in path.parents if root in parent.parents):
                yield path


def without_tests(lines: list[str]) -> list[str]:
    """Returns the lines in front of the unit tests at the end of a Rust file."""
    for number, line in enumerate(lines):
        if line.startswith("#[cfg(test)]") and lines[number + 1 : number + 2] and "mod tests" in lines[number + 1]:
            return lines[:number]
    return lines


def words(file: str, lines: list[str]) -> Iterator[Violation]:
    """Yields banned words and British spellings."""
    for number, line in enumerate(lines, 1):
        for rule, pattern in (("banned word", BANNED), ("American spelling", BRITISH)):
            for match in pattern.finditer(line):
                yield Violation(file, number, f"{rule} '{match[0]}'", line)


def documentation(file: str, lines: list[str]) -> Iterator[Violation]:
    """Yields doc comments whose opening names no thing and no action."""
    shipped = 0 if "tests" in Path(file).parts or file.endswith("tests.rs") else len(without_tests(lines))
    opening = None
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if OPENING.match(line):
            yield Violation(file, number, "opening of a doc comment", line)
        if text.startswith("///"):
            opening = opening or (number, text[3:].strip())
            continue
        if text.startswith(("#[", "#![", ")]", "//")) or (opening and text.endswith(")]")):
            continue
        function = FUNCTION.match(line) if number <= shipped else None
        if opening and function and not VERB.match(opening[1]):
            yield Violation(file, opening[0], f"no third-person verb opens the docs of {function[4]}()", opening[1])
        opening = None


def types(root: Path) -> Iterator[Violation]:
    """Yields public type names that occur more than once, besides those of crates/dds, which are those of rclrs."""
    found: dict[str, tuple[str, int]] = {}
    for path in sources(root):
        file = path.relative_to(root).as_posix()
        if path.suffix != ".rs" or not re.match(r"(src|crates/(?!dds/)\w+/src)/", file) or "/tests" in file:
            continue
        for number, line in enumerate(without_tests(path.read_text().splitlines()), 1):
            if match := TYPE.match(line):
                if match[1] in found:
                    first, at = found[match[1]]
                    yield Violation(file, number, f"type name {match[1]} exists in {first}:{at}", line)
                found.setdefault(match[1], (file, number))


def paths(root: Path) -> Iterator[Violation]:
    """Yields files and folders that ARCHITECTURE.md names and that do not exist."""
    page = root / "ARCHITECTURE.md"
    for number, line in enumerate(page.read_text().splitlines() if page.exists() else [], 1):
        for name in re.findall(r"`((?:crates|src|tools|tests|docs|benches|test_py|fuzz)/[\w./]+)`", line):
            if not (root / name).exists():
                yield Violation(page.name, number, f"{name} does not exist", line)


def check(root: Path) -> list[Violation]:
    """Returns all violations below a folder."""
    violations: list[Violation] = []
    for path in sources(root):
        file = path.relative_to(root).as_posix()
        lines = path.read_text(errors="replace").splitlines()
        violations += words(file, lines)
        if path.suffix == ".rs":
            violations += documentation(file, lines)
    return violations + list(types(root)) + list(paths(root))


def main() -> int:
    """Checks the folder that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=ROOT)
    root = parser.parse_args().root.resolve()
    if not root.is_dir():
        parser.error(f"--root: {root} is no folder")
    violations = check(root)
    for violation in violations:
        print(violation)
    print(f"{len(violations)} violations" if violations else "style: no violations")
    return bool(violations)


if __name__ == "__main__":
    sys.exit(main())
