"""Progress of the commands on long part programs: a bar on a terminal only, which is removed at the end."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from node_process import node_binary

ROOT = Path(__file__).resolve().parent.parent
COMMAND = node_binary().with_name("virtual_axes")
MOTIONS = 300_000
"""Number of motions whose interpretation and planning takes longer than a second."""
CLEARED = b"\r\x1b[2K"
"""Control codes that remove a line."""


@pytest.fixture(scope="module")
def raster(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("progress") / "raster.nc"
    with program.open("w") as out:
        command = [sys.executable, ROOT / "tools/part_programs.py", "--raster", str(MOTIONS)]
        subprocess.run(command, check=True, stdout=out, timeout=120)
    return program


def on_terminal(arguments: list[object]) -> bytes:
    """Runs the command with standard error on a terminal of 100 columns and returns its output there."""
    here, there = pty.openpty()
    fcntl.ioctl(there, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    # Without TERM, a bar is never shown.
    env = os.environ | {"TERM": "xterm"}
    with subprocess.Popen([COMMAND, *arguments], stdout=subprocess.DEVNULL, stderr=there, env=env) as process:
        os.close(there)
        found = b""
        try:
            while chunk := os.read(here, 65536):
                found += chunk
        except OSError:
            pass  # The end of the terminal.
        finally:
            os.close(here)
        assert process.wait(60) == 0
    return found


def commands(raster: Path) -> list[list[object]]:
    return [["run", raster], ["check", raster], ["psec", raster, "--out", raster.with_suffix(".csv")]]


def test_a_long_program_has_a_bar_of_its_lines_on_a_terminal(raster: Path) -> None:
    lines = len(raster.read_text().splitlines())
    for arguments in commands(raster):
        found = on_terminal(arguments)
        shown = [[int(number) for number in pair] for pair in re.findall(rb"line (\d+) of (\d+), ", found)]
        assert len(shown) > 2 and {total for _, total in shown} == {lines}, arguments
        assert all(0 < line <= lines for line, _ in shown)
        # `check` reads the program twice.
        steps_back = sum(before > after for (before, _), (after, _) in zip(shown, shown[1:]))
        assert steps_back <= (arguments[0] == "check"), arguments
        assert found.endswith(CLEARED), found[-80:]


def test_no_progress_without_a_terminal(raster: Path) -> None:
    ended = subprocess.run([COMMAND, "check", raster], capture_output=True, timeout=120)
    assert (ended.returncode, ended.stderr) == (0, b"")
