"""Renewal of the DDS participant: memory of departed endpoints is released, and no subscriber or client notices."""

from __future__ import annotations

import signal
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray
from control_msgs.action import FollowJointTrajectory
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from virtual_axes.msg import TrajectoryResult

from action import Follow, goal, line
from participant import Participant
from sim_clock import SimClock
from test_record import read, stamps
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory

DEPARTED = 60
"""Number of departed endpoints of a renewal."""
RENEWAL_S = 60
"""Timeout of a renewal, s: rest, discovery and retention take 15 s."""
GAIN = "x.velocity_loop.gain"
NO_RENEWAL_S = 8
"""Time without a renewal, s, longer than the rest before one."""
GONE_S = 3
"""Timeout for the removal of participants from the graph, s."""
STREAM_S = 8
"""Duration of a stream, s, longer than the rest before a renewal."""
MOVED = 0.02
"""Position of X before the renewal, m."""


def leave(drive: AxesClient, meanwhile: Callable[[], None] = lambda: None) -> None:
    """Creates subscriptions in another participant, which leaves when the node has discovered them."""
    assert drive.process is not None

    def count() -> int:
        meanwhile()
        return int(drive.next_status()["endpoints_discovered"])

    before = count()
    with AxesClient(process=drive.process, keep_samples=False) as other:
        for number in range(DEPARTED):
            create = other.node.create_subscription
            other.in_executor(lambda: create(JointState, f"/departing_{number}", lambda _: None, 1))
        drive.wait_for(lambda: count() >= before + DEPARTED, 30, "the endpoints that will depart")


def writers(drive: AxesClient, topic: str = "/joint_states") -> set[bytes]:
    """Returns the GIDs of a topic's publishers."""
    return {bytes(info.endpoint_gid) for info in drive.node.get_publishers_info_by_topic(topic)}


def endpoints(drive: AxesClient) -> Counter:
    """Returns the endpoints of the node with their types and QoS."""
    name, namespace = drive.target.lstrip("/"), "/"
    found: Counter = Counter()
    by_node = (
        drive.node.get_publisher_names_and_types_by_node,
        drive.node.get_subscriber_names_and_types_by_node,
        drive.node.get_service_names_and_types_by_node,
        drive.node.get_client_names_and_types_by_node,
    )
    for get in by_node:
        found.update((get.__name__, topic, *types) for topic, types in get(name, namespace))
    for topic, _ in drive.node.get_publisher_names_and_types_by_node(name, namespace):
        for info in drive.node.get_publishers_info_by_topic(topic):
            if info.node_name == name:
                qos = info.qos_profile
                found[(topic, str(qos.reliability), str(qos.durability))] += 1
    return found


def renew(drive: AxesClient, meanwhile: Callable[[], None]) -> None:
    """Waits for the next renewal to end and calls `meanwhile` until then."""
    first = writers(drive)
    deadline = time.monotonic() + RENEWAL_S
    has_overlapped = False
    while not (has_overlapped and len(now := writers(drive)) == 1 and now != first):
        has_overlapped = has_overlapped or len(writers(drive)) == 2
        assert time.monotonic() < deadline, drive.process.output()
        meanwhile()
    drive.wait_for(lambda: "participant is renewed" in drive.process.output(), 20, "log message")


def test_a_renewal_loses_nothing(start: Callable[..., AxesClient], tmp_path: Path):
    path = tmp_path / "renewed.mcap"
    drive = start("-p", f"renewal_endpoints:={DEPARTED}", "-p", f"record:={path}")
    with Follow(drive) as follow:
        drive.run(line(["x"], [MOVED], 1.0), settle=0.5)
        gain = drive.get_parameters([GAIN])[GAIN]
        drive.set_parameters({GAIN: 0.9 * gain})
        begin, known, first = drive.now(), endpoints(drive), writers(drive)

        # No renewal during a goal or a stream.
        active = follow.send(goal(line(["y"], [0.01], 10.0)))
        leave(drive)
        ended = active.ask()
        while not ended.done():
            assert writers(drive) == first
            time.sleep(0.05)
        assert ended.result().status == GoalStatus.STATUS_SUCCEEDED
        streams_until = time.monotonic() + STREAM_S
        while time.monotonic() < streams_until:
            drive.stream(["x"], [MOVED])
            assert writers(drive) == first
            time.sleep(0.02)

        invalid = joint_trajectory(["q"], [0.0], [[0.0]])
        sent: list[int] = []

        def load_inputs() -> None:
            """A rejected trajectory, a parameter request, and the node in the graph."""
            sent.append(drive.send(invalid))
            assert drive.get_parameters([GAIN])[GAIN] == pytest.approx(0.9 * gain)
            assert drive.is_in_graph()
            time.sleep(0.02)

        renew(drive, load_inputs)
        end = drive.now()
        drive.wait_for(lambda: drive.results(sent[-1]), 10, "last rejection")
        assert drive.next_status()["participant_renewals"] == "1"

        # Stamps without gap, for a subscriber and in the recording.
        assert set(np.diff(drive.record(begin, end).joints.stamp)) == {TSP_NS}
        assert drive.latest()["x"] == pytest.approx(MOVED, abs=1e-5)
        assert endpoints(drive) == known
        assert "duplicate node name" not in drive.process.output()

        # Late joiners get the kept messages of transient-local topics, also the goal status from before the renewal.
        late = QoSProfile(
            depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        kept: dict[str, list[Any]] = {}
        for kind, topic in (
            (GoalStatusArray, f"{follow.name}/_action/status"),
            (TrajectoryResult, f"{drive.target}/trajectory_result"),
            (Log, "/rosout"),
        ):
            kept[topic] = []
            drive.in_executor(lambda: drive.node.create_subscription(kind, topic, kept[topic].append, late))
        statuses, kept_results, logs = kept.values()
        drive.wait_for(lambda: len(kept_results) == 50 and statuses and logs, 10, "kept messages")
        assert kept_results[-1].sequence_number == sent[-1]
        listed = {bytes(entry.goal_info.goal_id.uuid): entry.status for entry in statuses[-1].status_list}
        assert listed == {active.id: GoalStatus.STATUS_SUCCEEDED}

        # Goals: the result of a finished one is kept, and a new one is executed.
        request = FollowJointTrajectory.Impl.GetResultService.Request()
        request.goal_id.uuid = list(active.id)
        response = drive.call(
            FollowJointTrajectory.Impl.GetResultService, "follow_joint_trajectory/_action/get_result", request
        )
        assert response.status == GoalStatus.STATUS_SUCCEEDED
        assert follow.send(goal(line(["z"], [0.01], 1.0))).status() == GoalStatus.STATUS_SUCCEEDED
        with Follow(drive) as another:
            assert another.send(goal(line(["a"], [0.01], 1.0))).status() == GoalStatus.STATUS_SUCCEEDED
        drive.set_parameters({GAIN: gain})
        assert drive.reset() == "at rest at home"
    drive.process.stop()
    messages, _, _ = read(path)
    times = stamps(messages["/joint_states"])
    assert times[0] < begin and times[-1] > end and set(np.diff(times)) == {TSP_NS}
    # Each message on psec was processed once, although both participants received it.
    results = [deserialize_message(e.data, TrajectoryResult) for e in messages["/virtual_axes/trajectory_result"]]
    rejected = [result.sequence_number for result in results if result.status == TrajectoryResult.REJECTED]
    assert rejected == sent


def test_with_a_simulated_clock_every_sample_arrives_once(start: Callable[..., AxesClient]):
    drive = start("-p", f"renewal_endpoints:={DEPARTED}", "-p", "use_sim_time:=true", connect=False)
    clock = SimClock(drive, now=100 * NANOSECONDS)
    clock.connect()
    clock.advance(1.0, 0.1)
    begin = clock.now

    def advance() -> None:
        clock.advance(0.6, 0.1)
        time.sleep(0.1)

    leave(drive, advance)
    renew(drive, advance)
    advance()
    samples = drive.record(begin, clock.now)
    for series in (samples.joints, samples.currents, samples.states):
        assert set(np.diff(series.stamp)) == {TSP_NS}


@pytest.mark.parametrize("setting", ["renewal_endpoints:=0", "time:=fast"])
def test_there_is_no_renewal_if_disabled_or_in_fast(start: Callable[..., AxesClient], setting: str):
    drive = start("-p", f"renewal_endpoints:={DEPARTED}", "-p", setting)
    first = writers(drive)
    leave(drive)
    until = time.monotonic() + NO_RENEWAL_S
    while time.monotonic() < until:
        assert writers(drive) == first
        time.sleep(0.05)


def test_a_shutdown_during_a_renewal_removes_both_participants(start: Callable[..., AxesClient]):
    drive = start("-p", f"renewal_endpoints:={DEPARTED}")
    process = drive.process
    leave(drive)
    drive.wait_for(lambda: len(writers(drive)) == 2, RENEWAL_S, "second participant")
    assert process.stop(signal.SIGTERM) == 0
    # The process has ended; wait_for() would report that.
    until = time.monotonic() + GONE_S
    while drive.is_in_graph() or writers(drive):
        assert time.monotonic() < until
        time.sleep(0.02)


def test_a_peer_that_is_not_discovered_again_is_not_lost(start: Callable[..., AxesClient], tmp_path: Path):
    """A stopped process is not discovered by the new participant; the present one is kept, with its samples."""
    drive = start("-p", f"renewal_endpoints:={DEPARTED}")
    first = writers(drive)
    with Participant(drive.process.domain_id, "listen", "/joint_states", 100, lease=600, folder=tmp_path) as listener:
        listener.stop()
        leave(drive)
        line = "the DDS participant is not renewed"
        drive.wait_for(lambda: line in drive.process.output(), 60 + RENEWAL_S, "failed renewal")
        drive.wait_for(lambda: writers(drive) == first, 10, "end of the second participant")
        assert "remote endpoints were not discovered again within 60 s" in drive.process.output()
        listener.resume()
        until = drive.now() + NANOSECONDS
        drive.wait_for(lambda: listener.stamps()[-1] > until, 20, "samples of the process that continues")
