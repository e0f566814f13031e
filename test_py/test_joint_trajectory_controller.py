"""The node in place of joint_trajectory_controller: names, services, parameters and rules of its reference page."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from control_msgs.msg import JointTrajectoryControllerState
from control_msgs.srv import QueryTrajectoryState
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import TrajectoryResult as R

from action import Follow, Result, goal, line
from launch_graph import nodes
from motion import go_home
from node_process import Node, node_binary
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, ParameterRejected, joint_trajectory, to_ns, to_time

NAME = "joint_trajectory_controller"
TOPIC = f"/{NAME}/joint_trajectory"
CONSTRAINTS = {
    "constraints.goal_time": 0.5,
    "constraints.stopped_velocity_tolerance": 0.01,
    "constraints.x.trajectory": 0.004,
    "constraints.c.goal": 0.02,
    "cmd_timeout": 3.0,
}
"""Parameters of a controllers file of ros2_control."""


@pytest.fixture(scope="module")
def drive() -> Iterator[AxesClient]:
    """Yields axes that ros2 launch started with jtc_names:=true and the parameters above."""
    [launched] = nodes(
        "virtual_axes.launch.py", name=NAME, jtc_names="true", time="fast", robot_state_publisher="false"
    )
    parameters = [part for name, value in CONSTRAINTS.items() for part in ("-p", f"{name}:={value}")]
    with ExitStack() as stack:
        process = stack.enter_context(Node([*launched.command[1:], *parameters], name=f"/{NAME}"))
        yield stack.enter_context(AxesClient(process=process, remaps=[f"/psec:={TOPIC}"]))


@pytest.fixture(autouse=True)
def at_home(drive: AxesClient) -> None:
    go_home(drive)


@pytest.fixture(scope="module")
def query(drive: AxesClient) -> Iterator[Callable[[int], QueryTrajectoryState.Response]]:
    """Yields a function that calls ~/query_state for a time, ns."""
    client = drive.in_executor(lambda: drive.node.create_client(QueryTrajectoryState, f"{drive.target}/query_state"))

    def call(time: int) -> QueryTrajectoryState.Response:
        future = client.call_async(QueryTrajectoryState.Request(time=to_time(time)))
        drive.wait_for(future.done, 20, "response of query_state")
        return future.result()

    try:
        drive.wait_for(client.service_is_ready, 20, "service query_state")
        yield call
    finally:
        drive.in_executor(lambda: drive.node.destroy_client(client))


def test_the_names_are_those_of_the_controller(drive: AxesClient) -> None:
    node = drive.node
    subscribed = dict(node.get_subscriber_names_and_types_by_node(NAME, "/"))
    published = dict(node.get_publisher_names_and_types_by_node(NAME, "/"))
    services = dict(node.get_service_names_and_types_by_node(NAME, "/"))
    assert subscribed[TOPIC] == ["trajectory_msgs/msg/JointTrajectory"] and "/psec" not in subscribed
    assert subscribed[f"/{NAME}/speed_scaling_input"] == ["control_msgs/msg/SpeedScalingFactor"]
    assert published[f"/{NAME}/controller_state"] == ["control_msgs/msg/JointTrajectoryControllerState"]
    assert services[f"/{NAME}/query_state"] == ["control_msgs/srv/QueryTrajectoryState"]
    assert f"/{NAME}/follow_joint_trajectory/_action/send_goal" in services


def test_a_trajectory_on_the_topic_is_executed_and_shown(drive: AxesClient) -> None:
    states: list[JointTrajectoryControllerState] = []
    subscription = drive.in_executor(
        lambda: drive.node.create_subscription(
            JointTrajectoryControllerState, f"/{NAME}/controller_state", states.append, 10
        )
    )
    number = drive.send(line(["x"], [0.02], 1.0))
    assert drive.end(number, 20).status == R.COMPLETED
    drive.wait_for(lambda: states and states[-1].reference.positions[0] == 0.02, 10, "the end in controller_state")
    drive.in_executor(lambda: drive.node.destroy_subscription(subscription))
    # A trajectory without points stops; axes that are not named continue.
    drive.send(joint_trajectory(["x", "y"], [0, 30], [[0.02, 0], [0.1, 0.1]]))
    stop = drive.send(JointTrajectory(joint_names=["x"]))
    assert drive.end(stop, 20).status == R.COMPLETED
    # The result may arrive before the last sample of the stop.
    drive.wait_until(drive.now() + 2 * TSP_NS, 10)
    before = drive.latest("psec")
    drive.wait_until(drive.now() + 20 * TSP_NS, 10)
    after = drive.latest("psec")
    assert after["x"] == before["x"] and after["y"] > before["y"]


def test_query_state_returns_the_setpoints_planned_at_a_time(
    drive: AxesClient, query: Callable[[int], QueryTrajectoryState.Response]
) -> None:
    response = query(drive.now())
    assert (response.success, response.message) == (False, "no trajectory is active or waiting")
    assert dict(zip(response.name, response.position, strict=True)) == drive.latest("psec")
    # It starts in 3 s of simulated time, of which little passes meanwhile, as the axes are at rest.
    start = drive.now() // TSP_NS * TSP_NS + 3 * NANOSECONDS
    trajectory = line(["x", "a"], [0.05, 0.3], 1.0)
    trajectory.header.stamp = to_time(start)
    number = drive.send(trajectory)
    drive.decision(number)
    middle = query(start + NANOSECONDS // 2)
    state = dict(zip(middle.name, zip(middle.position, middle.velocity, middle.acceleration, strict=True), strict=True))
    # A quintic from rest to rest: half of the way, 15/8 of the mean speed, no acceleration. The time is rounded up to a
    # position cycle, by at most 6 ms.
    assert middle.success and set(state) == set("xyzac")
    assert state["x"][0] == pytest.approx(0.025, abs=0.05 * 15 / 8 * 0.006)
    assert state["a"][1] == pytest.approx(0.3 * 15 / 8, rel=1e-3)
    assert state["y"] == (0, 0, 0)
    for outside in (start - NANOSECONDS, start + 2 * NANOSECONDS):
        found = query(outside)
        assert not found.success and "no trajectory commands a joint at" in found.message
    ended = drive.end(number, 30)
    drive.wait_until(to_ns(ended.header.stamp), 20)
    states = drive.record(start, start + NANOSECONDS).states
    row = int(np.flatnonzero(states.stamp >= start + NANOSECONDS // 2)[0])
    assert states["psec", "x"][row] == pytest.approx(state["x"][0], abs=1e-15)


def test_parameter_file_of_a_controller_is_accepted(tmp_path: Path) -> None:
    file = tmp_path / "controllers.yaml"
    file.write_text(
        f"""
controller_manager:
  ros__parameters: {{update_rate: 500}}
{NAME}:
  ros__parameters:
    joints: [x, y, z, a, c]
    command_interfaces: [position]
    state_interfaces: [position, velocity]
    allow_partial_joints_goal: true
    interpolate_from_desired_state: true
    allow_integration_in_goal_trajectories: false
    constraints:
      goal_time: 0.25
      y: {{trajectory: 0.05, goal: 0.003}}
"""
    )
    arguments = ["--ros-args", "--params-file", str(file), "-r", f"__node:={NAME}", "-p", "time:=fast"]
    with Node(arguments, name=f"/{NAME}") as process, AxesClient(process=process) as axes:
        found = axes.get_parameters(["joints", "constraints.y.goal", "y.tolerances.path_mm", "goal_time_tolerance"])
        assert found.pop("joints") == ["x", "y", "z", "a", "c"]
        expected = {"constraints.y.goal": 0.003, "y.tolerances.path_mm": 50.0, "goal_time_tolerance": 0.25}
        assert found == pytest.approx(expected)


def test_parameters_are_accepted_under_their_names(drive: AxesClient) -> None:
    found = drive.get_parameters([*CONSTRAINTS, "x.tolerances.path_mm", "goal_time_tolerance"])
    assert found == pytest.approx(CONSTRAINTS | {"x.tolerances.path_mm": 4.0, "goal_time_tolerance": 0.5})
    drive.set_parameters({"constraints.x.trajectory": 0.005})
    assert drive.get_parameters(["x.tolerances.path_mm"]) == pytest.approx({"x.tolerances.path_mm": 5.0})
    drive.set_parameters({"constraints.x.trajectory": CONSTRAINTS["constraints.x.trajectory"]})


@pytest.mark.parametrize(
    "parameter, words",
    [
        ("constraints.q.goal:=0.1", ["constraints.q.goal", "JOINT.goal with a joint of this machine"]),
        (
            "constraints.x.goal:=-0.1",
            ["constraints.x.goal = -0.1", "must be 0 (no tolerance) or a positive number of m"],
        ),
        ("interpolation_method:=cubic", ["interpolation_method = cubic", "must be splines or none"]),
    ],
)
def test_other_values_and_parameters_are_rejected(parameter: str, words: list[str]) -> None:
    ended = subprocess.run(
        [node_binary(), "--ros-args", "-p", parameter], capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 2
    assert all(word in ended.stderr for word in words), ended.stderr


def test_values_of_a_controller_that_the_node_cannot_follow_are_ignored() -> None:
    """A warning for each; at run time they are rejected."""
    parameters = {
        "command_interfaces:=[velocity]": "command_interfaces = [velocity]: must be [position]",
        "allow_partial_joints_goal:=false": "allow_partial_joints_goal = false: must be true",
        "gains.x.p:=2.0": "gains.x.p = 2: must be omitted",
    }
    arguments = [word for parameter in parameters for word in ("-p", parameter)]
    with Node(arguments) as process, AxesClient(process=process) as axes:
        assert [text for text in parameters.values() if f"-p: {text}" not in process.output()] == []
        with pytest.raises(ParameterRejected, match="must be true: axes that a trajectory does not name continue"):
            axes.set_parameters({"allow_partial_joints_goal": False})


def test_tolerances_of_goals_have_their_meaning(drive: AxesClient) -> None:
    with Follow(drive) as follow:
        assert follow.send(goal(line(["x", "c"], [0.02, 0.1], 1.0))).result().error_code == Result.SUCCESSFUL
        go_home(drive)
        drive.set_parameters({"constraints.x.trajectory": 1e-6})
        ended = follow.send(goal(line(["x"], [0.1], 0.8))).ended()
        drive.set_parameters({"constraints.x.trajectory": CONSTRAINTS["constraints.x.trajectory"]})
        assert (ended.status, ended.result.error_code) == (
            GoalStatus.STATUS_ABORTED,
            Result.PATH_TOLERANCE_VIOLATED,
        )
        go_home(drive)
        # The axes still settle when the last setpoint arrives: the velocity is not yet within a nm/s.
        drive.set_parameters({"constraints.stopped_velocity_tolerance": 1e-12, "constraints.goal_time": 0.01})
        ended = follow.send(goal(line(["x"], [0.1], 0.8))).ended()
        drive.set_parameters(
            {name: CONSTRAINTS[name] for name in ("constraints.stopped_velocity_tolerance", "constraints.goal_time")}
        )
        assert ended.result.error_code == Result.GOAL_TOLERANCE_VIOLATED
        assert "velocity" in ended.result.error_string


def test_a_goal_without_goal_time_ends_at_the_timeout(drive: AxesClient) -> None:
    with Follow(drive) as follow:
        # The axis oscillates by rounding about its last setpoint: no error is this small. −1 is an unlimited goal time.
        sent = follow.send(goal(line(["x"], [0.01], 0.5), end={"x": 1e-300}, end_time=-1.0))
        ended = sent.ended(60)
        assert ended.result.error_code == Result.GOAL_TOLERANCE_VIOLATED
    results = [result for result in drive.results() if bytes(result.goal_id) == sent.id]
    waited = to_ns(results[-1].header.stamp) - to_ns(results[0].start)
    # 0.5 s of motion, the delay of the drive, and 3 s.
    assert 3.5 <= waited / NANOSECONDS < 3.6


def test_without_interpolation_the_setpoint_is_the_next_point() -> None:
    with (
        Node(["-p", "time:=fast", "-p", "interpolation_method:=none"]) as process,
        AxesClient(process=process) as drive,
    ):
        times = np.array([4, 8, 12]) * TSP_NS / NANOSECONDS
        recording = drive.run(joint_trajectory(["x"], times, [0.001, 0.002, 0.001]), settle=0.05)
        psec = recording.states["psec", "x"][:15]
        assert psec.tolist() == [0.0] * 4 + [0.001] + [0.002] * 4 + [0.001] * 6
        far = drive.decision(drive.send(joint_trajectory(["x"], times, [0.001, 0.009, 0.001])))
        assert (far.status, far.code, far.point_index) == (R.REJECTED, R.SPEED, 1)


def test_a_continuous_axis_counts_its_turns(drive: AxesClient) -> None:
    """C is absolute; a trajectory moves by the whole turns that bring its beginning to the axis."""
    turn = 2 * np.pi
    drive.run(line(["c"], [3.0], 4.0))
    # −3 rad is reached by 6 rad backwards, not by 0.28 rad ahead, and 3 + 2π by a whole turn ahead.
    recording = drive.run(joint_trajectory(["c"], [0, 8], [3.0, -3.0], [0, 0]))
    assert np.all(np.diff(recording.states["psec", "c"]) <= 0)
    recording = drive.run(joint_trajectory(["c"], [0, 14], [-3.0, 3.0 + turn], [0, 0]), settle=1.0)
    assert recording.states["position", "c"][-1] == pytest.approx(3.0 + turn, abs=1e-4)
    # A planner that wraps to ±π begins a turn away; another counts from any turn.
    for begin, turns in [(3.0, 1), (3.1 - 5 * turn, 6)]:
        recording = drive.run(joint_trajectory(["c"], [0, 1], [begin, begin + 0.1], [0, 0]), settle=1.0)
        assert recording.states["psec", "c"][-1] == pytest.approx(begin + 0.1 + turns * turn, abs=1e-12)
    # A later first point is an absolute angle. A beginning between turns is a jump.
    recording = drive.run(joint_trajectory(["c"], [12], [3.0], [0]), settle=1.0)
    assert recording.states["psec", "c"][-1] == 3.0
    far = drive.decision(drive.send(joint_trajectory(["c"], [0, 1], [turn, turn], [0, 0])))
    assert (far.status, far.code, far.joint) == (R.REJECTED, R.JUMP, "c")
    assert far.value == pytest.approx(3.0, abs=1e-3)
    # A linear axis has no turns.
    assert drive.decision(drive.send(joint_trajectory(["x"], [0, 1], [turn, turn], [0, 0]))).status == R.REJECTED
