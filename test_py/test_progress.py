"""Progress of the commands on long part programs: a bar on a terminal only, which is removed at the end."""

from __future__ import annotations

import fcntl
import math
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

from node_process import node_binary

ROOT = Path(__file__).resolve().parent.parent
COMMAND = node_binary().with_name("virtual_axes")
MOTIONS = 100_000
"""Number of motions of one raster."""
WORK_S = 3.0
"""Time that `check` takes at least for the program: a bar is shown after one second."""
CLEARED = b"\r\x1b[2K"
"""Control codes that remove a line."""


@pytest.fixture(scope="module")
def raster(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rasters one after the other, as many as the machine that runs the test needs for a long work."""
    command = [sys.executable, ROOT / "tools/part_programs.py", "--raster", str(MOTIONS)]
    printed = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout
    head, start, rest = printed.partition("G0 X0 Y0 Z10\n")
    motions, end, tail = rest.partition("G49\n")
    program = tmp_path_factory.mktemp("progress") / "raster.nc"
    count = 1
    while True:
        program.write_text(head + count * (start + motions) + end + tail)
        began = time.monotonic()
        subprocess.run([COMMAND, "check", program], check=True, stdout=subprocess.DEVNULL, timeout=120)
        elapsed = time.monotonic() - began
        if elapsed >= WORK_S:
            return program
        count = math.ceil(count * min(10.0, 1.5 * WORK_S / elapsed))


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
