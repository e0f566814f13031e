"""Process that writes a line for each of its steps, and may wait for a line before a step."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence

from node_process import die_with_parent

PATIENCE_S = 150.0
"""Timeout for a line or the end of a process, s."""


class LineProcess:
    """Python program in a process of its own that ends with this one; killed at the end of the context."""

    def __init__(self, file: str, *words: object, env: Mapping[str, str] | None = None, prefix: Sequence[str] = ()):
        """Starts the program; `prefix` is a command that executes it."""
        self._process = subprocess.Popen(
            [*prefix, sys.executable, "-X", "faulthandler", file, *map(str, words)],
            env={**os.environ, **(env or {})},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=die_with_parent,
        )

    def __enter__(self) -> LineProcess:
        """Returns itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Kills the process."""
        self.kill()

    def read_line(self, timeout: float = PATIENCE_S) -> str:
        """Returns the next line of its output."""
        if not select.select([self._process.stdout], [], [], timeout)[0]:
            raise TimeoutError("no output of a process")
        if not (line := self._process.stdout.readline()):
            raise ChildProcessError(f"a process ended with status {self._process.wait(PATIENCE_S)}")
        return line.rstrip("\n")

    def go_on(self, *words: object) -> None:
        """Sends a line."""
        print(*words, file=self._process.stdin, flush=True)

    def wait(self, timeout: float = PATIENCE_S) -> None:
        """Waits until the process has ended; raises ChildProcessError if it failed."""
        if status := self._process.wait(timeout):
            raise ChildProcessError(f"a process ended with status {status}")

    def stop(self) -> None:
        """Sends SIGSTOP."""
        self._process.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Sends SIGCONT."""
        self._process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        """Sends SIGKILL; has no effect when called again."""
        self._process.kill()
        self._process.wait(PATIENCE_S)
        for end in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(BrokenPipeError):
                end.close()
