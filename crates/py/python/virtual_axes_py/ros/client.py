"""Client of the virtual axes: setpoints, their results, and the messages of each position cycle."""

from __future__ import annotations

import struct
import time
from collections.abc import Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import DriveStates, MotorCurrents, TrajectoryResult

from .graph_node import SETTLE_S, Process
from .qos import DEEP_QOS, PSEC_QOS, RESULT_QOS, STREAM_QOS
from .recording import CURRENT_FIELDS, JOINT_FIELDS, STATE_FIELDS, Recording, Series
from .services import ServiceNode
from .trajectories import NANOSECONDS, to_ns, to_time

DEFAULT_NODE = "/virtual_axes"
"""Full name of the axes' node unless it is renamed."""
RECORDING_KEYS = ["file", "recording", "size_mb", "messages", "left_out"]
"""Keys of the recording's status in /diagnostics (docs/reference/diagnostics.md)."""
SAMPLES_AT_ONCE = 200
"""Samples taken per callback, few enough that other callbacks are executed in time."""


class TrajectoryRejected(Exception):
    """Rejection of a trajectory; `result` is the message TrajectoryResult with code, joint, point, value and limit."""

    def __init__(self, result: TrajectoryResult):
        """Keeps the result beside its text."""
        super().__init__(f"code {result.code}: {result.text}")
        self.result = result


class AxesClient(ServiceNode):
    """ROS 2 node that sends setpoints to the virtual axes and keeps their messages.

    It spins in its own thread and is a context manager; every wait has a timeout and raises `TimeoutError`. Lengths are
    in m, angles in rad, stamps in ns of the node's clock.
    """

    def __init__(
        self,
        node: str | None = None,
        process: Process | None = None,
        domain_id: int | None = None,
        timeout: float = 20.0,
        connect: bool = True,
        remaps: Sequence[str] = (),
        keep_samples: bool = True,
    ):
        """Joins the graph and, unless `connect` is false, waits up to `timeout` s for the axes.

        `node` is the full name of the axes' node, by default `/virtual_axes`. `domain_id` is its ROS domain, by default
        that of the environment. `remaps` are its remapping rules, as in "joint_states:=/states". `process` is its
        process if it was started by the caller, which sets name and domain, and whose early end aborts waits.
        `keep_samples` stores the messages of each position cycle, which `run`, `record`, `latest` and `now` need.
        """
        super().__init__(process, domain_id, remaps)
        self.target = node or (process.name if process else DEFAULT_NODE)
        namespace = self.target.rsplit("/", 1)[0]
        self._samples: dict[str, list[bytes]] = {key: [] for key in ("joints", "currents", "states") if keep_samples}
        self._results: list[TrajectoryResult] = []
        self._diagnostics: list[DiagnosticArray] = []
        self._sent = 0
        self._psec = self.node.create_publisher(JointTrajectory, f"{namespace}/psec", PSEC_QOS)
        self._stream = self.node.create_publisher(JointState, f"{namespace}/psec_stream", STREAM_QOS)
        self._load = self.node.create_publisher(JointState, f"{namespace}/load", 10)
        # Raw: receiving a sample must not cost more than the node needs to publish one.
        self._subscriptions = [
            self._keep_samples(key, kind, topic)
            for key, kind, topic in (
                ("joints", JointState, f"{namespace}/joint_states"),
                ("currents", MotorCurrents, f"{self.target}/motor_currents"),
                ("states", DriveStates, f"{self.target}/drive_states"),
            )
            if keep_samples
        ]
        self._subscriptions.append(
            self.node.create_subscription(
                TrajectoryResult, f"{self.target}/trajectory_result", self._keep(self._results), RESULT_QOS
            )
        )
        self._subscriptions.append(
            self.node.create_subscription(DiagnosticArray, "/diagnostics", self._keep(self._diagnostics), DEEP_QOS)
        )
        self._clients = {}
        self._thread.start()
        if connect:
            try:
                self.connect(timeout)
            except BaseException:
                self.close()
                raise

    def __enter__(self) -> AxesClient:
        """Returns itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Closes the client."""
        self.close()

    def _keep_samples(self, key: str, kind: type, topic: str) -> Any:
        """Creates a subscription that takes all received samples at once: one iteration of rclpy's executor costs ten
        times as much as a sample, and axes in `fast` would run ahead.
        """
        store = self._samples[key]

        def callback(first: bytes) -> None:
            taken = [first]
            handle = subscription.handle
            with handle:
                while len(taken) < SAMPLES_AT_ONCE and (more := handle.take_message(kind, True)) is not None:
                    taken.append(more[0])
            with self._changed:
                store.extend(taken)
                self._changed.notify_all()

        subscription = self.node.create_subscription(kind, topic, callback, DEEP_QOS, raw=True)
        return subscription

    def connect(self, timeout: float = 20.0) -> None:
        """Waits until both directions are matched and the first samples have arrived."""

        def matched() -> bool:
            return (
                self._psec.get_subscription_count() > 0
                and self._stream.get_subscription_count() > 0
                and all(subscription.get_publisher_count() > 0 for subscription in self._subscriptions)
                and all(self._samples.values())
            )

        self.wait_for(matched, timeout, f"match with {self.target}")
        time.sleep(SETTLE_S)

    def is_in_graph(self, name: str | None = None) -> bool:
        """Returns true if a node of this full name (default: the axes') is in the graph."""
        full = [f"{ns.rstrip('/')}/{node}" for node, ns in self.node.get_node_names_and_namespaces()]
        return (name or self.target) in full

    # ---- time

    def now(self) -> int:
        """Returns the newest position cycle that the axes have published, ns of the node's clock."""
        self._require_samples()
        with self._changed:
            return stamp_of(self._samples["states"][-1])

    def wait_until(self, stamp_ns: int, timeout: float) -> None:
        """Waits until everything up to `stamp_ns`, ns of the node's clock, has been published."""
        self._require_samples()
        self.wait_for(
            lambda: all(samples and stamp_of(samples[-1]) >= stamp_ns for samples in self._samples.values()),
            timeout,
            f"samples up to {stamp_ns} ns",
        )

    # ---- trajectories

    @property
    def gid(self) -> bytes:
        """GID of the publisher of `psec`, as in TrajectoryResult.publisher_gid; `LookupError` before discovery."""
        for info in self.node.get_publishers_info_by_topic(self._psec.topic_name):
            if info.node_name == self.name:
                return bytes(info.endpoint_gid[:16])
        raise LookupError(f"{self.name} has not discovered its own publisher of {self._psec.topic_name}")

    def send(self, trajectory: JointTrajectory) -> int:
        """Publishes setpoints; returns the sequence number that identifies them in the results."""
        with self._changed:
            self._sent += 1
            sequence_number = self._sent
            self._psec.publish(trajectory)
        return sequence_number

    def results(self, sequence_number: int | None = None) -> list[TrajectoryResult]:
        """Returns the results so far: all, or those of one trajectory of this client."""
        if sequence_number is None:
            with self._changed:
                return list(self._results)
        gid = self.gid
        with self._changed:
            return [
                result
                for result in self._results
                if result.source == TrajectoryResult.SOURCE_TOPIC
                and result.sequence_number == sequence_number
                and bytes(result.publisher_gid) == gid
            ]

    def decision(self, sequence_number: int, timeout: float = 10.0) -> TrajectoryResult:
        """Waits for acceptance or rejection of the trajectory."""
        return self.wait_for(
            lambda: self.results(sequence_number)[:1], timeout, f"decision on trajectory {sequence_number}"
        )[0]

    def end(self, sequence_number: int, timeout: float) -> TrajectoryResult:
        """Waits for the final result of the trajectory: COMPLETED, PREEMPTED, STOPPED, ABORTED, or REJECTED."""
        return self.wait_for(
            lambda: [r for r in self.results(sequence_number) if r.status != TrajectoryResult.ACCEPTED],
            timeout,
            f"end of trajectory {sequence_number}",
        )[0]

    def accept(self, trajectory: JointTrajectory, timeout: float = 10.0) -> TrajectoryResult:
        """Publishes setpoints and returns their acceptance; raises `TrajectoryRejected` with the reason."""
        result = self.decision(self.send(trajectory), timeout)
        if result.status == TrajectoryResult.REJECTED:
            raise TrajectoryRejected(result)
        return result

    def run(self, trajectory: JointTrajectory, timeout: float = 60.0, settle: float = 0.0) -> Recording:
        """Executes setpoints to their end plus `settle` s and returns all messages of that time.

        Raises `TrajectoryRejected` with the reason; `Recording.result` has the status of the end.
        """
        self._require_samples()
        accepted = self.accept(trajectory)
        result = self.end(accepted.sequence_number, timeout)
        start = to_ns(accepted.start)
        last = trajectory.points[-1].time_from_start
        end = start + last.sec * NANOSECONDS + last.nanosec + round(settle * NANOSECONDS)
        if result.status == TrajectoryResult.COMPLETED:
            self.wait_until(end, timeout)
        return self.record(start, end, result)

    def record(self, start: int, end: int, result: TrajectoryResult | None = None) -> Recording:
        """Returns the messages from `start` to `end`, ns of the node's clock, both included."""
        self._require_samples()

        def gather(key: str, kind: type, fields: Sequence[str]) -> Series:
            with self._changed:
                raw = [sample for sample in self._samples[key] if start <= stamp_of(sample) <= end]
            return Series([deserialize_message(sample, kind) for sample in raw], fields)

        return Recording(
            start=start,
            joints=gather("joints", JointState, JOINT_FIELDS),
            currents=gather("currents", MotorCurrents, CURRENT_FIELDS),
            states=gather("states", DriveStates, STATE_FIELDS),
            result=result,
        )

    def _require_samples(self) -> None:
        """Raises `ValueError` if the client keeps no samples."""
        if not self._samples:
            raise ValueError("a client with keep_samples=False has no samples; create it with keep_samples=True")

    def drop_samples(self) -> None:
        """Drops all samples but the newest of each topic."""
        with self._changed:
            for samples in self._samples.values():
                del samples[:-1]

    def latest(self, field: str = "position") -> dict[str, Any]:
        """Returns a field of the newest message DriveStates by joint, in its units (m, rad)."""
        self._require_samples()
        with self._changed:
            message = deserialize_message(self._samples["states"][-1], DriveStates)
        return dict(zip(message.name, getattr(message, field)))

    def stream(self, names: Sequence[str], positions: Sequence[float], stamp: int = 0) -> None:
        """Publishes one setpoint of a stream (m, rad); NaN or a missing position does not command the joint.

        `stamp` is the time of sending, ns of the sender's own clock; 0 means unknown.
        """
        message = JointState(name=list(names), position=[float(value) for value in positions])
        message.header.stamp = to_time(stamp)
        self._stream.publish(message)

    def load(self, effort: Mapping[str, float]) -> None:
        """Applies external forces or torques (N, N·m of the axis, positive towards plus); they time out after 0.1 s."""
        message = JointState(name=list(effort), effort=[float(value) for value in effort.values()])
        self._load.publish(message)

    # ---- diagnostics

    def diagnostics(self) -> list[DiagnosticArray]:
        """Returns the diagnostics so far."""
        with self._changed:
            return list(self._diagnostics)

    def next_diagnostics(self, timeout: float = 8.0) -> DiagnosticArray:
        """Waits for the next diagnostics, without those in transit."""
        seen = len(self.diagnostics())
        return self.wait_for(lambda: self.diagnostics()[seen + 1 :], timeout, "diagnostics")[0]

    def next_status(self) -> dict[str, str]:
        """Returns the values of the node's next diagnostics, by key."""
        return status_values(self.next_diagnostics().status[0])


def status_values(status: DiagnosticStatus) -> dict[str, str]:
    """Returns the values of a status of /diagnostics, by key."""
    return {value.key: value.value for value in status.values}


def stamp_of(sample: bytes) -> int:
    """Returns the stamp of a serialized message that begins with a header (CDR, little endian), ns."""
    sec, nanosec = struct.unpack_from("<iI", sample, 4)
    return int(sec) * NANOSECONDS + int(nanosec)
