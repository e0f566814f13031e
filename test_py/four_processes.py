"""Graph of four processes: trajectory source, node, process model, recorder.

The process model responds to the axes' velocity with a load in proportion to it and against the motion, like a cutting
process; the recorder keeps the published samples. Each of the three is this file as a program:

    python test_py/four_processes.py source|process-model|recorder SECONDS
"""

from __future__ import annotations

import json
import math
import sys
import time
from dataclasses import dataclass

import numpy as np
import rclpy
import rclpy.executors
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from line_process import LineProcess
from node_process import Node, separate_output
from virtual_axes_py.ros import TSP_NS, AxesClient, joint_trajectory

JOINTS = ("x", "y")
DAMPING = 4000.0
"""Damping of the process model, N s/m: 1000 N at 15 m/min."""
SWING, AMPLITUDE = 2.0, 0.15
"""Duration (s) and amplitude (m) of one swing of the source."""
READY = "ready"
"""Line on stdout when a process is connected."""


def source(seconds: float) -> None:
    """Sends swings of both axes, one trajectory after the other without a gap."""
    with AxesClient() as drive:
        print(READY, flush=True)
        periods = round(SWING * 1e9 / TSP_NS)
        times = np.arange(periods) * TSP_NS / 1e9
        wave = AMPLITUDE / 2 * (1 - np.cos(2 * np.pi * np.arange(periods) / periods))
        start = drive.now() + 50 * TSP_NS
        for _ in range(math.ceil(seconds / SWING)):
            drive.accept(joint_trajectory(JOINTS, times, np.column_stack([wave, wave]), stamp=start))
            start += periods * TSP_NS
            # At most one swing ahead, as a client that plans during the motion.
            drive.wait_until(start - periods * TSP_NS, 4 * SWING)
        drive.wait_until(start, 4 * SWING)


def process_model(seconds: float) -> None:
    """Publishes a load for each joint state, -DAMPING times the velocity, until the end."""
    rclpy.init()
    node = rclpy.create_node("process_model")
    publisher = node.create_publisher(JointState, "/load", 10)

    def react(state: JointState) -> None:
        velocity = dict(zip(state.name, state.velocity))
        effort = [-DAMPING * velocity[joint] for joint in JOINTS]
        publisher.publish(JointState(name=list(JOINTS), effort=effort))

    node.create_subscription(JointState, "/joint_states", react, qos_profile_sensor_data)
    while publisher.get_subscription_count() == 0:
        rclpy.spin_once(node, timeout_sec=0.05)
    print(READY, flush=True)
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.1)


def recorder(_seconds: float) -> None:
    """Records all samples until a line on standard input, and writes them as a line."""
    with AxesClient() as drive:
        begin = drive.now()
        print(READY, flush=True)
        sys.stdin.readline()
        kept = drive.record(begin, drive.now())
        columns = {
            "load": [kept.currents["load", joint].tolist() for joint in JOINTS],
            "velocity": [kept.states["velocity", joint].tolist() for joint in JOINTS],
        }
        stamps = {name: getattr(kept, name).stamp.tolist() for name in ("joints", "currents", "states")}
        print(json.dumps({"stamps": stamps, **columns}), flush=True)


@dataclass
class Figures:
    """Recorded samples, by topic or by joint."""

    stamps: dict[str, list[int]]
    """Stamps by topic, in order of arrival, ns."""
    load: list[list[float]]
    """Load currents, A."""
    velocity: list[list[float]]
    """Velocities, m/s."""

    def faults(self) -> list[str]:
        """Returns the topics with missing or duplicate stamps."""
        return [topic for topic, stamps in self.stamps.items() if set(np.diff(stamps)) != {TSP_NS}]

    def answered(self, load_per_velocity: float) -> float:
        """Returns the share of nonzero loads (A) that equal this factor (A s/m) times a published velocity."""
        answers = []
        for load, velocity in zip(map(np.array, self.load), map(np.array, self.velocity)):
            known = np.sort(velocity * load_per_velocity)
            load = load[load != 0]
            index = np.clip(np.searchsorted(known, load), 1, len(known) - 1)
            away = np.minimum(np.abs(known[index] - load), np.abs(known[index - 1] - load))
            answers.append(away <= 1e-9 * np.abs(known).max())
        return float(np.concatenate(answers).mean())


def run_graph(seconds: float) -> Figures:
    """Runs the four processes for `seconds` of motion."""
    with Node(["-p", "time:=real"]) as node:
        env = {"ROS_DOMAIN_ID": str(node.domain_id), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        # The others continue until the source has exited.
        with (
            LineProcess(__file__, "process-model", seconds + 30, env=env) as model,
            LineProcess(__file__, "recorder", seconds, env=env) as keeper,
        ):
            assert model.read_line(20) == keeper.read_line(20) == READY
            with LineProcess(__file__, "source", seconds, env=env) as swings:
                assert swings.read_line(20) == READY
                swings.wait()
                keeper.go_on()
                return Figures(**json.loads(keeper.read_line()))


def main() -> None:
    """Runs one of the three processes."""
    separate_output()
    role, seconds = sys.argv[1:]
    {"source": source, "process-model": process_model, "recorder": recorder}[role](float(seconds))


if __name__ == "__main__":
    main()
