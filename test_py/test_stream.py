"""psec_stream: single setpoints, as from ros2_control's topic-based hardware and teleoperation."""

from __future__ import annotations

import math
import re
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from virtual_axes.msg import TrajectoryResult as R

from motion import TSP, assert_psec, go_home, start_swing
from virtual_axes_py.ros import TSP_NS, AxesClient, joint_trajectory, status_values, to_ns

ATTEMPTS = 4
REACH = 0.5 * TSP
"""Step of x per position cycle, m."""


def follow(drive: AxesClient, joints: Sequence[str], rows: np.ndarray) -> None:
    """Streams rows of positions, each after the previous one is commanded."""
    for row in rows:
        drive.stream(joints, row)
        wanted = dict(zip(joints, row))
        drive.wait_for(lambda: wanted.items() <= drive.latest("psec").items(), 5, f"setpoint {wanted}")


def commanded(drive: AxesClient, joint: str, begin: int) -> np.ndarray:
    """Returns the commands of `joint` since `begin`, in order, without repetitions; asserts an unbroken grid."""
    states = drive.record(begin, drive.now()).states
    assert set(np.diff(states.stamp)) <= {TSP_NS}
    psec = states["psec", joint]
    return psec[np.concatenate([[True], psec[1:] != psec[:-1]])]


def node_status(drive: AxesClient, condition: Callable[[dict[str, str]], bool]) -> DiagnosticStatus:
    """Returns the node's status of the first new diagnostics whose values satisfy `condition`."""
    seen = len(drive.diagnostics())

    def found() -> list[DiagnosticStatus]:
        return [array.status[0] for array in drive.diagnostics()[seen:] if condition(status_values(array.status[0]))]

    return drive.wait_for(found, 5, "diagnostics of the stream")[0]


def numbers(drive: AxesClient, *keys: str) -> tuple[int, ...]:
    """Returns counters of the node, from the next diagnostics."""
    reported = drive.next_status()
    return tuple(int(reported[key]) for key in keys)


def counts(drive: AxesClient) -> tuple[int, int]:
    """Returns the numbers of rejected and ignored setpoints."""
    rejected, ignored = numbers(drive, "stream_setpoints_rejected", "stream_setpoints_ignored")
    return rejected, ignored


def stream_results(drive: AxesClient, begin: int) -> list[R]:
    """Returns the results of the stream since `begin`, ns."""
    found = [result for result in drive.results() if result.source == R.SOURCE_STREAM]
    return [result for result in found if to_ns(result.header.stamp) >= begin]


def results_of_preemption(drive: AxesClient, take: Callable[[], object]) -> list[R]:
    """Returns the results when `take` preempts joints of a stream at rest at x = 0.001, y = 0; a few attempts."""
    for _ in range(ATTEMPTS):
        go_home(drive)
        time.sleep(0.2)
        follow(drive, ["x", "y"], np.array([[0.001, 0.0]]))
        # In the cycle of its step the axis is in motion, from which a stop decelerates.
        drive.wait_until(drive.now() + 3 * TSP_NS, 5)
        ended = threading.Event()

        def stream(ended: threading.Event = ended) -> None:
            while not ended.wait(0.01):
                drive.stream(["x", "y"], [0.001, 0.0])

        thread = threading.Thread(target=stream)
        thread.start()
        begin = drive.now()
        try:
            take()
            return drive.wait_for(lambda begin=begin: stream_results(drive, begin), 2, "result of the stream")
        except TimeoutError:
            # A stall of the machine has paused the stream.
            continue
        finally:
            ended.set()
            thread.join()
    pytest.fail("the stream had paused in each attempt")


def wave(amplitude: float, count: int = 100) -> np.ndarray:
    """Returns one swing 0 -> amplitude -> 0."""
    return amplitude / 2 * (1 - np.cos(2 * np.pi * np.arange(1, count + 1) / count))


@pytest.mark.parametrize("mode", ["real", "fast"])
def test_streamed_setpoints_are_executed_sample_by_sample(mode: str, request: pytest.FixtureRequest):
    """Two axes on their own paths: each setpoint bit for bit, none duplicated, none missing."""
    drive: AxesClient = request.getfixturevalue(mode)
    go_home(drive)
    begin = drive.now()
    rows = np.column_stack([wave(0.04), -wave(0.02)])[:80]
    follow(drive, ["x", "c"], rows)
    np.testing.assert_array_equal(commanded(drive, "x", begin), [0.0, *rows[:, 0]])
    np.testing.assert_array_equal(commanded(drive, "c", begin), [0.0, *rows[:, 1]])
    assert not commanded(drive, "y", begin).any()
    drive.wait_until(drive.now() + 150 * TSP_NS, 10)
    assert drive.latest("position")["x"] == pytest.approx(rows[-1, 0], abs=2e-6)
    assert drive.latest("psec")["x"] == rows[-1, 0]


def test_a_sender_with_its_own_clock_is_followed_in_order(real: AxesClient):
    """At the position cycle of another clock: setpoints may repeat or be skipped, but never go back."""
    go_home(real)
    begin, rejected = real.now(), counts(real)[0]
    # Slow enough that the setpoints after a delay of the sender are still within reach.
    sent = np.arange(1, 301) * REACH / 300
    due = time.monotonic()
    for position in sent:
        real.stream(["x"], [position])
        due += TSP
        time.sleep(max(0.0, due - time.monotonic()))
    real.wait_for(lambda: real.latest("psec")["x"] == sent[-1], 5, "last setpoint")
    followed = commanded(real, "x", begin)[1:]
    assert set(followed) <= set(sent)
    assert (np.diff(followed) > 0).all()
    assert counts(real)[0] == rejected


def test_nan_and_short_arrays_do_not_command_joints(real: AxesClient):
    """NaN and a missing position mean that the message does not command the joint."""
    go_home(real)
    begin = real.now()
    rejected = counts(real)[0]
    follow(real, ["y"], np.array([[0.001]]))
    real.stream(["z", "x", "y"], [math.nan, 0.002])
    real.wait_for(lambda: real.latest("psec")["x"] == 0.002, 5, "setpoint of x")
    real.stream(["x", "y"], [])
    real.stream(["x"], [math.nan])
    assert counts(real)[0] == rejected
    np.testing.assert_array_equal(commanded(real, "x", begin), [0.0, 0.002])
    np.testing.assert_array_equal(commanded(real, "y", begin), [0.0, 0.001])
    assert not commanded(real, "z", begin).any()


def test_a_trajectory_preempts_a_stream(real: AxesClient):
    """The trajectory starts at the streamed setpoint; other joints continue with the stream."""
    go_home(real)
    follow(real, ["x", "y"], np.array([[0.001, 0.001], [0.002, 0.002]]))
    ignored = counts(real)[1]
    plan = 0.002 + wave(0.02, 500)
    accepted = real.accept(joint_trajectory(["x"], np.arange(500) * TSP, plan))
    start = to_ns(accepted.start)
    real.wait_until(start, 5)
    for position in np.arange(3, 13) * 1e-3:
        real.stream(["x", "y"], [0.002, position])
        real.wait_for(lambda: real.latest("psec")["y"] == position, 5, "setpoint of y")
    assert real.end(accepted.sequence_number, 10).status == R.COMPLETED
    assert_psec(real, start, {"x": plan})
    assert counts(real)[1] == ignored + 10
    # Then the stream commands the joint again.
    follow(real, ["x"], np.array([[plan[-1] + 0.001]]))
    assert real.latest("psec")["y"] == 0.012


def test_invalid_streamed_setpoints_are_rejected_counted_and_logged_once_a_second(start: Callable[..., AxesClient]):
    """Beyond the travel limits, out of reach, unknown joint; the axis does not move, and the log is limited."""
    drive = start()
    begin = drive.now()
    assert counts(drive) == (0, 0)
    seen = len(drive.diagnostics())
    sent = time.monotonic()
    for _ in range(20):
        drive.stream(["x"], [0.4])
        drive.stream(["x"], [0.1])
        drive.stream(["q", "y"], [0.0, 0.001])
        time.sleep(0.02)
    lasted = time.monotonic() - sent
    assert counts(drive) == (60, 0)
    statuses = [array.status[0] for array in drive.diagnostics()[seen:]]
    assert any(s.level == DiagnosticStatus.WARN and "streamed setpoints were rejected" in s.message for s in statuses)
    assert not commanded(drive, "x", begin).any()
    np.testing.assert_array_equal(commanded(drive, "y", begin), [0.0, 0.001])
    reported = [line for line in drive.process.output().splitlines() if "streamed setpoint rejected" in line]
    for words in ("outside the travel limits", "away from the previous setpoint", "unknown joint q"):
        lines = [line for line in reported if words in line]
        assert 1 <= len(lines) <= 1 + lasted, reported


def test_a_reset_ends_the_stream(real: AxesClient):
    """After the reset the old stream is out of reach; a stream that begins at home is accepted."""
    go_home(real)
    follow(real, ["x"], REACH * np.arange(1, 11).reshape(-1, 1) * 0.9)
    rejected = counts(real)[0]
    go_home(real)
    begin = real.now()
    real.stream(["x"], [10 * REACH])
    assert counts(real)[0] == rejected + 1
    follow(real, ["x"], np.array([[REACH / 2]]))
    np.testing.assert_array_equal(commanded(real, "x", begin), [0.0, REACH / 2])


def test_a_stream_that_is_preempted_gets_a_result(real: AxesClient):
    """One result, with the joints that the trajectory preempts."""
    hold = joint_trajectory(["x", "z"], [0.0, 0.1], [[0.001, 0.0], [0.002, 0.0]])
    reported = results_of_preemption(real, lambda: real.run(hold))
    assert [(result.status, result.name) for result in reported] == [(R.PREEMPTED, ["x"])]
    assert re.fullmatch(r"preempted by trajectory \d+ of psec", reported[0].text)


def test_after_a_stop_a_stream_is_ignored_until_it_pauses(real: AxesClient):
    """The stream continues within reach of the axis; it gets a result, and is accepted after a pause."""

    def sent_on_while_ignored() -> bool:
        """Returns false if the stream paused, as on a machine that stalled for a tenth of a second."""
        go_home(real)
        reported = results_of_preemption(real, lambda: real.stop())
        assert [(result.status, result.name) for result in reported] == [(R.STOPPED, ["x", "y"])]
        seen = len(real.diagnostics())
        positions = iter(np.linspace(0.001, 0.002, 10_000))

        def ignored() -> bool:
            real.stream(["x"], [next(positions)])
            statuses = [array.status[0] for array in real.diagnostics()[seen:]]
            return any(
                status_values(s)["stream_held_off"] == "true" and s.level == DiagnosticStatus.WARN for s in statuses
            )

        real.wait_for(ignored, 5, "diagnostics of an inhibited stream")
        return real.latest("psec")["x"] == 0.001

    assert any(sent_on_while_ignored() for _ in range(ATTEMPTS)), "the stream was followed in each attempt"
    time.sleep(0.2)
    follow(real, ["x"], np.array([[0.003]]))
    node_status(real, lambda v: v["stream_held_off"] == "false")


def test_duplicate_and_reordered_setpoints_are_ignored(real: AxesClient):
    """Order by stamps, which are optional."""
    go_home(real)
    begin, before = real.now(), numbers(real, "stream_messages_out_of_order", "stream_setpoints_rejected")
    base = 10**9
    for stamp, position in [(1, 0.001), (1, 0.001), (3, 0.003), (2, 0.002), (0, 0.0031), (4, 0.004), (4, 0.004)]:
        real.stream(["x"], [position], stamp and base + stamp * TSP_NS)
        if stamp != 2:
            real.wait_for(lambda p=position: real.latest("psec")["x"] == p, 5, f"setpoint {position}")
    after = numbers(real, "stream_messages_out_of_order", "stream_setpoints_rejected")
    assert (after[0] - before[0], after[1] - before[1]) == (1, 0)
    np.testing.assert_array_equal(commanded(real, "x", begin), [0.0, 0.001, 0.003, 0.0031, 0.004])


def test_a_gap_in_the_stream_during_motion_holds_the_axes_and_is_logged(start: Callable[..., AxesClient]):
    """One log line and a counter in the diagnostics; a stream that ends at rest is not reported."""
    drive = start()
    follow(drive, ["x"], REACH * np.arange(1, 6).reshape(-1, 1) * 0.9)
    status = node_status(drive, lambda v: v["stream_gaps"] != "0")
    assert status.level == DiagnosticStatus.WARN and "gap in the stream during motion" in status.message
    # More than one on a machine that stalled for a tenth of a second.
    gaps = int(status_values(status)["stream_gaps"])
    assert drive.latest("psec")["x"] == REACH * 5 * 0.9
    # A tenth of the speed from which the axis can stop in one cycle.
    follow(drive, ["x"], REACH * 4.5 + np.arange(1, 6).reshape(-1, 1) * 1e-6)
    time.sleep(0.2)
    assert numbers(drive, "stream_gaps") == (gaps,)
    lines = [line for line in drive.process.output().splitlines() if "gap in the stream" in line]
    assert 1 <= len(lines) <= gaps, lines


def test_diagnostics_contain_stream_state_and_delay(real: AxesClient):
    """Without a controller with preview there is no delay."""
    go_home(real)
    status = node_status(real, lambda v: v["stream_drives"] == "false" and v["state"] == "holding")
    assert status_values(status)["stream_delay_ms"] == "0"

    seen = len(real.diagnostics())
    positions = iter(np.tile(wave(0.01), 50))

    def streaming() -> bool:
        real.stream(["x"], [next(positions)])
        return any(
            (found := status_values(a.status[0]))["stream_drives"] == "true" and found["state"] == "streaming"
            for a in real.diagnostics()[seen:]
        )

    real.wait_for(streaming, 5, "diagnostics of an active stream")
    node_status(real, lambda v: v["stream_drives"] == "false")
    # A trajectory is not a stream.
    go_home(real)
    start_swing(real, duration=6.0)
    node_status(real, lambda v: v["stream_drives"] == "false" and v["state"] == "running")
    real.stop()


def test_a_controller_with_preview_delays_the_stream(start: Callable[..., AxesClient]):
    """The delay is the preview beyond the part that alpha covers, and equal for all joints."""
    drive = start("-p", "x.position_loop.controller:=gpc")
    found = drive.get_parameters(["x.position_loop.gpc.n2", "x.delays.alpha_ms"])
    delay = found["x.position_loop.gpc.n2"] - math.ceil(found["x.delays.alpha_ms"] * 1e6 / TSP_NS)
    assert delay > 0
    node_status(drive, lambda v: v["stream_delay_ms"] == f"{delay * TSP_NS // 1_000_000}")

    begin = drive.now()
    drive.stream(["x", "y"], [0.001, 0.001])
    drive.wait_for(lambda: drive.latest("psec")["x"] == 0.001, 5, "setpoint of x")
    states = drive.record(begin, drive.now()).states
    first = {joint: states.stamp[np.flatnonzero(states["psec", joint])[0]] for joint in ("x", "y")}
    assert first["x"] == first["y"]
    # Sent after `begin`, so the earliest instant of its effect is the next but one.
    assert first["x"] >= begin + (1 + delay) * TSP_NS
    rows = np.column_stack([0.001 + wave(0.02, 50)])[:20]
    follow(drive, ["x"], rows)
    np.testing.assert_array_equal(commanded(drive, "x", begin), [0.0, 0.001, *rows[:, 0]])

    # A controller without preview: no delay, after the stream has paused.
    drive.set_parameters({"x.position_loop.controller": "cascade"})
    node_status(drive, lambda v: v["stream_delay_ms"] == "0")


def test_in_fast_a_stream_runs_at_wall_clock_rate(fast: AxesClient):
    """Its sender runs in real time, too: the axes must not run ahead of it."""
    go_home(fast)
    before, began = fast.now(), time.monotonic()
    for position in wave(0.01, 150):
        fast.stream(["x"], [position])
        time.sleep(TSP)
    shown, passed = (fast.now() - before) / 1e9, time.monotonic() - began
    # Slower on a busy machine, never faster.
    assert 0 < shown < 1.5 * passed


def test_the_topic_can_be_renamed_and_is_reliable(start: Callable[..., AxesClient]):
    """Renamed to the topic on which ros2_control's topic-based hardware publishes."""
    drive = start("-r", "psec_stream:=/robot_joint_commands", connect=False)
    found = drive.wait_for(
        lambda: drive.node.get_subscriptions_info_by_topic("/robot_joint_commands"), 10, "subscription"
    )[0]
    assert found.topic_type == "sensor_msgs/msg/JointState"
    profile = found.qos_profile
    assert (profile.reliability, profile.durability) == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
    assert drive.node.count_subscribers("/psec_stream") == 0
