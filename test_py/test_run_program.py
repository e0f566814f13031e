"""Action ~/run_program: part programs in the node."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rcl_interfaces.msg import Log
from virtual_axes.action import RunProgram
from virtual_axes.msg import TrajectoryResult as R

from action import Follow, ending, goal, line, results_of
from motion import TSP, go_home
from node_process import Node, resident_mb
from test_feed_override import Feed
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, ParameterRejected, joint_trajectory, to_ns

ROOT = Path(__file__).parents[1]
Goal, Result = RunProgram.Goal, RunProgram.Result

SQUARE = """G21 G90 G54 G61.1
G0 X10 Y0
G1 X30 F3000
Y20
X10
Y0
M2
"""
"""Square with exact stops; line 3 is its first side."""
LIMITS = {"x": (2.5, 50.0), "y": (3.0, 50.0)}
"""Acceleration and jerk limits of the default machine, m/s² and m/s³."""
LONG = "G21 G90 G64 P0.05\n" + "O1 repeat [100000]\nG1 X20 F1500\nY20\nX0\nY0\nO1 endrepeat\nM2\n"
"""Program of more than 80 hours."""


NOT_PERMITTED = "is not a regular file of at most 4 GiB below program_folder"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the folder of the program files."""
    return tmp_path_factory.mktemp("programs")


@pytest.fixture(scope="module")
def programs(folder: Path) -> Iterator[Follow]:
    args = ["-p", "time:=fast", "-p", "action_monitor_rate:=50.0", "-p", f"program_folder:={folder}"]
    with Node(args) as process, AxesClient(process=process) as drive:
        with Follow(drive, f"{drive.target}/run_program", kind=RunProgram) as follow:
            yield follow


@pytest.fixture(autouse=True)
def at_home(programs: Follow) -> None:
    go_home(programs.drive)


def states_of(follow: Follow, sent) -> object:
    """Returns the drive states from before the start of a program to its end."""
    drive = follow.drive
    ended = ending(follow, sent)
    accepted = next(result for result in results_of(follow, sent) if result.status == R.ACCEPTED)
    end = to_ns(ended.header.stamp)
    drive.wait_until(end, 20)
    return drive.record(to_ns(accepted.start), end).states


def assert_within_limits(states, joints: str = "xy") -> None:
    for joint in joints:
        psec = states["psec", joint]
        acceleration, jerk = LIMITS[joint]
        assert np.abs(np.diff(psec, 2)).max() / TSP**2 <= acceleration * (1 + 1e-6)
        assert np.abs(np.diff(psec, 3)).max() / TSP**3 <= jerk * (1 + 1e-6)


def test_a_program_runs_to_its_end_with_feedback_and_figures(programs: Follow) -> None:
    sent = programs.send(Goal(program=SQUARE))
    ended = sent.ended(60)
    assert ended.status == GoalStatus.STATUS_SUCCEEDED, ended.result
    result = ended.result
    assert (result.error_code, result.error_string) == (Result.SUCCESSFUL, "")
    states = states_of(programs, sent)
    assert_within_limits(states)
    x, y = states["psec", "x"], states["psec", "y"]
    # G54 is the origin of the workpiece frame: the program moves relative to it.
    assert x.max() - x[-1] == pytest.approx(0.02, abs=1e-12)
    assert y.max() - y[-1] == pytest.approx(0.02, abs=1e-12)
    # Four sides of 20 mm at 3 m/min.
    assert result.programmed_time == pytest.approx(1.6, rel=1e-9)
    moving = np.flatnonzero(np.diff(np.column_stack([x, y]), axis=0).any(axis=1))
    duration = (moving[-1] - moving[0] + 1) * TSP
    assert result.cycle_time == pytest.approx(duration, abs=2.5 * TSP)
    assert len(result.name) == len(result.max_synchronized_tracking_error) == 5
    error = states["synchronized_tracking_error"]
    assert max(result.max_synchronized_tracking_error) == pytest.approx(np.abs(error).max(), rel=1e-12)
    assert 0 < result.rms_contour_error < result.max_contour_error < 1e-3
    assert list(result.worst_synchronized_tracking_error) == sorted(
        result.worst_synchronized_tracking_error, reverse=True
    )
    assert set(result.worst_line) == {2, 3, 4, 5, 6}
    # Feedback and result are independent streams: the last feedback may arrive after the result.
    programs.drive.wait_for(lambda: any(f.line == 6 for f in sent.feedback), 20, "feedback of the last line")
    lines = [feedback.line for feedback in sent.feedback]
    assert lines == sorted(lines) and set(lines) >= {3, 4, 5, 6}
    fastest = max(feedback.feed for feedback in sent.feedback if feedback.line == 3)
    assert 0.02 < fastest <= 0.05 * (1 + 1e-9)
    assert {f.programmed_feed for f in sent.feedback if f.line == 3} == {0.05}
    errors = [feedback.contour_error for feedback in sent.feedback]
    assert all(0 <= error <= result.max_contour_error for error in errors) and max(errors) > 0
    statuses = [result.status for result in results_of(programs, sent)]
    assert statuses == [R.ACCEPTED, R.COMPLETED]
    assert {result.source for result in results_of(programs, sent)} == {R.SOURCE_PROGRAM}


@pytest.mark.parametrize("is_relative", [True, False])
def test_a_file_has_the_setpoints_of_the_command(programs: Follow, folder: Path, is_relative: bool) -> None:
    """The setpoints equal those of `virtual_axes psec` within the rounding of the time."""
    path = folder / "square.nc"
    path.write_text(SQUARE)
    sent = programs.send(Goal(path=path.name if is_relative else str(path)))
    assert sent.ended(60).status == GoalStatus.STATUS_SUCCEEDED
    states = states_of(programs, sent)
    out = folder / "square.csv"
    out.unlink(missing_ok=True)
    command = [ROOT / "target/release/virtual_axes", "psec", path, "--out", out]
    subprocess.run(command, check=True, timeout=60, capture_output=True)
    rows = np.genfromtxt(out, delimiter=",", names=True)
    planned = np.column_stack([rows[joint] for joint in "xyz"])
    found = np.column_stack([states["psec", joint] for joint in "xyz"])
    first = np.flatnonzero(np.diff(found, axis=0).any(axis=1))[0]
    begin = np.flatnonzero(np.diff(planned, axis=0).any(axis=1))[0]
    count = min(len(found) - first, len(planned) - begin)
    assert count > 300
    assert np.abs(found[first : first + count] - planned[begin : begin + count]).max() < 1e-12


def test_a_start_line_skips_earlier_motions(programs: Follow) -> None:
    sent = programs.send(Goal(program=SQUARE, start_line=5))
    result = sent.ended(60).result
    assert result.error_code == Result.SUCCESSFUL, result.error_string
    assert result.programmed_time == pytest.approx(0.8, rel=1e-9)
    assert set(result.worst_line) == {5, 6}


def test_a_start_line_in_tool_center_point_control(programs: Follow) -> None:
    text = "G21 G90 G54 G43.4 H1 G61.1\nG1 X5 F3000\nX20 A10 C20\nX30 A5\nG49\nM2\n"
    sent = programs.send(Goal(program=text, start_line=4))
    result = sent.ended(60).result
    assert result.error_code == Result.SUCCESSFUL, result.error_string
    # 10 mm at 3 m/min; the approach is a rapid traverse.
    assert result.programmed_time == pytest.approx(0.2, rel=1e-9)
    assert_within_limits(states_of(programs, sent))


def test_the_feed_override_of_a_goal_and_a_feed_hold(programs: Follow) -> None:
    drive = programs.drive
    feed = Feed(drive)
    sent = programs.send(Goal(program=SQUARE, feed_override=0.5))
    sent.wait_for_feedback()
    feed.call("feed_hold")
    feed.wait_for_rate(0.0)
    held = drive.latest("psec")
    drive.wait_until(drive.now() + 50 * TSP_NS, 20)
    assert drive.latest("psec") == held
    feed.call("cycle_start")
    ended = sent.ended(60)
    assert ended.status == GoalStatus.STATUS_SUCCEEDED
    states = states_of(programs, sent)
    assert_within_limits(states)
    feed.publish(1.0)
    again = programs.send(Goal(program=SQUARE))
    assert 1.5 * again.ended(60).result.cycle_time < ended.result.cycle_time
    programs.drive.wait_for(lambda: any(f.line > 2 for f in sent.feedback), 20, "feedback of the square")
    assert max(f.feed for f in sent.feedback if f.line > 2) <= 0.025 * (1 + 1e-9)


@pytest.mark.parametrize(
    "message, code, text",
    [
        (Goal(), Result.INVALID_GOAL, "the goal has no program: set path or program"),
        (Goal(path="a", program="b"), Result.INVALID_GOAL, "the goal has path and program: set one of them"),
        (
            Goal(program="M2", feed_override=-1.0),
            Result.INVALID_GOAL,
            "feed override -1 must be a number from 0 to 2 (200 %)",
        ),
        (Goal(path="/no/such.nc"), Result.FILE_ERROR, f"/no/such.nc: {NOT_PERMITTED}"),
        (Goal(path="such.nc"), Result.FILE_ERROR, f"such.nc: {NOT_PERMITTED}"),
        (Goal(path="/etc/passwd"), Result.FILE_ERROR, f"/etc/passwd: {NOT_PERMITTED}"),
        (Goal(path="../../etc/passwd"), Result.FILE_ERROR, f"../../etc/passwd: {NOT_PERMITTED}"),
        (
            Goal(path="/" + "x" * 65_499),
            Result.INVALID_GOAL,
            "the path has 65500 bytes; at most 4096 are allowed",
        ),
        (Goal(path="/dev/zero"), Result.FILE_ERROR, f"/dev/zero: {NOT_PERMITTED}"),
        (Goal(path="/"), Result.FILE_ERROR, f"/: {NOT_PERMITTED}"),
        (Goal(program="G1 X1 F100\nG12.1\nM2\n"), Result.PROGRAM_ERROR, "program:2: G12.1"),
        (Goal(program="G1 X1 F10000\nG1 X2000\nM2\n"), Result.PROGRAM_ERROR, "program: line 2: x is at"),
        (
            Goal(program="G1 X1 F100\n", start_line=9),
            Result.PROGRAM_ERROR,
            "program: start line 9 is after",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_invalid_goal_is_aborted_with_one_line(programs: Follow, message: Goal, code: int, text: str) -> None:
    process = programs.drive.process
    assert process is not None
    logged = len(process.output())
    ended = programs.send(message).ended(30)
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, code), ended.result.error_string
    assert ended.result.error_string.startswith(text) and "\n" not in ended.result.error_string
    programs.drive.wait_for(lambda: text in process.output()[logged:], 10, "log")
    rejections = [line for line in process.output()[logged:].splitlines() if text in line]
    assert len(rejections) == 1 and len(rejections[0]) < 500


@pytest.mark.parametrize("kind", ["pipe", "link", "linked_folder"])
def test_files_of_other_kinds_and_places_are_not_opened(
    programs: Follow, folder: Path, tmp_path: Path, kind: str
) -> None:
    """The rejection does not tell a link to an existing file from one to a missing file."""
    path = folder / kind
    (tmp_path / "other.nc").write_text(SQUARE)
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(tmp_path / "other.nc" if kind == "link" else tmp_path)
    names = [f"{kind}/other.nc", f"{kind}/missing.nc"] if kind == "linked_folder" else [kind]
    for name in names:
        ended = programs.send(Goal(path=name)).ended(10)
        assert ended.result.error_code == Result.FILE_ERROR
        assert ended.result.error_string.startswith(f"{name}: {NOT_PERMITTED}")


def test_without_a_folder_no_file_is_run(start: Callable[..., AxesClient], tmp_path: Path) -> None:
    path = tmp_path / "square.nc"
    path.write_text(SQUARE)
    drive = start("-p", "time:=fast")
    with pytest.raises(ParameterRejected, match="program_folder cannot be set while the node runs"):
        drive.set_parameters({"program_folder": str(tmp_path)})
    with Follow(drive, f"{drive.target}/run_program", kind=RunProgram) as programs:
        texts = []
        for name in (str(path), str(tmp_path / "missing.nc")):
            result = programs.send(Goal(path=name)).result(10)
            assert result.error_code == Result.FILE_ERROR
            texts.append(result.error_string.removeprefix(name))
        assert texts[0] == texts[1] and "circle-diamond-square" in texts[0] and "program_folder" in texts[0]


def test_errors_of_files_contain_no_text_of_them(programs: Follow, folder: Path) -> None:
    """The reason is on standard error alone: other nodes read /rosout."""
    published: list[Log] = []
    programs.drive.node.create_subscription(Log, "/rosout", published.append, 100)
    (folder / "bad.nc").write_text("G21 G90\nroot:secretword:0:0\n")
    (folder / "caller.nc").write_text("G21 G90\nO<sub> call\nM2\n")
    (folder / "sub.ngc").write_text("O<sub> sub\nroot:secretword:1:1\nO<sub> endsub\n")
    for name in ("bad.nc", "caller.nc"):
        result = programs.send(Goal(path=name)).result(30)
        assert result.error_code == Result.PROGRAM_ERROR
        assert "the reason is in the node's log" in result.error_string
        assert "secret" not in result.error_string.lower()
    process = programs.drive.process
    assert process is not None
    programs.drive.wait_for(lambda: process.output().lower().count("secretword") >= 2, 10, "reasons on stderr")
    programs.drive.wait_for(lambda: any("sub.ngc:2: invalid" in log.msg for log in published), 10, "log on /rosout")
    assert not any("secret" in log.msg.lower() for log in published)


def test_a_subprogram_outside_of_the_folder_is_not_read(programs: Follow, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "outer.ngc").write_text("O<outer> sub\nG1 X1 F1000\nO<outer> endsub\n")
    (folder / "outer.ngc").symlink_to(tmp_path / "outer.ngc")
    (folder / "calls.nc").write_text("G21 G90\nO<outer> call\nM2\n")
    assert programs.send(Goal(path="calls.nc")).result(30).error_code == Result.PROGRAM_ERROR
    (folder / "outer.ngc").unlink()
    (folder / "outer.ngc").write_text((tmp_path / "outer.ngc").read_text())
    assert programs.send(Goal(path="calls.nc")).result(30).error_code == Result.SUCCESSFUL


def test_a_subprogram_of_sinumerik_outside_of_the_folder_is_not_read(
    programs: Follow, folder: Path, tmp_path: Path
) -> None:
    text = "G0 X1\nRET\n"
    (tmp_path / "FERN.SPF").write_text(text)
    (folder / "FERN.SPF").symlink_to(tmp_path / "FERN.SPF")
    (folder / "main.mpf").write_text("DEF REAL WERT=1\nG71 G90\nFERN\nM30\n")
    assert programs.send(Goal(path="main.mpf")).result(30).error_code == Result.PROGRAM_ERROR
    (folder / "FERN.SPF").unlink()
    (folder / "FERN.SPF").write_text(text)
    assert programs.send(Goal(path="main.mpf")).result(30).error_code == Result.SUCCESSFUL


def test_a_canceled_program_stops_within_the_limits(programs: Follow) -> None:
    sent = programs.send(Goal(program=LONG))
    sent.wait_for_feedback(20)
    assert sent.cancel().return_code == 0
    ended = sent.ended(30)
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_CANCELED, Result.SUCCESSFUL)
    assert_within_limits(states_of(programs, sent))
    assert programs.send(Goal(program=SQUARE)).status(60) == GoalStatus.STATUS_SUCCEEDED


def test_a_trajectory_preempts_a_program(programs: Follow) -> None:
    drive = programs.drive
    sent = programs.send(Goal(program=LONG))
    sent.wait_for_feedback(20)
    # Without a point at time 0, it is approached from the commanded state.
    trajectory = line(["x"], [0.01], 2.0)
    trajectory.points = trajectory.points[1:]
    number = drive.send(trajectory)
    ended = sent.ended(30)
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.PREEMPTED)
    assert ended.result.error_string == f"preempted by trajectory {number} of psec"
    completed = drive.end(number, 30)
    assert completed.status == R.COMPLETED
    drive.wait_until(to_ns(completed.header.stamp), 10)
    psec = drive.latest("psec")
    assert psec["x"] == 0.01
    drive.wait_until(drive.now() + 20 * TSP_NS, 10)
    assert drive.latest("psec") == psec


def test_a_goal_preempts_a_program_and_a_program_a_goal(programs: Follow) -> None:
    drive = programs.drive
    with Follow(drive, kind=FollowJointTrajectory) as trajectories:
        program = programs.send(Goal(program=LONG))
        program.wait_for_feedback(20)
        # Approached from the commanded state, and long enough to be active when the next program is submitted.
        rest = [[0.0] * 2] * 2
        trajectory = joint_trajectory(["x", "y"], [2.0, 60.0], [[0.01, 0.01], [0.05, 0.05]], rest, rest)
        moving = trajectories.send(goal(trajectory))
        assert program.result(30).error_code == Result.PREEMPTED
        moving.wait_for_feedback(3)
        square = programs.send(Goal(program=SQUARE))
        assert "preempted by goal" in moving.result(30).error_string
        assert square.status(60) == GoalStatus.STATUS_SUCCEEDED
        assert_within_limits(states_of(programs, square))


def test_the_stop_service_and_a_newer_program_end_a_program(programs: Follow) -> None:
    first = programs.send(Goal(program=LONG))
    first.wait_for_feedback(5)
    second = programs.send(Goal(program=LONG))
    preempted = first.result(30)
    assert preempted.error_code == Result.PREEMPTED
    # Its figures are those until its end.
    assert preempted.cycle_time > 0 and list(preempted.worst_line)
    second.wait_for_feedback(5)
    programs.drive.stop()
    assert second.result(30).error_code == Result.STOPPED


def test_the_number_of_planners_is_bounded(start: Callable[..., AxesClient]) -> None:
    """A planner notices the end of its program between two motions; this program has none."""
    drive = start()
    assert drive.process is not None
    threads = Path(f"/proc/{drive.process.pid}/task")
    with Follow(drive, f"{drive.target}/run_program", kind=RunProgram) as programs:
        assert programs.send(Goal(program=SQUARE)).result(30).error_code == Result.SUCCESSFUL
        before = most = len(list(threads.iterdir()))
        sent = []
        for _ in range(60):
            sent.append(programs.send(Goal(program="O1 while [1]\nO1 endwhile\nM2\n")))
            most = max(most, len(list(threads.iterdir())))
        allowed = {Result.PREEMPTED, Result.PROGRAM_ERROR, Result.INVALID_GOAL}
        for goal_ in sent:
            assert goal_.result(60).error_code in allowed
            most = max(most, len(list(threads.iterdir())))
        assert most - before <= 10
        assert programs.send(Goal(program=SQUARE)).result(30).error_code == Result.SUCCESSFUL


def test_a_long_program_needs_constant_memory() -> None:
    """Memory after minutes of a program is that after its first seconds."""
    # Without subscriptions at the rate of the position cycles, for which the middleware needs memory in waves.
    with Node(["-p", "time:=fast"]) as process, AxesClient(process=process, keep_samples=False) as drive:
        with Follow(drive, f"{drive.target}/run_program", kind=RunProgram) as programs:
            sent = programs.send(Goal(program=LONG))
            begin = to_ns(sent.wait_for_feedback().header.stamp)
            memory = []
            for seconds in (30, 300):
                until = begin + seconds * NANOSECONDS

                def has_come(until: int = until) -> bool:
                    return to_ns(sent.feedback[-1].header.stamp) >= until

                drive.wait_for(has_come, 120, f"{seconds} s of the program")
                memory.append(resident_mb(process.pid))
            assert memory[1] - memory[0] < 8, memory
            sent.cancel()
            assert sent.status(30) == GoalStatus.STATUS_CANCELED


def test_a_program_runs_in_real_time(start: Callable[..., AxesClient]) -> None:
    """A chunk that is late stops the axes on the path, so that the setpoints keep their limits in any case."""
    drive = start("-p", "time:=real")
    with Follow(drive, f"{drive.target}/run_program", kind=RunProgram) as programs:
        sent = programs.send(Goal(path="circle-diamond-square", feed_override=2.0))
        sent.wait_for_feedback(40, timeout=40)
        sent.cancel()
        assert sent.status(30) == GoalStatus.STATUS_CANCELED
        assert_within_limits(states_of(programs, sent))


def test_the_setup_of_the_machine_file_applies(tmp_path: Path) -> None:
    """Work offset and tool length shift Z, tool change and spindle add their times, and P is in milliseconds."""
    text = (ROOT / "config" / "vmc.yaml").read_text(encoding="utf-8")
    head = "    machine: Vertical mill (representative)\n"
    setup = """    part_program:
      dialect: fanuc
      work_offsets: ["G55=-400,-250,-420"]
      tools: ["T1 Z62.5 D10"]
      tool_change_s: 4.5
      spindle_s: 1.25
"""
    machine = tmp_path / "mill.yaml"
    machine.write_text(text.replace(head, head + setup), encoding="utf-8")
    with Node(["--params-file", str(machine), "-p", "time:=fast"]) as process, AxesClient(process=process) as drive:
        with Follow(drive, f"{drive.target}/run_program", kind=RunProgram) as follow:
            times = []
            for auxiliary in ("", "T1 M6\nM3 S900\nG4 P500\n"):
                text = f"G55 G43 H1 G0 X10 Y20 Z30\n{auxiliary}G0 X11\nM30\n"
                sent = follow.send(Goal(program=text))
                ended = sent.ended(60)
                assert ended.status == GoalStatus.STATUS_SUCCEEDED, ended.result
                states = states_of(follow, sent)
                position = [states["psec", joint][-1] for joint in "xyz"]
                assert position == pytest.approx([-0.389, -0.23, -0.3275], abs=1e-12)
                times.append(ended.result.cycle_time)
                go_home(drive)
    assert times[1] - times[0] == pytest.approx(4.5 + 1.25 + 0.5, abs=0.011)
