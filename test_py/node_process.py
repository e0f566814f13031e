"""Process of the node, in its own DDS domain."""

from __future__ import annotations

import ctypes
import fcntl
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

DEFAULT_NODE = "/virtual_axes"


class DomainId:
    """A ROS_DOMAIN_ID that is free on this machine, reserved until released."""

    # DDS listens on port 7400 + 250 id: above 101 that overlaps Linux's ephemeral ports.
    RANGE = "1-101"

    def __init__(self) -> None:
        """Reserves a free id; VIRTUAL_AXES_DOMAIN_IDS=50-59 limits the choice."""
        first, last = map(int, os.environ.get("VIRTUAL_AXES_DOMAIN_IDS", self.RANGE).split("-"))
        for value in random.sample(range(first, last + 1), last - first + 1):
            # Reserved against other runs of this file by a lock that the kernel releases.
            path = Path(tempfile.gettempdir()) / f"virtual_axes_domain_{os.getuid()}_{value}.lock"
            lock = path.open("w")
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                lock.close()
                continue
            if all(_port_is_free(7400 + 250 * value + offset) for offset in (0, 10, 11)):
                self.value, self._lock = value, lock
                return
            lock.close()
        raise RuntimeError(f"no free ROS_DOMAIN_ID in {first}-{last}")

    def release(self) -> None:
        """Releases the id."""
        self._lock.close()


def _port_is_free(port: int) -> bool:
    """Returns true if the port is free: DDS shares its ports, so a normal bind must succeed."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


def own_mb(pid: int) -> float:
    """Returns the resident memory of a process without file pages, MB."""
    return status_of(pid, "RssAnon") * 1.024e-3


def resident_mb(pid: int) -> float:
    """Returns the resident set size of a process, MB."""
    return status_of(pid, "VmRSS") * 1.024e-3


def status_of(pid: int, key: str) -> int:
    """Returns a number of /proc/PID/status; memory in kB."""
    found = re.search(rf"^{key}:\s*(\d+)", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
    if found is None:
        # The process is a zombie: its exit status has not been read.
        raise ProcessLookupError(f"process {pid} has no {key}")
    return int(found[1])


def node_binary() -> Path:
    """Returns the node's program: VIRTUAL_AXES_NODE, or the output of `cargo build --release`."""
    if named := os.environ.get("VIRTUAL_AXES_NODE"):
        return Path(named)
    root = Path(__file__).resolve().parents[1]
    return root / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "virtual_axes_node"


# Resolved before any fork: the child of a process with threads must not wait for the lock of the dynamic loader.
_PRCTL = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


def die_with_parent() -> None:
    """Makes Linux terminate the child when this process dies for any reason."""
    if _PRCTL is not None:
        _PRCTL(1, signal.SIGTERM)  # PR_SET_PDEATHSIG


def separate_output() -> None:
    """Lets `print` alone write to standard output: what Fast DDS writes there goes to standard error."""
    sys.stdout.flush()
    sys.stdout = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)


def use_private_shared_memory() -> None:
    """Gives this process and its children shared memory of their own, where the user may mount file systems.

    Fast DDS has one queue for discovery in /dev/shm for all processes of a machine, whatever their domains. A process
    that is killed while it holds the lock of the queue would stop all others.
    """
    if sys.platform != "linux" or os.geteuid() != 0:
        return
    new_namespace, recursive_private = 0x20000, 0x44000  # CLONE_NEWNS; MS_REC | MS_PRIVATE
    libc = ctypes.CDLL(None)
    if (
        libc.unshare(new_namespace) == 0
        and libc.mount(b"none", b"/", None, ctypes.c_ulong(recursive_private), None) == 0
    ):
        libc.mount(b"tmpfs", b"/dev/shm", b"tmpfs", ctypes.c_ulong(0), None)


class Node:
    """Process that runs the node, in its own domain, on this machine only."""

    def __init__(
        self,
        ros_args: Sequence[str] = (),
        name: str = DEFAULT_NODE,
        domain_id: int | None = None,
        env: Mapping[str, str] | None = None,
        binary: Path | None = None,
        stderr: int | None = None,
        prefix: Sequence[str] = (),
    ):
        """Sets what to start; `ros_args` follow --ros-args, `name` is the resulting full name.

        `stderr` is a file descriptor for it instead of `output()`; `prefix` is a command that executes the program.
        """
        self.name = name
        self._own_domain = DomainId() if domain_id is None else None
        self.domain_id = self._own_domain.value if self._own_domain else domain_id
        self._command = [*prefix, str(binary or node_binary()), *(["--ros-args", *ros_args] if ros_args else [])]
        self._env = {
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            **os.environ,
            "ROS_DOMAIN_ID": str(self.domain_id),
            **(env or {}),
        }
        self._stderr = stderr
        self._process: subprocess.Popen[bytes] | None = None
        # Append mode: the child shares this file, and reading must not move the write position.
        self._output = tempfile.TemporaryFile("a+b")

    def __enter__(self) -> Node:
        """Starts the node."""
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stops the node, with SIGKILL if necessary."""
        if self._process is not None and self.poll() is None:
            self.stop()
        if self._own_domain is not None:
            self._own_domain.release()

    def start(self) -> None:
        """Starts the program; `AxesClient(process=...)` waits until it is discovered."""
        self._process = subprocess.Popen(
            self._command,
            env=self._env,
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT if self._stderr is None else self._stderr,
            preexec_fn=die_with_parent,
        )

    @property
    def pid(self) -> int:
        """Returns the process id."""
        assert self._process is not None, "not started"
        return self._process.pid

    def poll(self) -> int | None:
        """Returns the exit status, or None while it runs."""
        return self._process.poll() if self._process is not None else None

    def wait(self, timeout: float) -> int:
        """Waits for the exit status; raises subprocess.TimeoutExpired if the program continues to run."""
        assert self._process is not None, "not started"
        return self._process.wait(timeout)

    def stop(self, number: signal.Signals = signal.SIGINT, timeout: float = 5.0) -> int:
        """Signals the program and returns its exit status; kills it after the timeout (status -9)."""
        assert self._process is not None, "not started"
        if self._process.poll() is None:
            self._process.send_signal(number)
            try:
                self._process.wait(timeout)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait(timeout)
        return self._process.returncode

    def output(self) -> str:
        """Returns the output so far on stdout and stderr."""
        descriptor = self._output.fileno()
        return os.pread(descriptor, os.fstat(descriptor).st_size, 0).decode(errors="replace")
