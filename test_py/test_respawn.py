"""Restart of the node by a supervisor: as launch does with `respawn`, with the node of the launch file."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import launch
import pytest
from launch.actions import LogInfo, Shutdown
from launch.events.process import ProcessExited
from launch_ros.actions import Node as NodeAction

from launch_graph import nodes
from node_process import Node, status_of
from test_hostile_datagrams import START_SCREEN_END, fragment, matched_sender
from virtual_axes_py.ros import AxesClient

ONE = "virtual_axes.launch.py"
RESTART_S = 30.0
SAMPLE_MB = 180
"""Announced size of a sample; the node accepts two of them."""
GAIN = "x.velocity_loop.gain"
MARGIN_MB = 100
"""Address space beyond that of a node at rest."""


class Supervisor:
    """Restarts the node of an action as launch does, and keeps the messages."""

    def __init__(self, action: NodeAction) -> None:
        """Keeps the action."""
        prefix = action.prefix.split() if action.prefix else []
        self.action, self.messages, self.pids = action, list[str](), list[int]()
        self.process = Node(action.command[1:], prefix=prefix)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        while not self._end.wait(0.02):
            status = self.process.poll()
            if status is None:
                continue
            event = ProcessExited(process_name="virtual_axes_node-1", returncode=status)
            following = self.action.on_exit(event, launch.LaunchContext()) if self.action.on_exit else []
            self.messages += [action.msg for action in following if isinstance(action, LogInfo)]
            is_over = any(isinstance(action, Shutdown) for action in following)
            if is_over or not self.action.respawn or self._end.wait(self.action.respawn_delay):
                return
            self.process.start()
            self.pids.append(self.process.pid)

    def __enter__(self) -> Supervisor:
        """Starts the node and its supervision, and waits until the node has the ports of the first participant."""
        self.process.__enter__()
        self.pids.append(self.process.pid)
        self._thread.start()
        end = time.monotonic() + RESTART_S
        while START_SCREEN_END not in self.process.output() and self._thread.is_alive():
            assert time.monotonic() < end, self.process.output()
            time.sleep(0.05)
        return self

    def __exit__(self, *_: object) -> None:
        """Ends both."""
        self._end.set()
        self._thread.join(RESTART_S)
        self.process.__exit__()

    def wait_for_restart(self) -> None:
        """Waits until the node has been started again."""
        end = time.monotonic() + RESTART_S
        while len(self.pids) < 2:
            assert time.monotonic() < end and self._thread.is_alive(), (self.messages, self.process.output())
            time.sleep(0.05)


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """Returns a machine file with a gain that is not the default of the built-in machine."""
    text = (Path(__file__).parents[1] / "config" / "mikron_ucp710.yaml").read_text()
    file = tmp_path / "tuned.yaml"
    # The first gain of a velocity loop is that of X.
    head, found, tail = text.partition("      velocity_loop:")
    assert found
    before, _, rest = tail.partition("gain:")
    file.write_text(f"{head}{found}{before}gain: 4.25{rest[rest.index(chr(10)) :]}")
    return file


def supervised(machine: Path, **arguments: str) -> Supervisor:
    [node] = nodes(ONE, machine=str(machine), robot_state_publisher="false", respawn="true", **arguments)
    return Supervisor(node)


@contextlib.contextmanager
def client(supervisor: Supervisor) -> Iterator[AxesClient]:
    with AxesClient(process=supervisor.process) as drive:
        yield drive


def assert_restarted_with_its_parameters(supervisor: Supervisor) -> None:
    supervisor.wait_for_restart()
    with client(supervisor) as again:
        assert again.get_parameters([GAIN]) == {GAIN: 4.25}
        assert set(again.latest("position").values()) == {0.0}
    [message] = supervisor.messages
    assert "is started again" in message
    for word in ("positions", "trajectories", "parameters set at run time"):
        assert word in message


def test_a_killed_node_is_restarted_with_its_parameters(machine: Path) -> None:
    """What was set at run time is lost, as the message says."""
    with supervised(machine) as supervisor:
        with client(supervisor) as drive:
            assert drive.get_parameters([GAIN]) == {GAIN: 4.25}
            drive.set_parameters({GAIN: 4.0})
            drive.process = None
            os.kill(supervisor.pids[0], signal.SIGKILL)
        assert_restarted_with_its_parameters(supervisor)


def address_space_mb() -> float:
    """Returns the largest address space of a node at rest so far, MB."""
    with Node() as process, AxesClient(process=process):
        return status_of(process.pid, "VmPeak") * 1.024e-3


def test_a_node_that_exceeds_its_memory_limit_is_restarted(machine: Path) -> None:
    """Announced samples within the bounds of the node, which are more than its address space, end it."""
    limit = round(address_space_mb()) + MARGIN_MB
    with supervised(machine, memory_limit=str(limit)) as supervisor:
        with client(supervisor) as drive:
            peak_mb = status_of(supervisor.pids[0], "VmPeak") * 1.024e-3
            print(f"\nlimit {limit} MB, at most {peak_mb:.0f} MB before")
            assert peak_mb < limit
            drive.process = None
            with matched_sender(supervisor.process.domain_id) as send:
                for sample in range(1, 3):
                    with contextlib.suppress(ConnectionError):
                        send(fragment(sample, SAMPLE_MB << 20))
            supervisor.wait_for_restart()
        assert_restarted_with_its_parameters(supervisor)


def test_invalid_arguments_end_the_launch(machine: Path) -> None:
    """A restart would end in the same way for ever."""
    machine.write_text(machine.read_text().replace("gain: 4.25", "gain: -4.25"))
    with supervised(machine) as supervisor:
        supervisor._thread.join(RESTART_S)
        assert not supervisor._thread.is_alive()
        assert supervisor.process.poll() == 2 and len(supervisor.pids) == 1


@pytest.mark.parametrize("arguments", [{"respawn": "true", "record": "run.mcap"}, {"memory_limit": "1G"}])
def test_contradictions_are_rejected(arguments: dict[str, str]) -> None:
    with pytest.raises(RuntimeError, match="record|memory_limit"):
        nodes(ONE, robot_state_publisher="false", **arguments)
