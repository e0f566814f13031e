"""ROS 2 client node of the virtual axes."""

from __future__ import annotations

import itertools
import os
import struct
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import DriveStates, MotorCurrents, TrajectoryResult

from .process import DEFAULT_NODE, Node
from .qos import DEEP_QOS, PSEC_QOS, RESULT_QOS, STREAM_QOS
from .recording import CURRENT_FIELDS, JOINT_FIELDS, STATE_FIELDS, Recording, Series
from .trajectories import NANOSECONDS, to_ns, to_time

RECORDING_KEYS = ["file", "recording", "size_mb", "messages", "left_out"]
"""Keys of the recording's status in /diagnostics (docs/reference/diagnostics.md)."""
SAMPLES_AT_ONCE = 200
"""Samples taken per callback, few enough that other callbacks are executed in time."""
TURN_S = 20.0
"""Timeout for a call to be executed by the executor, s."""
SETTLE_S = 0.2
"""Timeout for a reliable sample written at matching: it may wait for the next heartbeat, s."""


class TrajectoryRejected(Exception):
    """Rejection of a trajectory; `result` holds the reason."""

    def __init__(self, result: TrajectoryResult):
        """Keeps the result beside its text."""
        super().__init__(f"code {result.code}: {result.text}")
        self.result = result


class ParameterRejected(Exception):
    """Rejection of a parameter value; the text is the reason."""


class Drive:
    """ROS 2 node that sends setpoints to the virtual axes and keeps their messages.

    It spins in its own thread; every wait has a timeout and raises TimeoutError.
    """

    _count = itertools.count()

    def __init__(
        self,
        node: str | None = None,
        process: Node | None = None,
        domain_id: int | None = None,
        timeout: float = 20.0,
        connect: bool = True,
        remaps: Sequence[str] = (),
        listen: bool = True,
    ):
        """Joins the graph and, unless `connect` is false, waits for the axes.

        Unless `listen` is false it keeps their samples of each position cycle.

        `remaps` are the remapping rules of the axes' node, as in "joint_states:=/states".

        `node` is the full name of the axes' node; `process` is its process if it was started here, which sets
        name and domain, and whose early end aborts the wait.
        """
        self.process = process
        self.target = node or (process.name if process else DEFAULT_NODE)
        namespace = self.target.rsplit("/", 1)[0]
        if domain_id is None and process is not None:
            domain_id = process.domain_id
        self._changed = threading.Condition()
        self._samples: dict[str, list[bytes]] = {key: [] for key in ("joints", "currents", "states") if listen}
        self._results: list[TrajectoryResult] = []
        self._diagnostics: list[DiagnosticArray] = []
        self._sent = 0
        self._closing = False

        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self.name = f"drive_{os.getpid()}_{next(self._count)}"
        cli_args = ["--ros-args", *(word for remap in remaps for word in ("-r", remap))] if remaps else None
        self.node = rclpy.create_node(
            self.name,
            context=self._context,
            cli_args=cli_args,
            enable_rosout=False,
            start_parameter_services=False,
        )
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
            if listen
        ]
        self._subscriptions.append(
            self.node.create_subscription(
                TrajectoryResult, f"{self.target}/trajectory_result", self._keep(self._results), RESULT_QOS
            )
        )
        self._subscriptions.append(
            self.node.create_subscription(DiagnosticArray, "/diagnostics", self._keep(self._diagnostics), DEEP_QOS)
        )
        self._clients: dict[str, Any] = {}
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name=self.name, daemon=True)
        self._thread.start()
        if connect:
            try:
                self.connect(timeout)
            except BaseException:
                self.close()
                raise

    # ---- life

    def __enter__(self) -> Drive:
        """Returns itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Closes the client."""
        self.close()

    def close(self) -> None:
        """Leaves the graph; has no effect when called again."""
        if self._context.ok():
            self._closing = True
            self._executor.shutdown(timeout_sec=2.0)
            self._thread.join(timeout=2.0)
            self.node.destroy_node()
            rclpy.shutdown(context=self._context)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass
        except (InvalidHandle, AttributeError):
            # A callback, or a wait of rclpy's executor, that was active when the node was destroyed.
            if not self._closing:
                raise

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

    def _keep(self, store: list[Any]) -> Callable[[Any], None]:
        def callback(message: Any) -> None:
            with self._changed:
                store.append(message)
                self._changed.notify_all()

        return callback

    def in_executor(self, call: Callable[[], Any]) -> Any:
        """Runs `call()` in the executor's thread and returns its result. From another thread rclpy's ActionClient can
        receive a response before it has stored the request, and drops it; the executor fails if an entity is destroyed
        during a wait.
        """
        task = self._executor.create_task(call)
        self.wait_for(task.done, TURN_S, "execution by the executor")
        return task.result()

    def wait_for(self, condition: Callable[[], Any], timeout: float, what: str) -> Any:
        """Waits until `condition()` is true and returns its value; `what` is for the error message."""
        deadline = time.monotonic() + timeout
        with self._changed:
            while not (answer := condition()):
                left = deadline - time.monotonic()
                if left <= 0:
                    raise TimeoutError(f"no {what} within {timeout:g} s{self._account()}")
                if self.process is not None and self.process.poll() is not None:
                    raise ChildProcessError(f"the node ended while waiting for {what}{self._account()}")
                # Some conditions query the graph, which sends no event when it changes.
                self._changed.wait(min(left, 0.02))
            return answer

    def _account(self) -> str:
        return f"; the node's output:\n{self.process.output()}" if self.process is not None else ""

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

    def sees(self, name: str | None = None) -> bool:
        """Returns true if a node of this full name (default: the axes') is in the graph."""
        full = [f"{ns.rstrip('/')}/{node}" for node, ns in self.node.get_node_names_and_namespaces()]
        return (name or self.target) in full

    # ---- time

    def now(self) -> int:
        """Returns the newest position cycle that the axes have published, ns of the node's clock."""
        self._must_listen()
        with self._changed:
            return stamp_of(self._samples["states"][-1])

    def wait_until(self, stamp_ns: int, timeout: float) -> None:
        """Waits until everything up to `stamp_ns` has been published."""
        self._must_listen()
        self.wait_for(
            lambda: all(samples and stamp_of(samples[-1]) >= stamp_ns for samples in self._samples.values()),
            timeout,
            f"samples up to {stamp_ns} ns",
        )

    # ---- trajectories

    @property
    def gid(self) -> bytes:
        """Returns the GID of the publisher of `psec`, as in TrajectoryResult.publisher_gid."""
        for info in self.node.get_publishers_info_by_topic(self._psec.topic_name):
            if info.node_name == self.name:
                return bytes(info.endpoint_gid[:16])
        raise LookupError(f"{self.name} does not see its own publisher of {self._psec.topic_name}")

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
        """Publishes setpoints and returns their acceptance; raises TrajectoryRejected."""
        result = self.decision(self.send(trajectory), timeout)
        if result.status == TrajectoryResult.REJECTED:
            raise TrajectoryRejected(result)
        return result

    def run(self, trajectory: JointTrajectory, timeout: float = 60.0, settle: float = 0.0) -> Recording:
        """Executes setpoints to their end plus `settle` s; raises TrajectoryRejected."""
        self._must_listen()
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
        self._must_listen()

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

    def _must_listen(self) -> None:
        if not self._samples:
            raise ValueError("a Drive with listen=False keeps no samples")

    def forget(self) -> None:
        """Drops all samples but the newest of each topic."""
        with self._changed:
            for samples in self._samples.values():
                del samples[:-1]

    def latest(self, field: str = "position") -> dict[str, Any]:
        """Returns a field of the newest drive states, by joint."""
        self._must_listen()
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
        """Applies external forces or torques (N, N.m of the axis, positive direction); they time out."""
        message = JointState(name=list(effort), effort=[float(value) for value in effort.values()])
        self._load.publish(message)

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

    # ---- services

    def call(self, kind: Any, service: str, request: Any, timeout: float = 10.0) -> Any:
        """Calls one of the node's services, `service` without the node's name."""
        client = self._clients.get(service)
        if client is None:
            client = self._clients[service] = self.node.create_client(kind, f"{self.target}/{service}")
            self.wait_for(client.service_is_ready, timeout, f"service {service}")
            time.sleep(SETTLE_S)
        future = client.call_async(request)
        self.wait_for(future.done, timeout, f"response of service {service}")
        return future.result()

    def reset(self, timeout: float = 10.0) -> str:
        """Resets the axes to rest at the start position; returns the node's message."""
        return self._trigger("reset", timeout)

    def stop(self, timeout: float = 10.0) -> str:
        """Stops the axes within their limits; returns the node's message."""
        return self._trigger("stop", timeout)

    def _trigger(self, service: str, timeout: float) -> str:
        answer = self.call(Trigger, service, Trigger.Request(), timeout)
        if not answer.success:
            raise RuntimeError(f"{service}: {answer.message}")
        return answer.message

    def list_parameters(self) -> list[str]:
        """Returns the names of all parameters."""
        return list(self.call(ListParameters, "list_parameters", ListParameters.Request()).result.names)

    def describe(self, names: Sequence[str]) -> list[ParameterDescriptor]:
        """Returns descriptions, types and ranges of parameters."""
        request = DescribeParameters.Request(names=list(names))
        return list(self.call(DescribeParameters, "describe_parameters", request).descriptors)

    def get_parameters(self, names: Sequence[str]) -> dict[str, Any]:
        """Returns values of parameters."""
        answer = self.call(GetParameters, "get_parameters", GetParameters.Request(names=list(names)))
        return {name: parameter_value_to_python(value) for name, value in zip(names, answer.values)}

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Sets parameters one by one; raises ParameterRejected with the node's reasons."""
        request = SetParameters.Request(parameters=parameter_messages(values))
        results = self.call(SetParameters, "set_parameters", request).results
        reasons = [result.reason for result in results if not result.successful]
        if reasons or len(results) != len(values):
            raise ParameterRejected("; ".join(reasons))

    def set_parameters_atomically(self, values: Mapping[str, Any]) -> None:
        """Sets all parameters at the same position cycle or none; raises ParameterRejected."""
        request = SetParametersAtomically.Request(parameters=parameter_messages(values))
        result = self.call(SetParametersAtomically, "set_parameters_atomically", request).result
        if not result.successful:
            raise ParameterRejected(result.reason)


def parameter_messages(values: Mapping[str, Any]) -> list[ParameterMsg]:
    """Returns parameters as messages of the set requests."""
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]


def status_values(status: DiagnosticStatus) -> dict[str, str]:
    """Returns the values of a status of /diagnostics, by key."""
    return {value.key: value.value for value in status.values}


def stamp_of(sample: bytes) -> int:
    """Returns the stamp of a serialized message that begins with a header (CDR, little endian)."""
    sec, nanosec = struct.unpack_from("<iI", sample, 4)
    return sec * NANOSECONDS + nanosec
