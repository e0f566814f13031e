"""Managed node (`--lifecycle`): services of the lifecycle, from rclpy."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory
from lifecycle_msgs.msg import State, Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.action import ActionClient
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import TrajectoryResult as R

from motion import go_home
from node_process import DEFAULT_NODE, Node, node_binary
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory
from virtual_axes_py.ros.services import ParameterRejected

GAIN = "x.position_loop.gain"
PREFIX = "joint_prefix"


class Manager(AxesClient):
    """Client of the lifecycle services."""

    def __init__(self, process: Node) -> None:
        super().__init__(process=process, connect=False, keep_samples=False)
        self.events: list[TransitionEvent] = []
        topic = f"{DEFAULT_NODE}/transition_event"
        self.in_executor(lambda: self.node.create_subscription(TransitionEvent, topic, self._keep(self.events), 10))

    def state(self) -> int:
        """Returns the number of the state."""
        return self.call(GetState, "get_state", GetState.Request(), timeout=20).current_state.id

    def change(self, transition: int | str, timeout: float = 20) -> bool:
        """Requests a transition by its number or label."""
        label = transition if isinstance(transition, str) else ""
        number = 0 if isinstance(transition, str) else transition
        request = ChangeState.Request(transition=Transition(id=number, label=label))
        return self.call(ChangeState, "change_state", request, timeout=timeout).success

    def clean_up(self) -> None:
        """Requests the transition cleanup; the participant that serves from then on responds."""
        assert self.change("cleanup")
        assert self.state() == State.PRIMARY_STATE_UNCONFIGURED

    def available(self, service: str = "get_available_transitions") -> list[tuple[int, str, str, str]]:
        """Returns number, label, start and goal of transitions."""
        rows = self.call(GetAvailableTransitions, service, GetAvailableTransitions.Request()).available_transitions
        return [(row.transition.id, row.transition.label, row.start_state.label, row.goal_state.label) for row in rows]

    def expect_events(self, *pairs: tuple[str, str]) -> None:
        """Waits for beginnings and ends of transitions: start and goal of each; then forgets them."""

        def seen() -> list[tuple[str, str]]:
            return [(event.start_state.label, event.goal_state.label) for event in self.events]

        self.wait_for(lambda: seen() == list(pairs), 10, f"events {pairs}")
        self.events.clear()


@pytest.fixture(scope="module")
def process() -> Iterator[Node]:
    """Yields a node in the state unconfigured."""
    with Node(["-p", "time:=real", "--", "--lifecycle"]) as process:
        yield process


@pytest.fixture
def manager(process: Node) -> Iterator[Manager]:
    """Yields a client, with the node brought back to unconfigured before and after."""
    with Manager(process) as manager:
        topic = f"{DEFAULT_NODE}/transition_event"
        manager.wait_for(lambda: manager.node.count_publishers(topic), 20, topic)
        assert manager.state() == State.PRIMARY_STATE_UNCONFIGURED
        yield manager
        if manager.state() == State.PRIMARY_STATE_ACTIVE:
            assert manager.change("deactivate")
        if manager.state() == State.PRIMARY_STATE_INACTIVE:
            manager.clean_up()


@contextlib.contextmanager
def operating(process: Node, manager: Manager) -> Iterator[AxesClient]:
    """Configures and activates the node, and yields a client of its topics."""
    assert manager.change("configure") and manager.change("activate")
    with AxesClient(process=process) as drive:
        yield drive


def test_states_and_transitions_are_the_standard_ones(manager: Manager) -> None:
    """Numbers and labels are those of rcl_lifecycle, which are constants of lifecycle_msgs."""
    states = manager.call(GetAvailableStates, "get_available_states", GetAvailableStates.Request()).available_states
    named = {name.split("_STATE_")[1]: value for name, value in vars(State).items() if "_STATE_" in name}
    named |= {name.split("_STATE_")[1]: getattr(State, name) for name in dir(State) if "_STATE_" in name}
    assert {state.id: state.label.upper() for state in states} == {value: name for name, value in named.items()}
    graph = manager.available("get_transition_graph")
    assert len(graph) == len({row[0] for row in graph}) == 25
    assert manager.available() == [
        (Transition.TRANSITION_CONFIGURE, "configure", "unconfigured", "configuring"),
        (Transition.TRANSITION_UNCONFIGURED_SHUTDOWN, "shutdown", "unconfigured", "shuttingdown"),
    ]
    assert not manager.change("activate") and not manager.change(Transition.TRANSITION_CLEANUP)
    assert not manager.change(99) and not manager.change("launch")
    assert manager.state() == State.PRIMARY_STATE_UNCONFIGURED


def test_first_request_of_a_new_client_is_served_at_once(process: Node, manager: Manager) -> None:
    """The heartbeat that repeats a request which was sent before it was matched comes 3 s later."""
    times: list[float] = []
    for _ in range(5):
        with AxesClient(process=process, connect=False, keep_samples=False) as client:
            # Other endpoints make the discovery of the client longer.
            client.in_executor(
                lambda: [client.node.create_subscription(JointState, f"other_{n}", print, 10) for n in range(4)]
            )
            service = client.in_executor(lambda: client.node.create_client(GetState, f"{DEFAULT_NODE}/get_state"))
            client.in_executor(lambda: ActionClient(client.node, FollowJointTrajectory, "other_action"))
            client.wait_for(service.service_is_ready, 20, "service get_state")
            begin = time.monotonic()
            future = service.call_async(GetState.Request())
            client.wait_for(future.done, 20, "response of get_state")
            times.append(time.monotonic() - begin)
    assert sorted(times)[2] < 1.5, times


def test_the_life_of_a_node(process: Node, manager: Manager) -> None:
    """Samples are published and trajectories accepted in the state active alone."""
    topics = dict(manager.node.get_topic_names_and_types())
    assert "/joint_states" not in topics
    assert manager.change(Transition.TRANSITION_CONFIGURE)
    assert manager.state() == State.PRIMARY_STATE_INACTIVE
    manager.expect_events(("unconfigured", "configuring"), ("configuring", "inactive"))
    samples: list[JointState] = []
    manager.in_executor(
        lambda: manager.node.create_subscription(JointState, "/joint_states", manager._keep(samples), 10)
    )
    manager.wait_for(lambda: manager.node.count_publishers("/joint_states"), 10, "joint_states")
    with pytest.raises(TimeoutError):
        manager.wait_for(lambda: samples, 1.0, "a sample")
    assert manager.change("activate")
    manager.expect_events(("inactive", "activating"), ("activating", "active"))
    with AxesClient(process=process) as drive:
        recording = drive.run(joint_trajectory(["x"], [1.0], [[0.05]], [[0.0]]))
        assert recording.result.status == R.COMPLETED
        assert manager.available()[0][1] == "deactivate"
        assert manager.change("deactivate") and manager.state() == State.PRIMARY_STATE_INACTIVE
        manager.expect_events(("active", "deactivating"), ("deactivating", "inactive"))
        last = drive.now()
        decision = drive.decision(drive.send(joint_trajectory(["x"], [1.0], [[0.01]])))
        assert (decision.status, decision.code) == (R.REJECTED, R.NOT_ACTIVE)
        assert "change_state" in decision.text
        # Samples on the way may still arrive.
        assert drive.next_status() and drive.now() <= last + 2 * TSP_NS
        assert manager.change("activate")
        drive.wait_until(last + NANOSECONDS // 2, 10)
        # The axes have stayed where they were.
        assert drive.latest("psec")["x"] == 0.05
        go_home(drive)


def test_with_its_own_clock_the_time_goes_on_while_inactive() -> None:
    with Node(["-p", "time:=fast", "--", "--lifecycle"]) as process, Manager(process) as manager:
        with operating(process, manager) as drive:
            before = drive.now()
            assert manager.change("deactivate")
            assert drive.decision(drive.send(joint_trajectory(["x"], [1.0], [[0.01]]))).code == R.NOT_ACTIVE
            assert manager.change("activate")
            recording = drive.run(joint_trajectory(["x"], [1.0], [[0.0]], [[0.0]]))
            assert recording.result.status == R.COMPLETED and drive.now() > before + NANOSECONDS
        assert process.stop() == 0


def test_a_deactivation_stops_within_the_limits(process: Node, manager: Manager) -> None:
    with operating(process, manager) as drive:
        go_home(drive)
        moving = drive.accept(joint_trajectory(["x"], [3.0], [[0.3]], [[0.0]]))
        start = drive.now()
        drive.wait_until(start + 200 * TSP_NS, 10)
        assert manager.change("deactivate")
        assert drive.end(moving.sequence_number, 10).status == R.STOPPED
        psec = drive.record(start, drive.now()).states["psec", "x"]
        assert 0.01 < psec[-1] < 0.29 and np.ptp(psec[-2:]) == 0
        assert np.abs(np.diff(psec, 2)).max() <= 2.5 * 0.006**2 * (1 + 1e-6)


def test_every_parameter_can_be_set_before_configuration(process: Node, manager: Manager) -> None:
    """A parameter that is not live, too; a cleanup returns to the values of the start."""
    start = manager.get_parameters([GAIN, PREFIX])
    with pytest.raises(ParameterRejected, match=GAIN):
        manager.set_parameters({GAIN: -1.0})
    manager.set_parameters({GAIN: 7.5, PREFIX: "mill_"})
    with operating(process, manager) as drive:
        assert set(drive.latest("position")) == {f"mill_{axis}" for axis in "xyzac"}
        assert drive.get_parameters([GAIN, PREFIX]) == {GAIN: 7.5, PREFIX: "mill_"}
        with pytest.raises(ParameterRejected, match="while the node runs"):
            manager.set_parameters({PREFIX: ""})
    assert manager.change("deactivate")
    manager.clean_up()
    assert manager.get_parameters([GAIN, PREFIX]) == start


def test_configuration_reads_the_file_again_and_can_fail(tmp_path: Path) -> None:
    """An invalid machine leaves the node unconfigured, with the reason in the log."""
    text = subprocess.run(
        [node_binary().with_name("virtual_axes"), "machines", "--show", "mikron_ucp710"],
        check=True,
        capture_output=True,
        text=True,
        timeout=30,
    ).stdout
    file = tmp_path / "machine.yaml"
    file.write_text(text)
    with Node(["--params-file", str(file), "--", "--lifecycle"]) as process, Manager(process) as manager:
        assert manager.state() == State.PRIMARY_STATE_UNCONFIGURED
        file.write_text(text.replace("gain", "gian"))
        assert not manager.change("configure")
        assert manager.state() == State.PRIMARY_STATE_UNCONFIGURED
        manager.wait_for(lambda: "not configured" in process.output(), 20, "the error in the log")
        assert str(file) in process.output()
        file.write_text(text)
        assert manager.change("configure")
        assert manager.state() == State.PRIMARY_STATE_INACTIVE
        assert manager.change("shutdown")
        assert manager.state() == State.PRIMARY_STATE_FINALIZED
        assert manager.available() == [] and not manager.change("activate")
        assert process.stop() == 0


def test_an_unconfigured_node_shuts_down_and_ends() -> None:
    with Node(["--", "--lifecycle"]) as process, Manager(process) as manager:
        assert manager.change(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
        assert manager.state() == State.PRIMARY_STATE_FINALIZED
        assert process.stop() == 0


def test_the_response_to_a_cleanup_reaches_a_new_client_and_the_next_request_is_served(manager: Manager) -> None:
    for _ in range(4):
        assert manager.change("configure")
        with Manager(manager.process) as client:
            assert client.change("cleanup", timeout=15)
            assert client.change("configure", timeout=15)
        manager.clean_up()


def test_a_signal_ends_the_process_during_a_transition() -> None:
    """A deactivation does not end while the clock stands still."""
    with Node(["-p", "use_sim_time:=true", "--", "--lifecycle"]) as process, Manager(process) as manager:
        assert manager.change("configure") and manager.change("activate")
        clock = manager.in_executor(lambda: manager.node.create_publisher(Clock, "/clock", 10))
        psec = manager.in_executor(lambda: manager.node.create_publisher(JointTrajectory, "/psec", 10))
        for publisher in (clock, psec):
            manager.wait_for(publisher.get_subscription_count, 20, publisher.topic_name)
        start = 10 * NANOSECONDS
        for k in range(3):
            clock.publish(Clock(clock=Time(nanoseconds=start + k * TSP_NS).to_msg()))
            time.sleep(0.1)
        psec.publish(joint_trajectory(["x"], [3.0], [[0.1]]))
        manager.wait_for(lambda: "trajectory 1 of psec accepted" in process.output(), 20, "acceptance")
        for k in range(3, 60):
            clock.publish(Clock(clock=Time(nanoseconds=start + k * TSP_NS).to_msg()))
        service = manager.in_executor(lambda: manager.node.create_client(ChangeState, f"{DEFAULT_NODE}/change_state"))
        manager.wait_for(service.service_is_ready, 20, "service change_state")
        service.call_async(ChangeState.Request(transition=Transition(label="deactivate")))
        manager.wait_for(lambda: manager.state() == State.TRANSITION_STATE_DEACTIVATING, 8, "deactivating")
        assert process.stop(signal.SIGTERM, timeout=5) == 0
