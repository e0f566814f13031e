"""Commands of README.md, of the tutorials and of marked blocks of the how-to pages, executed as printed.

`documentation` is the runner; where ROS 2 is not installed, stand-ins replace it, and the summary of pytest names them.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from documentation import Page, PageError, difference, read
from documentation.place import ROOT, Place
from node_process import DomainId, node_binary

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]
PARTLY = sorted((ROOT / "docs" / "how-to").glob("*.md"))
"""Pages where only marked blocks are executed, with `virtual_axes` on the PATH."""
BUILDS = ("README.md", "first-run.md")
"""Pages that build the programs."""


def place(directory: Path, domain: DomainId) -> Place:
    """Returns a home directory and the like below a directory."""
    return Place(directory.resolve(), node_binary(), domain.value)


def faults(directory: Path, text: str) -> list[str]:
    """Executes a page with this text."""
    file = directory / "page.md"
    file.write_text(text, encoding="utf-8")
    domain = DomainId()
    try:
        return Page(file, place(directory, domain)).run()
    finally:
        domain.release()


def console(*lines: str, comment: str = "") -> str:
    """Returns a block of console."""
    return "\n".join([*([f"<!-- run: {comment} -->"] if comment else []), "```console", *lines, "```", "", ""])


@pytest.mark.parametrize(
    "file",
    [
        pytest.param(file, marks=[pytest.mark.extended] * (file.name in BUILDS), id=file.relative_to(ROOT).as_posix())
        for file in [*PAGES, *PARTLY]
    ],
)
def test_commands_do_what_the_page_shows(file: Path, tmp_path: Path, record_property):
    """Each command runs, and prints the shown output."""
    domain = DomainId()
    here = place(tmp_path, domain)
    try:
        found = Page(file, here, marked_only=file in PARTLY).run()
    finally:
        domain.release()
    for name in sorted(here.standins):
        record_property("stand-in", name)
    assert not found, "\n".join(found)


def test_the_readme_is_short():
    """README.md has at most 200 lines."""
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 200


def test_a_correct_page_passes(tmp_path: Path):
    """Directory and variables last from block to block; `...` stands for lines and for parts of a line."""
    text = "<!-- file: sub/data.txt -->\n```csv\n1.50\n```\n\n" + console(
        "$ cd sub; export NAME=x", "$ cat data.txt; ls ~", "1.50"
    )
    text += console("$ echo $NAME $(basename $PWD); seq 9; echo took 7.23 s", "x sub", "...", "8", "9", "took ... s")
    text += console("$ for i in 1 2; do", ">   echo line $i", "> done", "line 1", "line 2")
    text += console("$ false", comment="status=1")
    text += console("$ (echo up; sleep 60)", "up", comment="terminal=two background")
    text += console("$ pwd", f"{tmp_path}/work", comment="terminal=two")
    assert faults(tmp_path, text) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (console("$ echo 12.34 µm", "12.32 µm"), "expected '12.32 µm', got '12.34 µm'"),
        (console("$ echo 12.34 µm", "12.3 µm"), "expected '12.3 µm'"),
        (console("$ seq 3", "1", "3"), "expected '3', got '2'"),
        (console("$ seq 2", "1", "2", "3"), "got the end of the output"),
        (console("$ seq 2", "1"), "more output than shown, from: '2'"),
        (console("$ seq 2"), "more output than shown"),
        (console("$ seq 2", "...", "4"), "no line after '...' matches '4'"),
        (console("$ false"), "status 1, expected 0"),
        (console("$ true", comment="status=1"), "status 0, expected 1"),
        (console("$ no-such-program"), "status 127"),
        (console("$ sleep 60", comment="timeout=1"), "did not end within 1 s"),
        (console("$ echo up", "up", comment="terminal=a background"), "expected to keep running"),
        (console("$ sleep 60", "up", comment="terminal=a background timeout=1"), "got the end of the output"),
    ],
)
def test_a_wrong_page_fails(text: str, message: str, tmp_path: Path):
    """Differing numbers and lines, failing commands and commands that do not end are found."""
    [fault] = faults(tmp_path, text)
    assert message in fault and "page.md:" in fault


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("```bash\nls\n```\n", "commands stand in a block of console"),
        ("```sh\nls\n```\n", "commands stand in a block of console"),
        ("```\nls\n```\n", "commands stand in a block of console"),
        ("```text\n$ ls\n```\n", "commands stand in a block of console"),
        ("Text:\n\n    cargo build\n", "indented code block (cargo build)"),
        ("```python\nprint(1)\n```\n", "executed by no test"),
        (console("$ ls", comment="skip"), "unknown option skip"),
        (console("$ ls", comment="in=elsewhere"), "must be one of checkout, copy"),
        (console("$ ls", comment="background"), "needs a terminal=NAME"),
        (console("$ ./test.sh", comment="covered-by=nightly"), "continuous integration executes"),
        (console("output", "$ ls"), "output before the first command"),
        ("```console\n```\n", "no command"),
        ("```console\n$ ls\n", "the block does not end"),
        ("<!-- run: in=checkout -->\nText\n", "is not directly before a block"),
        ("<!-- run: in=checkout -->\n```yaml\na: 1\n```\n", "belongs before a block of console"),
    ],
)
def test_commands_that_nothing_executes_are_faults(text: str, message: str):
    """Commands outside of blocks of console, and undocumented exceptions, are errors of the page."""
    with pytest.raises(PageError, match=message.replace("(", r"\(").replace(")", r"\)")):
        read(text)


def test_lists_and_excerpts_are_no_commands():
    """Continued list items, YAML excerpts and tables of numbers pass."""
    blocks, page = read("- item\n\n      more\n\n<!-- page: installed=virtual_axes -->\n```yaml\nx: 1\n```\n")
    assert (blocks, page) == ([], {"installed": "virtual_axes"})
    blocks, _ = read("```bash\nls\n```\n" + console("$ ls", comment="in=checkout"), marked_only=True)
    assert [block.commands[0].text for block in blocks] == ["ls"]


@pytest.mark.parametrize(
    ("expected", "actual", "equal"),
    [
        ("x 3.14 mm", "x 3.15 mm", True),
        ("x 3.14 mm", "x 3.16 mm", False),
        ("x 3.14 mm", "x 3.140 mm", False),
        ("−0.4", "−0.5", True),
        ("+0.1", "-0.1", False),
        ("1.0e-9", "1.1e-9", True),
        ("1.0e-9", "1.0e-8", False),
        ("7 axes", "8 axes", False),
        ("version 0.1.0", "version 0.1.1", False),
        ("cycle-1.csv", "cycle-2.csv", False),
        ("took ... of 2.5 s", "took 1.234 of 2.6 s", True),
        ("took ... of 2.5 s", "took 1.234 of 2.7 s", False),
        ("mean ...", "mean 4", True),
        ("mean ...", "meal 4", False),
    ],
)
def test_numbers_match_within_one_unit_of_the_last_digit(expected: str, actual: str, equal: bool):
    """Integers, text, versions and names are compared literally."""
    assert (difference([expected], [actual]) == "") == equal


def test_nothing_that_a_page_starts_survives_it(tmp_path: Path):
    """Processes in the background end with the page."""
    text = console("$ sleep 987 & echo $! >~/pid; wait", comment="terminal=a background")
    text += console("$ while [ ! -s ~/pid ]; do sleep 0.05; done; cat ~/pid >../pid")
    assert faults(tmp_path, text) == []
    pid = int((tmp_path / "pid").read_text())
    assert not Path(f"/proc/{pid}").exists()
