"""Mode `time: fast`: its /clock, a machine that follows it, a second publisher, and slow subscribers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.context import Context
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from virtual_axes.msg import TrajectoryResult

from motion import swing
from node_process import DomainId, Node
from sim_clock import SimClock
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, status_values, to_ns

DEEP = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE)
LONG = 30.0
"""Duration of a motion that would take long in real time, s."""


def test_fast_outruns_the_wall_clock_on_an_unbroken_grid(start: Callable[..., AxesClient]):
    """Half a minute of motion; the clock and the samples contain each position cycle once."""
    drive = start("-p", "time:=fast")
    ticks: list[int] = []
    drive.node.create_subscription(Clock, "/clock", lambda message: ticks.append(to_ns(message.clock)), DEEP)
    drive.wait_for(lambda: ticks, 10, "tick of the clock")
    began = time.monotonic()
    recording = drive.run(joint_trajectory(["x"], [0.0, LONG], [[0.0], [0.3]]), timeout=60)
    elapsed = time.monotonic() - began
    print(f"{LONG} s of motion, {LONG / elapsed:.1f} times real time")
    assert set(np.diff(recording.joints.stamp)) == {TSP_NS}
    assert len(recording.joints) == LONG * 1e9 / TSP_NS + 1
    end = recording.joints.stamp[-1]
    drive.wait_for(lambda: ticks[-1] >= end, 10, "tick at the end of the motion")
    shown = np.array(ticks)
    shown = shown[(shown >= recording.start) & (shown <= end)]
    np.testing.assert_array_equal(shown, recording.joints.stamp)


def test_an_idle_fast_node_runs_at_wall_clock_rate(start: Callable[..., AxesClient]):
    """The clock of an idle node runs at wall-clock rate."""
    drive = start("-p", "time:=fast")
    before, began = drive.now(), time.monotonic()
    time.sleep(1.0)
    shown, passed = (drive.now() - before) / 1e9, time.monotonic() - began
    # Slower on a busy machine, never faster.
    assert 0 < shown < 1.5 * passed


def machine(stack: ExitStack, name: str, domain: DomainId, *ros_args: str) -> AxesClient:
    """Starts a machine with its own name in a shared domain and returns its AxesClient."""
    arguments = ["-r", f"__ns:=/{name}", *(ros_args or ("-p", "time:=fast"))]
    process = stack.enter_context(Node(arguments, name=f"/{name}/virtual_axes", domain_id=domain.value))
    return stack.enter_context(AxesClient(process=process))


@pytest.fixture
def shared() -> Iterator[tuple[ExitStack, DomainId]]:
    """Yields a domain for several machines, which are stopped in reverse order."""
    domain = DomainId()
    with ExitStack() as stack:
        stack.callback(domain.release)
        yield stack, domain


def assert_unbroken(drive: AxesClient, begin: int, end: int) -> None:
    """Asserts that all position cycles between two times exist, ns."""
    drive.wait_until(end // TSP_NS * TSP_NS, 30)
    stamps = drive.record(begin, end).joints.stamp
    assert np.array_equal(stamps, np.arange(-(-begin // TSP_NS) * TSP_NS, end + 1, TSP_NS))


def test_a_machine_follows_the_clock_of_another(shared: tuple[ExitStack, DomainId]):
    """A machine with use_sim_time computes every position cycle of one in `fast`, which has the only clock."""
    stack, domain = shared
    first = machine(stack, "first", domain)
    second = machine(stack, "second", domain, "-p", "use_sim_time:=true")
    begin = max(drive.now() for drive in (first, second))
    slow = second.accept(joint_trajectory(["y"], [0.0, 1.0], [[0.0], [0.1]]))
    recording = first.run(joint_trajectory(["x"], [0.0, 2.0], [[0.0], [0.3]]))
    assert second.end(slow.sequence_number, 30).status == TrajectoryResult.COMPLETED
    for drive in (first, second):
        assert_unbroken(drive, begin, recording.joints.stamp[-1])
    assert "jumped" not in second.process.output()
    assert first.next_status()["other_clock_publishers"] == "0"


def test_a_second_publisher_of_the_clock_is_an_error(start: Callable[..., AxesClient]):
    """It is logged once with the name of its node, shown in the diagnostics while it exists, and not followed."""
    drive = start("-p", "time:=fast")
    begin = drive.now()
    other = SimClock(drive, begin + 3600 * NANOSECONDS)
    line = f"/clock: node {drive.node.get_fully_qualified_name()} publishes it, too"
    drive.wait_for(lambda: line in drive.process.output(), 10, "error of the second clock")
    assert "use_sim_time:=true" in drive.process.output()

    def status_with(count: str) -> DiagnosticStatus | None:
        found = [array.status[0] for array in drive.diagnostics()[-1:]]
        return next((s for s in found if status_values(s)["other_clock_publishers"] == count), None)

    status = drive.wait_for(lambda: status_with("1"), 5, "diagnostics of the second clock")
    assert status.level == DiagnosticStatus.ERROR and "/clock" in status.message
    other.set(other.now)
    drive.run(joint_trajectory(["x"], *swing(0.6)))
    assert drive.now() < begin + 1800 * NANOSECONDS, "the other clock is not followed"
    assert drive.process.output().count("publishes it, too") == 1
    other.close()
    drive.wait_for(lambda: status_with("0"), 5, "diagnostics after the end of the second clock")


def stalled_at(drive: AxesClient, timeout: float = 60.0) -> int:
    """Returns the number of position cycles at which a slow subscriber has stopped the clock for seconds."""
    seen = len(drive.diagnostics())

    def counts() -> list[str]:
        statuses = [array.status[0] for array in drive.diagnostics()[seen:]][-2:]
        counted = [status_values(status)["position_periods"] for status in statuses]
        is_held = all(status.message == "waiting for a slow subscriber" for status in statuses)
        return counted if len(counted) == 2 and is_held and counted[0] == counted[1] else []

    return int(drive.wait_for(counts, timeout, "stalled clock")[0])


def test_a_slow_subscriber_loses_no_sample(start: Callable[..., AxesClient]):
    """A keep-all subscriber that takes no samples for a while stops the clock, not the services."""
    # Depth of its middleware (5000), of the node's history for it (8192), and a margin.
    instants = 14_000
    drive = start("-p", "time:=fast")
    context = Context()
    rclpy.init(context=context, domain_id=drive.process.domain_id)
    try:
        node = rclpy.create_node("slow", context=context, enable_rosout=False, start_parameter_services=False)
        keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
        slow = node.create_subscription(JointState, "joint_states", lambda _: None, keep_all)

        def take() -> int | None:
            with slow.handle:
                taken = slow.handle.take_message(JointState, False)
            return taken and to_ns(taken[0].header.stamp)

        stamps = [drive.wait_for(take, 10, "joint state")]
        # A free-running clock up to a motion in the future needs little computation.
        end = drive.now() + instants * TSP_NS
        sent = drive.send(joint_trajectory(["x"], *swing(0.3, amplitude=0.01), stamp=end))
        drive.decision(sent)
        stalled = stalled_at(drive)
        assert drive.now() < end and len(drive.results(sent)) == 1, "the motion is active"
        assert drive.get_parameters(["time"]) == {"time": "fast"}
        drive.set_parameters({"y.velocity_loop.gain": 4.4})
        assert stalled_at(drive) == stalled
        end += NANOSECONDS // 2
        deadline = time.monotonic() + 60
        while stamps[-1] < end and time.monotonic() < deadline:
            stamp = take()
            stamps += [stamp] if stamp else []
            if stamp is None or len(stamps) % 20 == 0:
                time.sleep(0.001)
        assert np.array_equal(stamps, np.arange(stamps[0], stamps[-1] + 1, TSP_NS)) and stamps[-1] >= end
        assert drive.end(sent, 20).status == TrajectoryResult.COMPLETED
    finally:
        rclpy.shutdown(context=context)
