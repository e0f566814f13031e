"""The node's process is paused, or dies and is started again, while others stay."""

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
from drive import NANOSECONDS, TSP_NS, Drive, Node, joint_trajectory, status_values, to_ns
from motion import assert_psec, go_home, start_swing, swing

PAUSE_S = 5
SHALLOW = 10
"""As subscribers have it by default: a burst of more than that is lost on them."""
BURST_S = 1.0
"""Of so much the node makes up for what it has missed."""
REANNOUNCED_S = 3.5
"""Fast DDS tells a node that comes back of publishers and clients again after 3 s in most cases."""
RECOVERY_S = 30.0
Answer = TypeVar("Answer")


def diagnostics(drive: Drive) -> list[dict[str, str]]:
    """Values of all diagnostics so far."""
    return [status_values(array.status[0]) for array in drive.diagnostics()]


def test_a_node_that_was_paused_goes_on_without_a_burst(real: Drive):
    """Missed periods are counted and told, the motion is where it would have been, services are served as before."""
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
    # One gap, of which nothing is made up for; after it the grid as before, and psec as planned.
    gaps = np.diff(states.stamp) // TSP_NS
    at = int(np.argmax(gaps))
    assert gaps[at] >= (PAUSE_S - BURST_S) * NANOSECONDS / TSP_NS
    assert set(gaps[:at]) == {1}
    index = (states.stamp - start) // TSP_NS
    inside = index < len(plan["x"])
    np.testing.assert_array_equal(states["psec", "x"][inside], plan["x"][index[inside]])
    # One that keeps ten has got what came after it, as one that keeps all.
    resumed = int(states.stamp[at + 1])
    after = [stamp for stamp in stamps if stamp >= resumed]
    assert after[0] - resumed <= SHALLOW * TSP_NS
    # It is counted, and said once.
    missed = (PAUSE_S - BURST_S) * NANOSECONDS // TSP_NS

    def counted(values: dict[str, str]) -> bool:
        return all(int(values[key]) - int(before[key]) >= missed for key in ("missed_periods", "unpublished_periods"))

    real.wait_for(lambda: counted(diagnostics(real)[-1]), 10, "count of the missed periods")
    messages = [array.status[0].message for array in real.diagnostics()]
    assert any("the node stood still" in message for message in messages)
    assert "the node stood still for" in real.process.output()
    # The middleware's threads have outlived it.
    assert "poll" not in real.process.output()
    assert real.end(accepted.sequence_number, 20).status == 2
    real.in_executor(lambda: real.node.destroy_subscription(subscription))
    go_home(real)
    time_s, position = swing(0.6, amplitude=0.01)
    again = real.run(joint_trajectory(["y"], time_s, position))
    assert_psec(real, again.start, {"y": position})


def recovers(act: Callable[[], Answer]) -> Answer:
    """What `act` gives when it does not time out any more."""
    deadline = time.monotonic() + RECOVERY_S
    while True:
        try:
            return act()
        except TimeoutError:
            if time.monotonic() > deadline:
                raise


def test_who_stays_is_served_by_a_node_that_was_killed_and_started_again():
    """Publishers, subscribers, clients of services and of the action: none of them has to begin anew."""
    with Node(["-p", "max_points:=20000"]) as process, Drive(process=process) as drive, Follow(drive) as follow:
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
        # A publisher: its trajectory is taken, and its results are found by the same numbers.
        time_s, position = swing(0.6, amplitude=0.01)
        motion = joint_trajectory(["y"], time_s, position)
        accepted = recovers(lambda: drive.accept(motion, timeout=2))
        assert accepted.sequence_number > lost.sequence_number
        assert_psec(drive, to_ns(accepted.start), {"y": position})
        # Clients of services.
        gain = "x.velocity_loop.gain"
        found = recovers(lambda: drive.get_parameters([gain]))
        assert found == {gain: 5.0}, "a new node has its own"
        recovers(lambda: drive.set_parameters({gain: 4.8}))
        recovers(drive.reset)
        # A client of the action.
        assert recovers(lambda: follow.send(goal(line(["x"], [0.001], 0.2)))).status() == GoalStatus.STATUS_SUCCEEDED
