"""The node's process is paused, or dies and is restarted, while other participants stay."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from action_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState

from action import Follow, goal, line
from motion import assert_psec, go_home, start_swing, swing
from node_process import Node
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, status_values, to_ns

PAUSE_S = 5
SHALLOW = 10
"""Default depth of subscribers: samples of a longer burst are lost."""
BURST_S = 1.0
"""Maximum pause of which the node catches up the missed cycles."""
REANNOUNCED_S = 3.5
"""Fast DDS rediscovers publishers and clients for a restarted node after 3 s in most cases."""
RECOVERY_S = 30.0
RESTARTS = 4
AT_ONCE_S = 1.2
"""Longest time for which a message or call is at once; one of `RESTARTS` may take longer on a busy machine."""
Answer = TypeVar("Answer")


def diagnostics(drive: AxesClient) -> list[dict[str, str]]:
    """Returns the values of all diagnostics so far."""
    return [status_values(array.status[0]) for array in drive.diagnostics()]


def test_a_paused_node_continues_without_a_burst(real: AxesClient):
    """Missed cycles are counted and reported, the motion stays on schedule, services respond as before."""
    go_home(real)
    assert real.process is not None
    stamps: list[int] = []
    subscription = real.node.create_subscription(
        JointState, "/joint_states", lambda message: stamps.append(to_ns(message.header.stamp)), SHALLOW
    )
    real.wait_for(lambda: stamps, 10, "samples")
    real.wait_for(real.diagnostics, 10, "diagnostics")
    before = diagnostics(real)[-1]
    accepted, start, plan = start_swing(real, duration=PAUSE_S + 4.0)
    real.wait_until(start + NANOSECONDS // 2, 10)
    os.kill(real.process.pid, signal.SIGSTOP)
    try:
        time.sleep(PAUSE_S)
        paused = stamps[-1]
    finally:
        os.kill(real.process.pid, signal.SIGCONT)
    real.wait_until(paused + (PAUSE_S + 1) * NANOSECONDS, 20)
    recording = real.record(start, real.now())
    states = recording.states
    # One gap without catch-up; after it the grid continues and psec is as planned.
    gaps = np.diff(states.stamp) // TSP_NS
    at = int(np.argmax(gaps))
    assert gaps[at] >= (PAUSE_S - BURST_S) * NANOSECONDS / TSP_NS
    assert set(gaps[:at]) == {1}
    index = (states.stamp - start) // TSP_NS
    inside = index < len(plan["x"])
    np.testing.assert_array_equal(states["psec", "x"][inside], plan["x"][index[inside]])
    # A subscriber with depth 10 has received the samples after the gap, like a keep-all subscriber.
    resumed = int(states.stamp[at + 1])
    after = [stamp for stamp in stamps if stamp >= resumed]
    assert after[0] - resumed <= SHALLOW * TSP_NS
    # The pause is counted and logged once.
    missed = (PAUSE_S - BURST_S) * NANOSECONDS // TSP_NS

    def counted(values: dict[str, str]) -> bool:
        return all(int(values[key]) - int(before[key]) >= missed for key in ("missed_periods", "unpublished_periods"))

    real.wait_for(lambda: counted(diagnostics(real)[-1]), 10, "count of the missed cycles")
    messages = [array.status[0].message for array in real.diagnostics()]
    assert any("the node stalled" in message for message in messages)
    real.wait_for(lambda: "the node stalled for" in real.process.output(), 5, "a line of the log")
    # The middleware's threads survive the pause.
    assert "poll" not in real.process.output()
    assert real.end(accepted.sequence_number, 20).status == 2
    real.in_executor(lambda: real.node.destroy_subscription(subscription))
    go_home(real)
    time_s, position = swing(0.6, amplitude=0.01)
    again = real.run(joint_trajectory(["y"], time_s, position))
    assert_psec(real, again.start, {"y": position})


def recovers(act: Callable[[], Answer]) -> Answer:
    """Repeats `act` until it does not time out and returns its result."""
    deadline = time.monotonic() + RECOVERY_S
    while True:
        try:
            return act()
        except TimeoutError:
            if time.monotonic() > deadline:
                raise


def test_existing_participants_work_with_a_node_that_was_killed_and_started_again():
    """Existing publishers, subscribers, service clients and action clients work without a restart."""
    with Node(["-p", "max_points:=20000"]) as process, AxesClient(process=process) as drive, Follow(drive) as follow:
        drive.set_parameters({"x.velocity_loop.gain": 4.9})
        assert follow.send(goal(line(["x"], [0.001], 0.2))).status() == GoalStatus.STATUS_SUCCEEDED
        drive.reset()
        lost = drive.accept(joint_trajectory(["x"], [30.0], [[0.01]]))
        drive.process = None
        process.stop(signal.SIGKILL)
        last = drive.now()
        process.start()
        drive.process = process
        # Subscribers.
        drive.wait_for(lambda: drive.now() > last, RECOVERY_S, "samples of the new node")
        time.sleep(REANNOUNCED_S)
        assert drive.latest("position")["x"] == 0.0
        # Publisher: its trajectory is accepted, and its results have the same sequence numbers.
        time_s, position = swing(0.6, amplitude=0.01)
        motion = joint_trajectory(["y"], time_s, position)
        accepted = recovers(lambda: drive.accept(motion, timeout=2))
        assert accepted.sequence_number > lost.sequence_number
        assert_psec(drive, to_ns(accepted.start), {"y": position})
        # Service clients.
        gain = "x.velocity_loop.gain"
        found = recovers(lambda: drive.get_parameters([gain]))
        assert found == {gain: 5.0}, "default value of the new node"
        recovers(lambda: drive.set_parameters({gain: 4.8}))
        recovers(drive.reset)
        # Action client.
        assert recovers(lambda: follow.send(goal(line(["x"], [0.001], 0.2)))).status() == GoalStatus.STATUS_SUCCEEDED


def test_existing_publishers_and_clients_reach_a_restarted_node_at_once():
    """A node that was ended and started again takes the first message and call of participants older than itself.

    Without a request of the node, they would wait for the next heartbeat of their publishers, 3 s.
    """
    gain = "x.velocity_loop.gain"
    seconds: dict[str, list[float]] = {"psec": [], "service": []}
    with Node() as process, AxesClient(process=process) as drive:
        drive.accept(joint_trajectory(["x"], [1.0], [[0.001]]))
        drive.get_parameters([gain])
        for _ in range(RESTARTS):
            drive.process = None
            process.stop(signal.SIGINT)
            last = drive.now()
            process.start()
            drive.process = process
            drive.wait_for(lambda last=last: drive.now() > last, RECOVERY_S, "samples of the new node")
            acts: dict[str, Callable[[], object]] = {
                "psec": lambda: drive.accept(joint_trajectory(["x"], [1.0], [[0.001]]), timeout=RECOVERY_S),
                "service": lambda: drive.get_parameters([gain]),
            }
            for name in acts:
                begin = time.monotonic()
                acts[name]()
                seconds[name].append(time.monotonic() - begin)
    for name, found in seconds.items():
        at_once = sum(second < AT_ONCE_S for second in found)
        assert at_once >= RESTARTS - 1, f"{name}: {found} s"
