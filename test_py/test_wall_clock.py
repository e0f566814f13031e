"""Steps of the wall clock, which libfaketime sets for the node alone, and stamps of another clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from virtual_axes.msg import TrajectoryResult as R

from action import line
from node_process import Node
from sim_clock import SimClock
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, status_values, to_ns, to_time

LIBRARIES = sorted((Path(__file__).parents[1] / ".build/faketime").glob("usr/lib/*/faketime/libfaketimeMT.so.1"))
needs_faketime = pytest.mark.skipif(not LIBRARIES, reason="no libfaketime: tools/setup.sh unpacks it")
YEAR = 365 * 86_400 * NANOSECONDS


class WallClock:
    """Wall clock of a node, with a difference to that of this process."""

    def __init__(self, file: Path):
        """Keeps the file of libfaketime."""
        self._file = file
        self.set(0)

    def set(self, ahead_s: float) -> None:
        """Sets the clock; the file is replaced at once, since the node reads it at any time."""
        new = self._file.with_suffix(".new")
        new.write_text(f"{ahead_s:+.3f}\n")
        new.replace(self._file)

    @property
    def environment(self) -> dict[str, str]:
        """Returns the environment of the node."""
        return {
            "LD_PRELOAD": str(LIBRARIES[0]),
            "FAKETIME_TIMESTAMP_FILE": str(self._file),
            "FAKETIME_NO_CACHE": "1",
            "DONT_FAKE_MONOTONIC": "1",
        }


@pytest.fixture
def wall(tmp_path: Path) -> WallClock:
    return WallClock(tmp_path / "faketime")


@pytest.fixture
def drive(wall: WallClock) -> Iterator[AxesClient]:
    with Node(env=wall.environment) as process, AxesClient(process=process) as drive:
        yield drive


def difference(drive: AxesClient) -> float:
    """Returns the time of the newest sample ahead of the clock of this process, s."""
    return (drive.now() - time.time_ns()) / NANOSECONDS


@needs_faketime
@pytest.mark.parametrize("step_s", [100.0, -100.0, 2.0, -300.0])
def test_a_step_of_the_wall_clock_restarts_the_time(drive: AxesClient, wall: WallClock, step_s: float) -> None:
    drive.wait_for(lambda: abs(difference(drive)) < 0.3, 5, "stamps of the present time")
    moving = drive.send(line(["x"], [0.1], 5.0))
    later = line(["y"], [0.1], 1.0)
    later.header.stamp = to_time(time.time_ns() + 60 * NANOSECONDS)
    waiting = drive.send(later)
    assert [drive.decision(number).status for number in (moving, waiting)] == [R.ACCEPTED] * 2
    seen = len(drive.diagnostics())
    wall.set(step_s)
    drive.wait_for(lambda: abs(difference(drive) - step_s) < 0.3, 1.5, "stamps of the new time")
    for number in (moving, waiting):
        ended = drive.end(number, 5)
        assert ended.status == R.ABORTED and ended.text.startswith("the clock jumped from")
    drive.wait_for(lambda: "the clock jumped from" in drive.process.output(), 5, "log of the jump")
    # The line about the middleware follows at once.
    time.sleep(0.2)
    output = drive.process.output()
    # The middleware drops what seems older than its newest sample.
    assert ("the middleware receives neither new participants nor best-effort topics" in output) == (step_s < 0)

    def is_reported() -> bool:
        statuses = [array.status[0] for array in drive.diagnostics()[seen:]]
        return any(status_values(s)["clock_jumps"] == "1" and "the clock jumped" in s.message for s in statuses)

    drive.wait_for(is_reported, 5, "jump in the diagnostics")
    assert drive.now() % TSP_NS == 0
    # A stamp of the new time is that of the node.
    again = joint_trajectory(["x"], [1.0], [0.05], [0.0])
    again.header.stamp = to_time(drive.now() + NANOSECONDS)
    accepted = drive.accept(again)
    assert 0 <= to_ns(accepted.start) - to_ns(again.header.stamp) < TSP_NS
    assert drive.end(accepted.sequence_number, 10).status == R.COMPLETED


@needs_faketime
def test_a_slewed_wall_clock_is_no_step(drive: AxesClient, wall: WallClock) -> None:
    wall.set(0.05)
    number = drive.send(line(["x"], [0.01], 1.0))
    assert drive.end(number, 10).status == R.COMPLETED
    assert "the clock jumped" not in drive.process.output()


@needs_faketime
@pytest.mark.parametrize("argument", ["use_sim_time:=true", "time:=fast"])
def test_a_set_back_wall_clock_is_logged_once_in_the_other_time_modes(wall: WallClock, argument: str) -> None:
    """The axes keep their time, but the middleware drops `/clock` until the old time has passed."""
    with Node(["-p", argument], env=wall.environment) as process, AxesClient(process=process, connect=False) as drive:
        clock = SimClock(drive, 1000 * NANOSECONDS) if argument == "use_sim_time:=true" else None
        (clock or drive).connect()
        wall.set(-50.0)
        warning = "the wall clock was set back: until it has passed"
        drive.wait_for(lambda: warning in process.output(), 5, "warning")
        if clock is not None:
            for _ in range(20):
                clock.set(clock.now + TSP_NS)
                time.sleep(0.02)
            wall.set(0.0)
            clock.connect()
        assert process.output().count(warning) == 1
        assert "Did my clock jump" not in process.output()


def test_stamps_of_another_clock_are_rejected_with_the_remedy(start: Callable[..., AxesClient]) -> None:
    """Simulated time on the wall clock; a stamp far ahead, as the wall clock is for simulated time."""
    drive = start()
    for stamp, code in [(1000 * NANOSECONDS, R.ENDED_IN_THE_PAST), (time.time_ns() + YEAR, R.INVALID_TIME)]:
        message = line(["x"], [0.01], 1.0)
        message.header.stamp = to_time(stamp)
        decision = drive.decision(drive.send(message))
        assert (decision.status, decision.code) == (R.REJECTED, code)
        assert "set use_sim_time of both nodes, or of neither" in decision.text
