"""Publishers that are killed, flood, or contend, while the axes move as commanded."""

from __future__ import annotations

import random
import re
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from virtual_axes.msg import TrajectoryResult as R

from motion import TSP, assert_psec, go_home, start_swing, swing
from node_process import Node, resident_mb
from participant import Participant, long_trajectory
from virtual_axes_py.ros import TSP_NS, AxesClient, joint_trajectory, parameter_messages, to_ns

POINTS = 500_000
MESSAGE_MB = 20
"""Returns a serialized trajectory of two joints with this number of points."""
ATTEMPTS = 4
FLOOD = 10_000
FLOOD_OF_TRAJECTORIES = 4_000
"""Messages of a flood with two results each, which this process has to read."""
LINES_A_SECOND = 55
"""Maximum number of log lines of one kind: 50, plus the notice of suppression."""
GROWTH_MB = 30.0
"""Memory of full queues and histories, MB: mainly 8192 results and log lines in the middleware."""


@pytest.fixture(scope="module")
def node() -> Iterator[AxesClient]:
    """Yields real-time axes that accept trajectories of any length, shared by the module."""
    with Node() as process, AxesClient(process=process) as drive:
        yield drive


def pid_of(drive: AxesClient) -> int:
    """Returns the process id of the node."""
    assert drive.process is not None
    return drive.process.pid


def kill_while_sending(drive: AxesClient, folder: Path) -> bool:
    """Kills a publisher when the node has begun to assemble its message; returns true if the node had begun."""
    pid, decided = pid_of(drive), len(drive.results())
    with Participant(drive.process.domain_id, "send", POINTS, lease=2, folder=folder) as sender:
        before = resident_mb(pid)
        sender.go_on()
        deadline = time.monotonic() + 5
        # The buffer for the whole message is allocated at its first fragment.
        while resident_mb(pid) < before + 0.8 * MESSAGE_MB and time.monotonic() < deadline:
            time.sleep(0.0005)
        begun = time.monotonic() < deadline
        sender.kill()
    time.sleep(0.5)
    return len(drive.results()) == decided and begun


def test_a_publisher_killed_within_a_message_does_not_affect_others(node: AxesClient, tmp_path: Path):
    """The next publisher's trajectory is executed bit-identically; received fragments of the message stay in memory."""
    time_s, position = swing(1.2)
    motion = joint_trajectory(["x", "c"], time_s, np.column_stack([position, 3 * position]))
    go_home(node)
    before = node.run(motion)
    memory, attempts = resident_mb(pid_of(node)), 1
    while not kill_while_sending(node, tmp_path):
        assert attempts < ATTEMPTS, "each message was complete before its sender was killed"
        attempts += 1
    go_home(node)
    after = node.run(motion)
    for kind, field in (("states", "psec"), ("joints", "position"), ("currents", "current")):
        np.testing.assert_array_equal(getattr(after, kind)[field], getattr(before, kind)[field], err_msg=field)
    # A complete message is stored twice, as received and as a trajectory.
    assert resident_mb(pid_of(node)) < memory + 3 * MESSAGE_MB * attempts


def test_a_trajectory_of_500_000_points_does_not_disturb_the_motion_under_way(node: AxesClient):
    """The trajectory is accepted, and the active motion continues bit for bit; its memory is released afterwards."""
    go_home(node)
    memory = resident_mb(pid_of(node))
    accepted, start, plan = start_swing(node, duration=4.8)
    with node._changed:
        node._sent += 1
        long = node._sent
        node._psec.publish(long_trajectory(POINTS))
    assert node.decision(long, 60).status == R.ACCEPTED
    assert_psec(node, start, plan)
    assert node.end(accepted.sequence_number, 10).status == R.COMPLETED
    node.stop()
    assert node.end(long, 10).status == R.STOPPED
    # The middleware keeps the message: it stores the last 64.
    node.wait_for(lambda: resident_mb(pid_of(node)) < memory + 4 * MESSAGE_MB, 30, f"memory near {memory} MB")


def flood(publisher: Any, message: Any, number: int) -> float:
    """Publishes `number` messages, 10 000 a second or more if the machine is fast enough; returns the duration, s."""
    raw, begin = serialize_message(message), time.monotonic()
    for _ in range(number):
        publisher.publish(raw)
    return time.monotonic() - begin


def forget_results(drive: AxesClient) -> None:
    """Drops the results of a flood after the last has arrived: searching thousands of results takes long."""
    silent_since, known = time.monotonic(), -1
    deadline = silent_since + 30
    while time.monotonic() < min(deadline, silent_since + 0.5):
        if len(drive.results()) != known:
            silent_since, known = time.monotonic(), len(drive.results())
        time.sleep(0.05)
    with drive._changed:
        drive._results.clear()


def move_through(drive: AxesClient, act: Callable[[], None]) -> str:
    """Runs a swing of Z during `act`, checks psec and the log length, and returns the log."""
    go_home(drive)
    logged_before = len(drive.process.output())
    begin = time.monotonic()
    accepted, start, plan = start_swing(drive, ["z"], duration=1.8, amplitude=0.02)
    act()
    assert_psec(drive, start, plan)
    assert drive.end(accepted.sequence_number, 30).status == R.COMPLETED
    # Diagnostics and the last log lines are complete now.
    drive.next_status()
    log, seconds = drive.process.output()[logged_before:], time.monotonic() - begin
    kinds: dict[str, int] = {}
    for line in log.splitlines():
        kind = re.sub(r"\d+", "", line.split("]: ", 1)[-1].removeprefix("more than"))
        kinds[kind] = kinds.get(kind, 0) + 1
    assert all(count < LINES_A_SECOND * (seconds + 2) for count in kinds.values()), kinds
    return log


FLOODS = {
    "accepted trajectories": ("_psec", joint_trajectory(["x"], [0.0, 0.06], [[0.0]] * 2)),
    "rejected trajectories": ("_psec", joint_trajectory(["q"], [0.0], [[0.0]])),
    "accepted setpoints": ("_stream", JointState(name=["x"], position=[1e-4])),
    "rejected setpoints": ("_stream", JointState(name=["x"], position=[0.4])),
    "loads": ("_load", JointState(name=["x"], effort=[1.0])),
    "rejected loads": ("_load", JointState(name=["q"], effort=[1.0])),
}


@pytest.mark.parametrize("what", FLOODS)
def test_a_flood_of_10_000_messages_a_second(node: AxesClient, what: str):
    """The active motion is undisturbed, memory and log are bounded, and commands are accepted as before."""
    publisher, message = FLOODS[what]
    rejected = int(node.next_status()["stream_setpoints_rejected"])
    memory = resident_mb(pid_of(node))

    def act() -> None:
        number = FLOOD_OF_TRAJECTORIES if publisher == "_psec" else FLOOD
        seconds = flood(getattr(node, publisher), message, number)
        if publisher == "_psec":
            node._sent += number
        print(f"\n{what}: {number / seconds:.0f} per second, ", end="")

    log = move_through(node, act)
    grown = resident_mb(pid_of(node)) - memory
    print(f"{grown:.1f} MB more, {log.count(chr(10))} lines")
    assert grown < GROWTH_MB
    if publisher == "_psec":
        assert "lines of this kind" in log, "no log line was suppressed"
        forget_results(node)
    if what == "rejected setpoints":
        assert int(node.next_status()["stream_setpoints_rejected"]) > rejected
        assert log.count("streamed setpoint rejected") <= 10
    if what == "rejected loads":
        assert 1 <= log.count("load message ignored") <= 10
    node.set_parameters({"x.velocity_loop.gain": 5.0})
    time_s, position = swing(0.6, amplitude=0.01)
    recording = node.run(joint_trajectory(["y"], time_s, position))
    assert_psec(node, recording.start, {"y": position})


def test_a_flood_of_service_calls(node: AxesClient):
    """Thousands of simultaneous calls of two services: the last calls get a response, and memory does not grow."""
    memory = resident_mb(pid_of(node))
    deep = QoSProfile(depth=FLOOD)
    setter = node.node.create_client(SetParameters, f"{node.target}/set_parameters", qos_profile=deep)
    stopper = node.node.create_client(Trigger, f"{node.target}/stop", qos_profile=deep)
    for client in (setter, stopper):
        node.wait_for(client.service_is_ready, 10, "service")
    time.sleep(0.2)
    go_home(node)
    begin = time.monotonic()
    request = SetParameters.Request(parameters=parameter_messages({"x.velocity_loop.gain": 5.0}))
    calls = [setter.call_async(request) for _ in range(FLOOD // 10)]
    calls += [stopper.call_async(Trigger.Request()) for _ in range(FLOOD // 10)]
    print(f"\n{len(calls) / (time.monotonic() - begin):.0f} per second")
    node.wait_for(lambda: sum(call.done() for call in calls) > len(calls) // 10, 60, "answers")
    for client in (setter, stopper):
        node.in_executor(lambda client=client: node.node.destroy_client(client))
    # A new call waits for earlier ones only.
    assert node.reset(timeout=60)
    assert resident_mb(pid_of(node)) - memory < GROWTH_MB


def test_parameters_can_be_set_while_a_stream_floods_the_node(node: AxesClient):
    """No parameter is rejected because of a full command queue."""
    go_home(node)
    ended = threading.Event()
    raw = serialize_message(JointState(name=["x"], position=[1e-4]))

    def stream() -> None:
        while not ended.is_set():
            for _ in range(100):
                node._stream.publish(raw)
            time.sleep(0.001)

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        for k in range(40):
            node.set_parameters({"x.velocity_loop.gain": 4.5 + 0.01 * k})
    finally:
        ended.set()
        thread.join()
    # Messages still in transit.
    time.sleep(0.5)
    node.set_parameters({"x.velocity_loop.gain": 5.0})


def test_of_two_contending_publishers_the_newest_commands_the_joint(node: AxesClient):
    """Each instant belongs to one trajectory, complete from its start until the next start; each has a result."""
    go_home(node)
    with AxesClient(process=node.process) as other:
        plans: dict[int, tuple[str, np.ndarray]] = {}
        begin = node.now()
        results = []
        for k in range(12):
            drive = (node, other)[k % 2]
            # Distinct by their values, and reachable from each other.
            position = 1e-4 * (k + 1) + np.arange(300) * 1e-7
            trajectory = joint_trajectory(["x", "y"], np.arange(300) * TSP, np.column_stack([position, -position]))
            accepted = drive.accept(trajectory)
            results.append((drive, accepted.sequence_number))
            plans[to_ns(accepted.start)] = ("", position)
            node.wait_until(to_ns(accepted.start) + 5 * TSP_NS, 10)
        ends = [drive.end(number, 10).status for drive, number in results]
        assert ends == [R.PREEMPTED] * 11 + [R.COMPLETED]
        states = node.record(begin, max(plans) + 299 * TSP_NS).states
    starts = np.array(sorted(plans))
    assert set(np.diff(states.stamp)) == {TSP_NS}
    for stamp, x, y in zip(states.stamp, states["psec", "x"], states["psec", "y"]):
        if stamp >= starts[0]:
            start = starts[np.searchsorted(starts, stamp, side="right") - 1]
            assert x == plans[start][1][(stamp - start) // TSP_NS]
        assert x == -y


def test_messages_of_two_contending_streams_are_not_mixed(node: AxesClient):
    """The joints of one message are commanded together: the last message of a cycle counts."""
    go_home(node)
    with AxesClient(process=node.process) as other:
        begin = node.now()
        sent: list[tuple[float, float]] = [(0.0, 0.0)]
        turns = random.Random(8)
        for k in range(300):
            # Random order, so that each of them is sometimes the last of a cycle.
            for drive, sign in turns.sample(((node, 1), (other, -1)), 2):
                sent.append((sign * 1e-6 * (k + 1), sign * 2e-6 * (k + 1)))
                drive.stream(["x", "y"], sent[-1])
            time.sleep(0.002)
        node.wait_until(node.now() + 10 * TSP_NS, 10)
        states = node.record(begin, node.now()).states
    commanded = list(zip(states["psec", "x"].tolist(), states["psec", "y"].tolist()))
    assert set(commanded) <= set(sent)
    assert commanded[-1] == sent[-1]
    indices = [sent.index(pair) for pair in commanded]
    assert indices == sorted(indices), "an older message followed a newer one"
    assert {x > 0 for x, _ in commanded if x} == {True, False}, "only one of them was followed"
    assert len(set(commanded)) > 30
