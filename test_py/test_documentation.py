"""README and tutorials: each command is executed, and its output compared with the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from documentation import PageError, blocks, mismatch, run_page
from drive import DomainId

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_output(page: Path, tmp_path: Path):
    """The commands of a page succeed and print what the page shows."""
    domain = DomainId()
    try:
        differences = list(run_page(page, tmp_path, domain.value))
    finally:
        domain.release()
    report = [f"{page.name}:{one.command.line}: {one.text}\n" + "\n".join(one.actual) for one in differences]
    assert not report, "\n\n".join(report)


def test_the_readme_is_short():
    """README.md has at most 200 lines."""
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 200


# ------------------------------------------------------------------------------- the runner itself


@pytest.mark.parametrize(
    ("expected", "actual"),
    [
        (["mean  49.0 µm"], ["mean 49.1 µm"]),
        (["a", "...", "z"], ["a", "b", "c", "z"]),
        (["a", "...", "z"], ["a", "z"]),
        (["Summary: 1 package finished [...]"], ["Summary: 1 package finished [1min 2s]"]),
        (["1.5e-3"], ["0.0016"]),
        (["−0.4"], ["-0.4"]),
    ],
)
def test_equal_output(expected: list[str], actual: list[str]):
    """Output within the tolerance matches."""
    assert mismatch(expected, actual) is None


@pytest.mark.parametrize(
    ("expected", "actual"),
    [
        (["mean 49.0 µm"], ["mean 49.2 µm"]),
        (["5 axes"], ["6 axes"]),
        (["mean 49.0 µm"], ["mean 49.0 mm"]),
        (["a", "b"], ["a"]),
        (["a"], ["a", "b"]),
        ([], ["a"]),
        (["a", "...", "z"], ["a", "b", "c"]),
        (["x1 2.0"], ["x2 2.0"]),
    ],
)
def test_different_output(expected: list[str], actual: list[str]):
    """A wrong number, unit, name, a missing line and an unexpected line are differences."""
    assert mismatch(expected, actual) is not None


@pytest.mark.parametrize(
    "text",
    [
        "```bash\n$ ls\n```\n",
        "```\nls\n```\n",
        "    $ ls\n",
        "```console\nls\n```\n",
        "```console\n$ ls\n",
        "<!-- run: skip -->\n```console\n$ ls\n```\n",
        "<!-- run: covered-by=nothing -->\n```console\n$ ls\n```\n",
        "<!-- run: in=/tmp -->\n```console\n$ ls\n```\n",
        "<!-- run: background -->\n\ntext\n",
        "<!-- run: background -->\n```python\nprint()\n```\n",
    ],
)
def test_invalid_pages(text: str, tmp_path: Path):
    """A command that would not be executed, an unknown option and an unfinished block are errors."""
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    with pytest.raises(PageError):
        blocks(page)


def test_a_page_with_errors(tmp_path: Path):
    """A wrong output and a failing command are found, and what they print; shells keep their directory."""
    page = tmp_path / "page.md"
    page.write_text(
        "<!-- file: hello.txt -->\n```text\nhello 1.0\n```\n"
        "```console\n$ mkdir new && cd new\n$ cat ../hello.txt\nhello 1.0\n$ cat ../hello.txt\nhello 1.5\n"
        "$ exit_3() {\n> return 3; }\n$ exit_3\n```\n"
        "<!-- run: terminal=other background -->\n```console\n$ echo ready; sleep 60\nready\n```\n",
        encoding="utf-8",
    )
    folder = tmp_path / "run"
    folder.mkdir()
    found = [(one.command.line, one.text, one.actual) for one in run_page(page, folder, 1)]
    assert found == [
        (9, "expected `hello 1.5`, found `hello 1.0`", ["hello 1.0"]),
        (13, "exit status 3", []),
    ]
