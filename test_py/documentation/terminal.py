"""A shell that executes the commands of a page."""

from __future__ import annotations

import os
import re
import selectors
import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path

MARK = "\x1e"
"""Character between the output of a command and its status."""
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Timeout(Exception):
    """A command that did not end in time."""


class Terminal:
    """A bash process that keeps directory and environment between commands."""

    def __init__(self, directory: Path, environment: Mapping[str, str]) -> None:
        """Starts bash in a directory, in a session of its own."""
        self._process = subprocess.Popen(
            ["bash", "--noprofile", "--norc"],
            cwd=directory,
            env=dict(environment),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        self._output = b""
        assert self._process.stdout is not None
        os.set_blocking(self._process.stdout.fileno(), False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._process.stdout, selectors.EVENT_READ)

    def execute(self, command: str, timeout: float) -> tuple[int, list[str]]:
        """Executes a command; returns its status and the lines of its output."""
        self._send(f"{{ {command}\n}} </dev/null; printf '{MARK}%s{MARK}' $?\n")
        pattern = re.compile(f"{MARK}(\\d+){MARK}".encode())
        self._read_until(lambda text: pattern.search(text) is not None, timeout)
        found = pattern.search(self._output)
        if not found:
            raise Timeout(f"no end of `{command}` after {timeout:.0f} s; output so far:\n{self._text()}")
        text, self._output = self._output[: found.start()], self._output[found.end() :]
        return int(found[1]), lines(text)

    def start(self, command: str, is_ready: Callable[[list[str]], bool], timeout: float) -> list[str]:
        """Starts a command that keeps running; returns its output when it is ready, or at the end of the time."""
        self._send(f"{command} </dev/null\n")
        self._read_until(lambda text: is_ready(lines(text)), timeout)
        return lines(self._output)

    def close(self) -> None:
        """Ends the shell and all its processes: SIGINT, then SIGKILL after five seconds."""
        group = self._process.pid
        for number, wait in ((signal.SIGINT, 0.0), (signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0)):
            try:
                # Processes of a non-interactive shell stay in its group.
                os.killpg(group, number)
            except ProcessLookupError:
                break
            try:
                self._process.wait(wait)
            except subprocess.TimeoutExpired:
                continue
        self._process.communicate(timeout=10)

    def _send(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(text.encode())
        self._process.stdin.flush()

    def _read_until(self, is_complete: Callable[[bytes], bool], timeout: float) -> None:
        deadline = time.monotonic() + timeout
        assert self._process.stdout is not None
        while not is_complete(self._output) and time.monotonic() < deadline:
            if self._selector.select(0.1):
                chunk = self._process.stdout.read()
                if chunk == b"":
                    return
                self._output += chunk or b""

    def _text(self) -> str:
        return "\n".join(lines(self._output)[-30:])


def lines(output: bytes) -> list[str]:
    """Returns the lines of an output without colors, trailing blanks and blank lines at the end."""
    text = ESCAPES.sub("", output.decode(errors="replace"))
    # A carriage return overwrites its line, as in a progress bar.
    found = [line.rstrip("\r").rpartition("\r")[2].rstrip() for line in text.split("\n")]
    while found and not found[-1]:
        found.pop()
    return found
