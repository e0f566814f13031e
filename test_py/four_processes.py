"""Graph of four processes: trajectory source, node, process model, recorder.

The process model responds to the axes' velocity with a load in proportion to it and against the motion, like a cutting
process; the recorder keeps the published samples and their latency. `tools/run_graph.py` runs it for a minute, a test
for a few seconds. Each of the three is this file as a program:

    python test_py/four_processes.py source|process-model|recorder SECONDS [FILE]
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
import rclpy.executors
import rclpy.node
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from virtual_axes.msg import DriveStates, MotorCurrents

from node_process import Node
from virtual_axes_py.ros import DEEP_QOS, TSP_NS, AxesClient, joint_trajectory, status_values, to_ns

JOINTS = ("x", "y")
DAMPING = 4000.0
"""Damping of the process model, N s/m: 1000 N at 15 m/min."""
SWING = 2.0
"""Duration of one swing of the source, s."""
AMPLITUDE = 0.15
"""Amplitude of the swing, m."""
READY = "ready"
"""Line on stdout when a process is connected."""
TOPICS = {"joint_states": JointState, "motor_currents": MotorCurrents, "drive_states": DriveStates}


# ------------------------------------------------------------------------------ the three processes


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


def process_model(seconds: float) -> None:
    """Publishes a load for each joint state, -DAMPING times the velocity, until the end."""
    with joined("process_model") as node:
        publisher = node.create_publisher(JointState, "/load", 10)

        def react(state: JointState) -> None:
            velocity = dict(zip(state.name, state.velocity))
            effort = [-DAMPING * velocity[joint] for joint in JOINTS]
            publisher.publish(JointState(name=list(JOINTS), effort=effort))

        node.create_subscription(JointState, "/joint_states", react, qos_profile_sensor_data)
        wait_for_match(node, lambda: publisher.get_subscription_count() > 0)
        spin(node, seconds)


def recorder(seconds: float, file: Path) -> None:
    """Records all samples with their arrival times, and the diagnostics; writes them to `file`."""
    with joined("recorder") as node:
        samples: dict[str, list[tuple[bytes, int]]] = {topic: [] for topic in TOPICS}
        statuses: list[dict[str, str]] = []

        def keep(topic: str, message: bytes) -> None:
            samples[topic].append((message, time.time_ns()))

        for topic, kind in TOPICS.items():
            name = f"/{topic}" if topic == "joint_states" else f"/virtual_axes/{topic}"
            # Raw: receiving a sample must not cost more than the node needs to publish one.
            node.create_subscription(kind, name, lambda message, topic=topic: keep(topic, message), DEEP_QOS, raw=True)
        node.create_subscription(
            DiagnosticArray,
            "/diagnostics",
            lambda array: statuses.append(status_values(array.status[0])),
            QoSProfile(depth=10),
        )
        wait_for_match(node, lambda: all(samples.values()))
        spin(node, seconds)
        came = {
            topic: [(to_ns(deserialize_message(message, kind).header.stamp), at) for message, at in samples[topic]]
            for topic, kind in TOPICS.items()
        }
        rows = {
            field: [
                [getattr(message, field)[message.name.index(joint)] for joint in JOINTS]
                for message in (deserialize_message(raw, TOPICS[topic]) for raw, _ in samples[topic])
            ]
            for field, topic in (("load", "motor_currents"), ("velocity", "drive_states"))
        }
        file.write_text(json.dumps({"came": came, **rows, "diagnostics": statuses}))


@contextmanager
def joined(name: str) -> Iterator[rclpy.node.Node]:
    """Yields a node in the graph."""
    rclpy.init()
    node = rclpy.create_node(name)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def wait_for_match(node: rclpy.node.Node, is_matched: Callable[[], bool]) -> None:
    """Spins until the condition holds, 20 s at most."""
    deadline = time.monotonic() + 20
    while not is_matched():
        if time.monotonic() > deadline:
            sys.exit("no match with the node")
        rclpy.spin_once(node, timeout_sec=0.05)
    print(READY, flush=True)


def spin(node: rclpy.node.Node, seconds: float) -> None:
    """Spins a node for a given time."""
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        # Constant timeout: with a new timeout rclpy restarts at the first subscription and the last one starves.
        executor.spin_once(timeout_sec=0.1)


# ------------------------------------------------------------------------------------- the graph


@dataclass
class Figures:
    """Recorded samples."""

    stamps: dict[str, np.ndarray]
    """Stamps by topic, in order of arrival, ns."""
    lateness: dict[str, np.ndarray]
    """Latency from stamp to arrival by topic, s."""
    load: np.ndarray
    """Load currents, a row per sample of motor_currents, a column per joint, A."""
    velocity: np.ndarray
    """Velocities, a row per sample of drive_states, a column per joint, m/s."""
    diagnostics: dict[str, str]
    """Newest diagnostics of the node."""

    def faults(self) -> list[str]:
        """Returns the defects of the stamp grid: missing and duplicate stamps."""
        found = []
        for topic, stamps in self.stamps.items():
            steps, numbers = np.unique(np.diff(stamps), return_counts=True)
            if steps.tolist() != [TSP_NS]:
                odd = {f"{step / 1e6:g} ms": int(n) for step, n in zip(steps, numbers) if step != TSP_NS}
                found.append(f"{topic}: {odd} among {len(stamps)} samples")
        return found

    def load_per_velocity(self) -> tuple[float, float, float]:
        """Returns load current over velocity (A s/m, least squares), its correlation, and the lag in cycles.

        A load acts some periods after the velocity that it answers.
        """
        _, at_currents, at_states = np.intersect1d(
            self.stamps["motor_currents"], self.stamps["drive_states"], return_indices=True
        )
        load, velocity = self.load[at_currents].T, self.velocity[at_states].T

        def fit(lag: int) -> tuple[float, float, float]:
            v, i = velocity[:, : velocity.shape[1] - lag].ravel(), load[:, lag:].ravel()
            return float(v @ i / (v @ v)), float(np.corrcoef(v, i)[0, 1]), float(lag)

        return max((fit(lag) for lag in range(21)), key=lambda found: found[1])

    def answered(self, load_per_velocity: float) -> float:
        """Returns the share of nonzero loads (A) that equal this factor times an earlier published velocity.

        However late the answer was; `load_per_velocity` in A s/m.
        """
        answers = []
        for joint in range(len(JOINTS)):
            known = np.sort(self.velocity[:, joint] * load_per_velocity)
            load = self.load[self.load[:, joint] != 0, joint]
            index = np.clip(np.searchsorted(known, load), 1, len(known) - 1)
            away = np.minimum(np.abs(known[index] - load), np.abs(known[index - 1] - load))
            answers.append(away <= 1e-9 * np.abs(known).max())
        return float(np.concatenate(answers).mean())


class Process:
    """One of the three processes of this file; terminated by its process id."""

    def __init__(self, role: str, seconds: float, domain_id: int, *more: str):
        """Starts the process."""
        env = {**os.environ, "ROS_DOMAIN_ID": str(domain_id), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        command = [sys.executable, str(Path(__file__).resolve()), role, str(seconds), *more]
        self.role = role
        self._process = subprocess.Popen(command, env=env, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)

    def wait_until_ready(self) -> None:
        """Waits for the ready line; the process has its own timeout of 20 s."""
        assert self._process.stdout is not None
        if self._process.stdout.readline().strip() != READY:
            raise ChildProcessError(f"{self.role} did not start")

    def wait(self, timeout: float) -> None:
        """Waits until the process exits."""
        if self._process.wait(timeout) != 0:
            raise ChildProcessError(f"{self.role} ended with status {self._process.returncode}")

    def __enter__(self) -> Process:
        """Returns itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Terminates the process."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait(10)
        assert self._process.stdout is not None
        self._process.stdout.close()


def run_graph(seconds: float, file: Path) -> Figures:
    """Runs the four processes for `seconds` of motion; returns the figures that the recorder wrote to `file`."""
    with Node(["-p", "time:=real"]) as node:
        domain = node.domain_id
        assert domain is not None
        # The others continue until the source has exited.
        margin = 1.0
        with (
            Process("process-model", seconds + 30, domain) as model,
            Process("recorder", seconds + margin, domain, str(file)) as keeper,
        ):
            model.wait_until_ready()
            with Process("source", seconds, domain) as swings:
                swings.wait_until_ready()
                keeper.wait_until_ready()
                keeper.wait(seconds + 60)
    kept = json.loads(file.read_text())
    came = {topic: np.array(pairs, dtype=np.int64) for topic, pairs in kept["came"].items()}
    return Figures(
        stamps={topic: pairs[:, 0] for topic, pairs in came.items()},
        lateness={topic: (pairs[:, 1] - pairs[:, 0]) / 1e9 for topic, pairs in came.items()},
        load=np.array(kept["load"]),
        velocity=np.array(kept["velocity"]),
        diagnostics=kept["diagnostics"][-1],
    )


def main() -> None:
    """Runs one of the three processes."""
    role, seconds, *more = sys.argv[1:]
    if role == "source":
        source(float(seconds))
    elif role == "process-model":
        process_model(float(seconds))
    else:
        recorder(float(seconds), Path(more[0]))


if __name__ == "__main__":
    main()
