"""Mode `time: fast`: its /clock, the common clock of several machines, and slow subscribers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import numpy as np
import pytest
import rclpy
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


def node(stack: ExitStack, name: str, domain: DomainId, *ros_args: str) -> Node:
    """Starts the process of a machine with its own name in a shared domain."""
    arguments = ["-r", f"__ns:=/{name}", *(ros_args or ("-p", "time:=fast"))]
    return stack.enter_context(Node(arguments, name=f"/{name}/virtual_axes", domain_id=domain.value))


def machine(stack: ExitStack, name: str, domain: DomainId, *ros_args: str) -> AxesClient:
    """Starts a machine in a shared domain and returns its AxesClient."""
    return stack.enter_context(AxesClient(process=node(stack, name, domain, *ros_args)))


def wait_for_topics(process: Node) -> None:
    """Waits until all topics of a node exist: docs/internals/middleware.md, "Processes that start at the same time"."""
    deadline = time.monotonic() + 20
    while "Ctrl-C" not in process.output():
        assert time.monotonic() < deadline, process.output()
        time.sleep(0.02)


class Ticks:
    """Messages on /clock, in order of arrival."""

    def __init__(self, drive: AxesClient):
        """Subscribes with the node of a AxesClient."""
        self.shown: list[int] = []
        self._drive = drive
        drive.node.create_subscription(Clock, "/clock", lambda message: self.shown.append(to_ns(message.clock)), DEEP)
        drive.wait_for(lambda: self.shown, 10, "tick of the clock")

    def since(self, begin: int) -> np.ndarray:
        """Returns the messages from index `begin` on, after at least one has arrived."""
        self._drive.wait_for(lambda: len(self.shown) > begin + 10, 10, "ticks of the clock")
        return np.array(self.shown[begin:])


@pytest.fixture
def shared() -> Iterator[tuple[ExitStack, DomainId]]:
    """Yields a domain for several machines, which are stopped in reverse order."""
    domain = DomainId()
    with ExitStack() as stack:
        stack.callback(domain.release)
        yield stack, domain


def leads(drive: AxesClient) -> bool:
    """Returns true if a machine publishes the clock, by its log."""
    lines = [line for line in drive.process.output().splitlines() if "/clock:" in line]
    return bool(lines) and lines[-1].endswith("publishing it")


def assert_unbroken(drive: AxesClient, begin: int, end: int) -> None:
    """Asserts that all position cycles between two times exist, ns."""
    drive.wait_until(end // TSP_NS * TSP_NS, 30)
    stamps = drive.record(begin, end).joints.stamp
    assert np.array_equal(stamps, np.arange(-(-begin // TSP_NS) * TSP_NS, end + 1, TSP_NS))


def test_the_second_machine_follows_the_first_and_then_publishes(shared: tuple[ExitStack, DomainId]):
    """Two machines and a third that only follows have one clock, which never goes back."""
    stack, domain = shared
    with ExitStack() as first_life:
        first = machine(first_life, "first", domain)
        second = machine(stack, "second", domain)
        third = machine(stack, "third", domain, "-p", "use_sim_time:=true")
        ticks = Ticks(third)
        assert leads(first) and not leads(second)
        begin = max(drive.now() for drive in (first, second, third))
        # The first machine has a command and runs as fast as possible; the others follow.
        slow = second.accept(joint_trajectory(["y"], [0.0, 1.0], [[0.0], [0.1]]))
        recording = first.run(joint_trajectory(["x"], [0.0, 2.0], [[0.0], [0.3]]))
        assert second.end(slow.sequence_number, 30).status == TrajectoryResult.COMPLETED
        for drive in (first, second, third):
            assert_unbroken(drive, begin, recording.joints.stamp[-1])
        # While the first machine is idle, a trajectory of the second runs at wall-clock rate.
        began = time.monotonic()
        second.run(joint_trajectory(["y"], [0.0, 0.6], [[0.1], [0.1]]))
        assert time.monotonic() - began > 0.4
        before = second.now()
    count = len(ticks.shown)
    second.wait_for(lambda: leads(second), 10, "second machine that publishes the clock")
    second.run(joint_trajectory(["y"], [0.0, 1.0], [[0.1], [0.0]]))
    ticks.since(count)
    shown = np.array(ticks.shown)
    assert np.all(np.diff(shown) > 0), "the clock never goes back or repeats"
    for drive in (second, third):
        assert_unbroken(drive, before, second.now() - NANOSECONDS // 10)
    assert not any("jumped" in drive.process.output() for drive in (second, third))


def test_of_machines_that_start_together_one_leads(shared: tuple[ExitStack, DomainId]):
    """The ids of the machines decide which one publishes."""
    stack, domain = shared
    processes = [node(stack, name, domain) for name in ("left", "right")]
    for process in processes:
        wait_for_topics(process)
    both = [stack.enter_context(AxesClient(process=process)) for process in processes]
    both[0].wait_for(lambda: sum(map(leads, both)) == 1, 5, "one machine that publishes the clock")
    ticks = Ticks(both[0])
    count = len(ticks.shown)
    time.sleep(0.3)
    assert np.all(np.diff(ticks.since(count)) > 0)
    assert sum(map(leads, both)) == 1


def test_an_external_clock_is_followed(start: Callable[..., AxesClient]):
    """Another publisher of /clock has priority; after it has left, the machine continues from its own time."""
    drive = start("-p", "time:=fast")
    ticks = Ticks(drive)
    begin = -(-(drive.now() + 2 * NANOSECONDS) // TSP_NS) * TSP_NS
    other = SimClock(drive, begin)
    drive.wait_for(lambda: "another node publishes it" in drive.process.output(), 10, "log of the other clock")
    other.reach(begin)
    count = len(ticks.shown)
    times, position = swing(0.6)
    sent = drive.send(joint_trajectory(["x"], times, position))
    drive.decision(sent)
    time.sleep(0.2)
    assert drive.now() == begin, "another clock has advanced"
    other.advance(1.0, 0.05)
    assert drive.end(sent, 5).status == TrajectoryResult.COMPLETED
    own = set(range(begin, other.now + 1, TSP_NS)) - set(ticks.shown[:count])
    published = len(ticks.shown) - count
    assert published <= 21 < len(own), "the machine no longer publishes"
    other.close()
    drive.wait_for(lambda: drive.now() > other.now + NANOSECONDS // 10, 10, "own clock")
    assert_unbroken(drive, begin, drive.now() - NANOSECONDS // 20)


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
