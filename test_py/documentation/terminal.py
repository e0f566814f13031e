"""Terminal: one bash that keeps its directory and environment from command to command."""

from __future__ import annotations

import contextlib
import os
import secrets
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path


def _interrupt_by_default() -> None:
    """Restores the effect of SIGINT, which processes ignore that a shell started in the background."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Terminal:
    """Bash in a process group of its own, with standard output and error in one text."""

    def __init__(self, directory: Path, environment: Mapping[str, str]) -> None:
        """Starts bash."""
        self._bash = subprocess.Popen(
            ["bash", "--noprofile", "--norc"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=directory,
            env=dict(environment),
            start_new_session=True,
            preexec_fn=_interrupt_by_default,
        )
        self._output = bytearray()
        self._changed = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._mark = b""
        self._begin = 0
        self.is_busy = False
        # A program that is interrupted must not end the shell, as in an interactive one.
        self.run("trap : INT", 10)

    def _read(self) -> None:
        while chunk := os.read(self._bash.stdout.fileno(), 65536):
            with self._changed:
                self._output += chunk
                self._changed.notify_all()

    @property
    def directory(self) -> Path:
        """Returns the current directory."""
        return Path(os.readlink(f"/proc/{self._bash.pid}/cwd"))

    def start(self, command: str) -> None:
        """Starts a command and does not wait for its end."""
        self.interrupt()
        mark = f"end of command {secrets.token_hex(8)} "
        self._mark = f"\n{mark}".encode()
        self._begin = len(self._output)
        self.is_busy = True
        # The command ends with a line end: it may contain a comment or a here-document. Its standard input is
        # empty, since bash reads its own commands from the pipe.
        text = f"{{ {command}\n}} </dev/null\nprintf '\\n{mark}%d\\n' $?\n"
        self._bash.stdin.write(text.encode())
        self._bash.stdin.flush()

    def wait(self, seconds: float, until: Callable[[list[str]], bool] | None = None) -> tuple[list[str], int | None]:
        """Waits for the end of the command, or until its output satisfies a condition.

        Returns the output, and the exit status or None for a command that is still running.
        """
        deadline = time.monotonic() + seconds
        with self._changed:
            while True:
                lines, status = self._state()
                if status is not None or (until and until(lines)):
                    self.is_busy = status is None
                    return lines, status
                left = deadline - time.monotonic()
                if left <= 0 or self._bash.poll() is not None:
                    return lines, None
                self._changed.wait(min(left, 0.2))

    def run(self, command: str, seconds: float) -> tuple[list[str], int | None]:
        """Executes a command."""
        self.start(command)
        return self.wait(seconds)

    def _state(self) -> tuple[list[str], int | None]:
        output = bytes(self._output[self._begin :])
        text, found, rest = output.partition(self._mark)
        status = int(rest) if found and rest.endswith(b"\n") else None
        # Progress bars overwrite their line.
        lines = [line.rsplit("\r", 1)[-1] for line in text.decode(errors="replace").splitlines()]
        return lines, status

    def interrupt(self, seconds: float = 15) -> None:
        """Ends a running command as Ctrl+C does."""
        if not self.is_busy:
            return
        status, ends = None, time.monotonic() + seconds
        # Again each second: a signal before the start of the last command of a list does not end that command.
        while status is None and time.monotonic() < ends:
            for pid in _descendants(self._bash.pid):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGINT)
            _, status = self.wait(1)
        if status is None:
            raise TimeoutError(f"the command of process {self._bash.pid} does not end within {seconds} s of SIGINT")

    def close(self) -> None:
        """Ends bash and everything that it started."""
        for name in (signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(self._bash.pid, name)
            except ProcessLookupError:
                break
            deadline = time.monotonic() + 5
            while time.monotonic() < deadline and _group_exists(self._bash.pid):
                self._bash.poll()
                time.sleep(0.02)
        self._bash.wait(5)
        self._reader.join(1)


def _group_exists(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def _descendants(pid: int) -> list[int]:
    """Returns the processes below one."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            children.setdefault(int(fields[1]), []).append(int(entry.name))
    found, queue = [], [pid]
    while queue:
        below = children.get(queue.pop(), [])
        found += below
        queue += below
    return found
