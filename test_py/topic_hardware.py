"""Stand-in for ros2_control's joint_state_topic_hardware_interface, and a network with losses.

In each update of the controller manager, `read` copies the newest joint states, and `write` sends one JointState with
the command of every joint in the order of its URDF, unless commands and states differ by no more than the threshold, in
sum. A joint that no controller has claimed is NaN. A joint without a position command interface is in `name` but
not in `position`, which is then shorter: such joints are last.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState

from virtual_axes_py.ros import AxesClient

COMMANDS_TOPIC = "/robot_joint_commands"
STATES_TOPIC = "/robot_joint_states"
THRESHOLD = 1e-5
"""Default threshold below which a command is not sent; -1 sends all commands."""


@dataclass(frozen=True)
class Network:
    """Network disturbances, by a fixed seed."""

    seed: int = 0
    jitter: float = 0.0
    """Maximum delay of a message, s; a message may be overtaken by the next one."""
    duplicates: float = 0.0
    """Share of duplicated messages."""
    gaps: float = 0.0
    """Share of messages at which a gap begins."""
    gap: float = 0.0
    """Duration of a gap without messages, s."""

    def schedule(self, count: int, rate: float) -> list[tuple[float, int]]:
        """Returns arrival time (s) and index of `count` messages at `rate` (Hz) in order, without lost messages."""
        rng = random.Random(self.seed)
        arrivals: list[tuple[float, int]] = []
        silent_until = -1.0
        # No losses at the beginning and at the end: a message lost there is not sent again.
        for index in range(count):
            sent = index / rate
            if 0.2 < sent < count / rate - 0.5 and sent >= silent_until and rng.random() < self.gaps:
                silent_until = sent + self.gap
            late = rng.uniform(0.0, self.jitter)
            copies = 1 + (rng.random() < self.duplicates)
            if sent < silent_until:
                continue
            arrivals += [(sent + late, index)] * copies
        return sorted(arrivals)


class TopicHardware:
    """Hardware interface: states in, commands out."""

    def __init__(
        self,
        drive: AxesClient,
        joints: Sequence[str],
        position_interfaces: Sequence[str],
        threshold: float = THRESHOLD,
    ):
        """Creates the interface; `joints` in the order of the URDF, commands only for `position_interfaces`."""
        self.joints = list(joints)
        self.threshold = threshold
        self._has_position = [joint in position_interfaces for joint in joints]
        self.command = dict.fromkeys(joints, math.nan)
        """Commands, m or rad; NaN if no controller has claimed the joint."""
        self.state = dict.fromkeys(joints, math.nan)
        """States of the newest `read`, m or rad."""
        self._newest: JointState | None = None
        self._drive = drive
        self.node = drive.node
        self._publisher = self.node.create_publisher(JointState, COMMANDS_TOPIC, QoSProfile(depth=1))
        self._subscription = self.node.create_subscription(
            JointState, STATES_TOPIC, self._keep, qos_profile_sensor_data
        )

    def _keep(self, message: JointState) -> None:
        self._newest = message

    def is_connected(self) -> bool:
        """Returns true if the commands have a subscriber and states have arrived."""
        return self._publisher.get_subscription_count() > 0 and self._newest is not None

    def read(self) -> None:
        """Copies the newest states."""
        if (newest := self._newest) is not None:
            self.state.update({j: p for j, p in zip(newest.name, newest.position) if j in self.state})

    def write(self) -> JointState | None:
        """Returns the message with the commands, or None below the threshold."""
        # NaN makes the sum NaN, which is not below any threshold.
        difference = sum(abs(self.state[joint] - self.command[joint]) for joint in self.joints)
        if difference <= self.threshold:
            return None
        message = JointState(name=self.joints)
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.position = [self.command[j] for j, has in zip(self.joints, self._has_position) if has]
        return message

    def send(self, message: JointState) -> None:
        """Publishes the message."""
        self._publisher.publish(message)

    def close(self) -> None:
        """Destroys publisher and subscription."""

        def leave() -> None:
            self.node.destroy_publisher(self._publisher)
            self.node.destroy_subscription(self._subscription)

        self._drive.in_executor(leave)

    def run(
        self,
        controller: Callable[[float], Mapping[str, float]],
        duration: float,
        rate: float,
        network: Network | None = None,
    ) -> list[dict[str, float]]:
        """Updates at `rate` (Hz) for `duration` s; `controller(t)` commands joints at t s.

        The controller's time is the count of updates, as with a controller that is given the period.
        Returns what was commanded at each update.
        """
        count = round(duration * rate)
        commanded: list[dict[str, float]] = []
        messages: list[JointState | None] = []
        began = time.monotonic()
        for due, index in (network or Network()).schedule(count, rate):
            while len(messages) <= index:
                _sleep_until(began + len(messages) / rate)
                self.read()
                self.command.update(controller(len(messages) / rate))
                commanded.append(dict(self.command))
                messages.append(self.write())
            _sleep_until(began + due)
            if (message := messages[index]) is not None:
                self.send(message)
        return commanded


def _sleep_until(moment: float) -> None:
    time.sleep(max(0.0, moment - time.monotonic()))
