"""Tests that tools/check_style.py finds a planted violation of each rule and accepts correct text."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parent.parent / "tools" / "check_style.py"

CORRECT = """//! Gain limit of a controller.

/// Gain limit for a given action.
pub struct GainLimit;

/// Returns the limit, in output units.
pub fn limit() -> f64 {
    1.0
}
"""


def run(root: Path) -> subprocess.CompletedProcess[str]:
    """Runs the tool on a folder."""
    return subprocess.run([sys.executable, TOOL, "--root", root], capture_output=True, text=True, timeout=60)


def write(root: Path, file: str, text: str) -> None:
    """Writes a file below a folder."""
    path = root / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def test_correct_text_is_accepted(tmp_path: Path) -> None:
    write(tmp_path, "src/lib.rs", CORRECT)
    done = run(tmp_path)
    assert (done.returncode, done.stdout) == (0, "style: no violations\n")


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("src/lib.rs", "/// What a gain is limited to.\npub struct Other;\n", "src/lib.rs:1: opening of a doc comment"),
        ("src/lib.rs", "/// The limit.\n#[must_use]\npub fn other() {}\n", "third-person verb"),
        ("src/lib.rs", "// Nobody subscribes.\n", "banned word 'Nobody'"),
        ("test_py/test_x.py", '"""A set-point."""\n', "banned word 'set-point'"),
        ("README.md", "The signals are synchronised.\n", "American spelling 'synchronised'"),
        ("crates/core/src/lib.rs", "/// Gain.\npub enum GainLimit {}\n", "type name GainLimit exists in"),
        ("ARCHITECTURE.md", "The limit is in `src/missing.rs`.\n", "src/missing.rs does not exist"),
    ],
)
def test_a_planted_violation_is_found(tmp_path: Path, file: str, text: str, message: str) -> None:
    write(tmp_path, "src/gain.rs", CORRECT)
    write(tmp_path, file, text)
    done = run(tmp_path)
    assert done.returncode == 1
    assert message in done.stdout


def test_a_missing_folder_is_an_error(tmp_path: Path) -> None:
    done = run(tmp_path / "missing")
    assert done.returncode == 2
    assert "no folder" in done.stderr
