"""Client of the node's action FollowJointTrajectory.

    with Node(["-p", "time:=fast"]) as process, AxesClient(process=process) as drive, Follow(drive) as follow:
        sent = follow.send(goal(joint_trajectory(["x"], [0, 1], [0, 0.1])))
        print(sent.result().error_string)

Every wait is bounded and raises TimeoutError.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from action_msgs.msg import GoalInfo, GoalStatusArray
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Duration, Time
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from trajectory_msgs.msg import JointTrajectory
from unique_identifier_msgs.msg import UUID
from virtual_axes.msg import TrajectoryResult

from virtual_axes_py.ros import NANOSECONDS, SETTLE_S, AxesClient, joint_trajectory

Result = FollowJointTrajectory.Result
FEEDBACK_QOS = QoSProfile(depth=1000)
"""Queue depth of feedback and results, sufficient for a node in `fast` while this process is busy."""
STATUS_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def goal(
    trajectory: JointTrajectory,
    path: Mapping[str, float] | None = None,
    end: Mapping[str, float] | None = None,
    end_time: float = 0.0,
) -> FollowJointTrajectory.Goal:
    """Returns a goal with position tolerances `path` and `end` by joint (m, rad) and time tolerance `end_time`, s."""

    def tolerances(values: Mapping[str, float] | None) -> list[JointTolerance]:
        return [JointTolerance(name=name, position=value) for name, value in (values or {}).items()]

    seconds, nanoseconds = divmod(round(end_time * NANOSECONDS), NANOSECONDS)
    return FollowJointTrajectory.Goal(
        trajectory=trajectory,
        path_tolerance=tolerances(path),
        goal_tolerance=tolerances(end),
        goal_time_tolerance=Duration(sec=seconds, nanosec=nanoseconds),
    )


class Sent:
    """Goal that was sent, with the responses so far."""

    def __init__(self, follow: Follow, message: Any, uuid: UUID | None):
        """Sends the goal."""
        drive = follow.drive
        self._drive = drive
        self._follow = follow
        self._accepting = drive.in_executor(lambda: follow.client.send_goal_async(message, goal_uuid=uuid))

    @property
    def feedback(self) -> list[Any]:
        """Returns the feedback so far."""
        id = self.id
        return [message.feedback for message in list(self._follow.feedback) if bytes(message.goal_id.uuid) == id]

    @property
    def handle(self) -> Any:
        """Returns the client's goal handle, after the node has responded."""
        self._drive.wait_for(self._accepting.done, 20.0, "response to a goal")
        return self._accepting.result()

    @property
    def id(self) -> bytes:
        """Returns the goal id."""
        return bytes(self.handle.goal_id.uuid)

    def ask(self) -> Any:
        """Requests status and result; returns a future."""
        handle = self.handle
        return self._drive.in_executor(handle.get_result_async)

    def ended(self, timeout: float = 30.0) -> Any:
        """Waits for status and result."""
        future = self.ask()
        self._drive.wait_for(future.done, timeout, "result of a goal")
        return future.result()

    def status(self, timeout: float = 30.0) -> int:
        """Returns the final status, action_msgs/GoalStatus."""
        return self.ended(timeout).status

    def result(self, timeout: float = 30.0) -> Any:
        """Returns the result."""
        return self.ended(timeout).result

    def wait_for_feedback(self, count: int = 1, timeout: float = 20.0) -> Any:
        """Waits for `count` feedback messages and returns the newest."""
        self._drive.wait_for(lambda: len(self.feedback) >= count, timeout, "feedback")
        return self.feedback[-1]

    def cancel(self) -> CancelGoal.Response:
        """Requests cancellation."""
        handle = self.handle
        future = self._drive.in_executor(handle.cancel_goal_async)
        self._drive.wait_for(future.done, 20.0, "response to a cancel request")
        return future.result()


class Follow:
    """Action client in the graph, part of a AxesClient."""

    def __init__(
        self, drive: AxesClient, name: str | None = None, timeout: float = 20.0, kind: Any = FollowJointTrajectory
    ):
        """Waits for the server of an action of type `kind`; `name` is the action's remapped name."""
        self.name = name or f"{drive.target}/follow_joint_trajectory"
        self.drive = drive
        self.statuses: list[GoalStatusArray] = []
        self.client = ActionClient(drive.node, kind, self.name)
        # Own subscriptions: the client drops a finished goal and the messages for it that are still in transit.
        self.feedback: list[Any] = []
        self._feedback = drive.node.create_subscription(
            kind.Impl.FeedbackMessage,
            f"{self.name}/_action/feedback",
            self.feedback.append,
            FEEDBACK_QOS,
        )
        self._canceling = drive.node.create_client(CancelGoal, f"{self.name}/_action/cancel_goal")
        self._statuses = drive.node.create_subscription(
            GoalStatusArray, f"{self.name}/_action/status", self.statuses.append, STATUS_QOS
        )
        drive.wait_for(self.client.server_is_ready, timeout, f"action {self.name}")
        drive.wait_for(self._canceling.service_is_ready, timeout, f"cancellation of {self.name}")
        time.sleep(SETTLE_S)

    def __enter__(self) -> Follow:
        """Returns itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Destroys the client; the AxesClient stays connected."""

        def leave() -> None:
            self.client.destroy()
            self.drive.node.destroy_subscription(self._feedback)
            self.drive.node.destroy_client(self._canceling)
            self.drive.node.destroy_subscription(self._statuses)

        self.drive.in_executor(leave)

    def send(self, message: Any, uuid: bytes | None = None) -> Sent:
        """Sends a goal, with a given id if `uuid` is set."""
        return Sent(self, message, UUID(uuid=list(uuid)) if uuid else None)

    def cancel(self, uuid: bytes = bytes(16), stamp: Time | None = None) -> CancelGoal.Response:
        """Cancels goals by the rules of action_msgs/CancelGoal."""
        info = GoalInfo(goal_id=UUID(uuid=list(uuid)), stamp=stamp or Time())
        future = self._canceling.call_async(CancelGoal.Request(goal_info=info))
        self.drive.wait_for(future.done, 20.0, "response to a cancel request")
        return future.result()

    def status_of(self, uuid: bytes) -> int | None:
        """Returns the newest status of a goal on the status topic."""
        listed = self.statuses[-1].status_list if self.statuses else []
        return next((entry.status for entry in listed if bytes(entry.goal_info.goal_id.uuid) == uuid), None)


def line(names: list[str], to: list[float], duration: float) -> JointTrajectory:
    """Returns a quintic from home to `to`, at rest at both ends."""
    rest = [[0.0] * len(names)] * 2
    return joint_trajectory(names, [0, duration], [[0.0] * len(names), to], rest, rest)


def wave(duration: float = 600.0, joint: str = "x") -> JointTrajectory:
    """Returns a long reciprocating motion, at most 0.15 m/s and 0.225 m/s²."""
    time = np.arange(0, duration + 0.05, 0.1)
    # The amplitude rises over the first 2 s, so that the motion begins at rest.
    phase = 1.5 * time
    size = 0.1 * np.clip(time / 2, 0, 1) ** 2
    rate = 0.1 * np.where(time < 2, time / 2, 0)
    positions = size * np.sin(phase)
    velocities = rate * np.sin(phase) + 1.5 * size * np.cos(phase)
    velocities[-1] = 0.0
    return joint_trajectory([joint], time, positions, velocities)


def results_of(follow: Follow, sent: Sent) -> list[TrajectoryResult]:
    """Returns the results of a goal on `~/trajectory_result` so far."""
    return [result for result in follow.drive.results() if bytes(result.goal_id) == sent.id]


def ending(follow: Follow, sent: Sent) -> TrajectoryResult:
    """Returns the final result on `~/trajectory_result`."""
    return follow.drive.wait_for(
        lambda: [r for r in results_of(follow, sent) if r.status != TrajectoryResult.ACCEPTED], 10, "its result"
    )[0]
