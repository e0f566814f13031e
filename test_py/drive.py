"""Drive the virtual axes from Python: the example to copy, and what the tests and the demo use.

    with Node(["-p", "time:=fast"]) as process, Drive(process=process) as drive:
        path = ballbar()
        recording = drive.run(joint_trajectory(["x", "y"], path.time, np.column_stack([path.x, path.y])))
        print(recording.radial_deviation(path.centre, path.radius)[recording.within(path.steady)].mean())

Needs rclpy and this package's messages: `tools/setup.sh && source .build/env.sh`, or a ROS 2 Jazzy
workspace with virtual_axes built. Units are SI (m, rad, s, A); times of the node are integer ns.
"""

from __future__ import annotations

import array
import ctypes
import fcntl
import itertools
import math
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray
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
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from virtual_axes.msg import DriveStates, MotorCurrents, TrajectoryResult

NANOSECONDS = 1_000_000_000
TSP_NS = 6_000_000
"""Position period of the default machine, ns."""

DEFAULT_NODE = "/virtual_axes"
PSEC_QOS = QoSProfile(depth=64, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
STREAM_QOS = QoSProfile(depth=1)
"""Reliable, of one sample: as ros2_control's topic-based hardware publishes."""
DEEP_QOS = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST)
"""Deep enough that a reader which is late by two minutes at 6 ms loses nothing."""
# Deeper than the node's own 50: a burst of trajectories has two results each.
RESULT_QOS = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)

SAMPLES_AT_ONCE = 200
"""Few enough that other callbacks have their turn."""
SETTLE_S = 0.2
"""A reliable sample written in the instant after matching can wait for the next heartbeat."""


# ------------------------------------------------------------------------------------ trajectories


def to_time(stamp_ns: int) -> Time:
    """A ROS time from integer ns."""
    return Time(sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)


def to_ns(stamp: Time) -> int:
    """Integer ns from a ROS time."""
    return stamp.sec * NANOSECONDS + stamp.nanosec


def joint_trajectory(
    names: Sequence[str],
    times: Sequence[float] | np.ndarray,
    positions: Any,
    velocities: Any = None,
    accelerations: Any = None,
    stamp: int | None = None,
) -> JointTrajectory:
    """Set-points for `names`: `times` in s from the start, a row of positions (m, rad) per time.

    Without velocities the axes go from point to point linearly, with them along cubics, with
    accelerations too along quintics. `stamp` is the start in ns; None starts at once.
    """
    nanoseconds = np.rint(np.asarray(times, dtype=float) * NANOSECONDS).astype(np.int64)
    seconds, rest = np.divmod(nanoseconds, NANOSECONDS)

    def rows(values: Any) -> Iterable[array.array]:
        if values is None:
            return itertools.repeat(array.array("d"))
        table = np.ascontiguousarray(values, dtype=np.float64).reshape(len(nanoseconds), -1)
        width = table.shape[1] * table.itemsize
        data = table.tobytes()
        return (array.array("d", data[i * width : (i + 1) * width]) for i in range(len(nanoseconds)))

    message = JointTrajectory(joint_names=list(names))
    message.points = [
        JointTrajectoryPoint(
            positions=position,
            velocities=velocity,
            accelerations=acceleration,
            time_from_start=Duration(sec=sec, nanosec=nanosec),
        )
        for sec, nanosec, position, velocity, acceleration in zip(
            seconds.tolist(), rest.tolist(), rows(positions), rows(velocities), rows(accelerations)
        )
    ]
    if stamp is not None:
        message.header.stamp = to_time(stamp)
    return message


class Ballbar(NamedTuple):
    """A circle at constant feed with ramps, sampled on the position grid."""

    time: np.ndarray
    """s from the start, one per position period."""
    x: np.ndarray
    """m"""
    y: np.ndarray
    """m"""
    steady: tuple[float, float]
    """From when to when the feed is steady, 0.5 s clear of both ramps, s."""
    centre: tuple[float, float]
    """m"""
    radius: float
    """m"""


def ballbar(
    radius: float = 0.150,
    feed: float = 15 / 60,
    turns: float = 2.0,
    rest: float = 0.5,
    ramp: float = 0.5,
    period_ns: int = TSP_NS,
    clear: float = 0.5,
) -> Ballbar:
    """The circular test: counter-clockwise from (0, 0) about (-radius, 0).

    `rest` s at rest, the feed (m/s) rises as feed/2 (1 - cos(pi t/ramp)), `turns` full turns at full
    feed, the same ramp down, `rest` s at rest. The ramps are extra path.
    """
    cruise = turns * 2 * math.pi * radius / feed
    duration = rest + ramp + cruise + ramp + rest
    time_ns = np.arange(math.ceil(duration * NANOSECONDS / period_ns) + 1, dtype=np.int64) * period_ns
    time_s = time_ns / NANOSECONDS

    def ramp_path(t: np.ndarray) -> np.ndarray:
        """Integral of the rising feed, m."""
        return feed / 2 * (t - ramp / math.pi * np.sin(math.pi * t / ramp))

    up = np.clip(time_s - rest, 0, ramp)
    at_feed = np.clip(time_s - rest - ramp, 0, cruise)
    down = np.clip(time_s - rest - ramp - cruise, 0, ramp)
    # The ramp down is the ramp up run backwards from its end.
    half = feed * ramp / 2
    path = ramp_path(up) + feed * at_feed + half - ramp_path(ramp - down)
    angle = path / radius
    return Ballbar(
        time=time_s,
        x=radius * (np.cos(angle) - 1),
        y=radius * np.sin(angle),
        steady=(rest + ramp + clear, rest + ramp + cruise - clear),
        centre=(-radius, 0.0),
        radius=radius,
    )


# --------------------------------------------------------------------------------------- recording


class Series:
    """What one topic said over a span of time: a row per message, a column per joint."""

    def __init__(self, messages: Sequence[Any], fields: Sequence[str]):
        """Keep `fields` of `messages`, which carry header and name."""
        self.stamp = np.array([to_ns(m.header.stamp) for m in messages], dtype=np.int64)
        """ns"""
        self.name: list[str] = list(messages[0].name) if messages else []
        for message in messages:
            if list(message.name) != self.name:
                raise ValueError(f"the joints changed from {self.name} to {list(message.name)}")
        self._columns = {field: np.array([getattr(m, field) for m in messages]) for field in fields}

    def __getitem__(self, key: str | tuple[str, str]) -> np.ndarray:
        """`series["position"]` is rows by joints, `series["position", "x"]` one joint's."""
        if isinstance(key, tuple):
            return self._columns[key[0]][:, self.name.index(key[1])]
        return self._columns[key]

    def __len__(self) -> int:
        """Number of messages."""
        return len(self.stamp)


STATE_FIELDS = (
    "psec",
    "position",
    "tracking_error",
    "synchronized_tracking_error",
    "velocity",
    "velocity_setpoint",
    "velocity_feedforward",
    "torque_feedforward",
    "voltage",
    "controller",
)
CURRENT_FIELDS = ("current", "current_setpoint", "friction", "gravity", "load", "saturated")
JOINT_FIELDS = ("position", "velocity", "effort")


@dataclass(frozen=True)
class Recording:
    """All that the node published while it executed a trajectory."""

    start: int
    """When time 0 of the trajectory was, ns."""
    joints: Series
    """`joint_states`: position, velocity (m, m/s; rad, rad/s), effort (N, N.m)."""
    currents: Series
    """`~/motor_currents`: current, current_setpoint, friction, gravity, load (A), saturated."""
    states: Series
    """`~/drive_states`: psec, position, ..., see DriveStates.msg."""
    result: TrajectoryResult | None = None
    """How it ended."""

    @property
    def time(self) -> np.ndarray:
        """Time of the joint states, s from the start of the trajectory."""
        return (self.joints.stamp - self.start) / NANOSECONDS

    def within(self, span: tuple[float, float]) -> np.ndarray:
        """Mask of the joint states from span[0] to span[1], s from the start."""
        return (self.time >= span[0]) & (self.time <= span[1])

    def tracking_error(self, joint: str) -> np.ndarray:
        """PSEC - SP at every position instant; contains the pure delay."""
        return self.states["psec", joint] - self.states["position", joint]

    def synchronized_tracking_error(self, joint: str, alpha_periods: float = 1.5) -> np.ndarray:
        """PSEC_floor(k - alpha) - SP_k: what the controller is asked to follow."""
        shift = math.ceil(alpha_periods)
        psec = self.states["psec", joint]
        delayed = np.concatenate([np.full(shift, psec[0]), psec])[: len(psec)]
        return delayed - self.states["position", joint]

    def radial_deviation(
        self, centre: tuple[float, float], radius: float, axes: tuple[str, str] = ("x", "y")
    ) -> np.ndarray:
        """Distance from the centre less the radius, at every joint state, m (ISO 230-4)."""
        x, y = (self.joints["position", axis] for axis in axes)
        return np.hypot(x - centre[0], y - centre[1]) - radius


def circular_deviation(radial_deviation: np.ndarray) -> float:
    """Circular deviation G after ISO 230-4: the largest less the smallest radial deviation, m."""
    return float(np.ptp(radial_deviation))


# ------------------------------------------------------------------------------------ the network


class Refused(Exception):
    """The node refused a trajectory; `result` says why."""

    def __init__(self, result: TrajectoryResult):
        """Keep the result beside its text."""
        super().__init__(f"code {result.code}: {result.text}")
        self.result = result


class ParameterRefused(Exception):
    """The node refused a parameter's value; the text is its reason."""


class Drive:
    """A ROS 2 node that sends set-points to the virtual axes and keeps what they publish.

    It spins in a thread of its own; every wait is bounded and raises TimeoutError.
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
    ):
        """Join the graph and, unless `connect` is false, wait until the axes are there.

        `remaps` are the names that the axes' node was given others for, as in "joint_states:=/states".

        `node` is the full name of the axes' node; `process` the process if it was started from
        here, which gives name and domain, and whose early end ends the wait.
        """
        self.process = process
        self.target = node or (process.name if process else DEFAULT_NODE)
        namespace = self.target.rsplit("/", 1)[0]
        if domain_id is None and process is not None:
            domain_id = process.domain_id
        self._changed = threading.Condition()
        self._samples: dict[str, list[bytes]] = {"joints": [], "currents": [], "states": []}
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
        # Raw: taking a sample must not cost more than the node needs to make one.
        self._subscriptions = [
            self._keep_samples(key, kind, topic)
            for key, kind, topic in (
                ("joints", JointState, f"{namespace}/joint_states"),
                ("currents", MotorCurrents, f"{self.target}/motor_currents"),
                ("states", DriveStates, f"{self.target}/drive_states"),
            )
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
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the graph."""
        self.close()

    def close(self) -> None:
        """Leave the graph; harmless when called twice."""
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
            # A callback, or a wait of rclpy's executor, that was under way when the node left.
            if not self._closing:
                raise

    def _keep_samples(self, key: str, kind: type, topic: str) -> Any:
        """A subscription that takes what has come at one go: a turn of rclpy's executor costs ten times
        as much as a sample, and axes in `fast` would run away from it.
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

    def wait_for(self, condition: Callable[[], Any], timeout: float, what: str) -> Any:
        """Wait until `condition()` holds and return what it gave; `what` is for the error."""
        deadline = time.monotonic() + timeout
        with self._changed:
            while not (answer := condition()):
                left = deadline - time.monotonic()
                if left <= 0:
                    raise TimeoutError(f"no {what} within {timeout:g} s{self._account()}")
                if self.process is not None and self.process.poll() is not None:
                    raise ChildProcessError(f"the node ended while waiting for {what}{self._account()}")
                # Some conditions ask the graph, which tells nobody when it changes.
                self._changed.wait(min(left, 0.02))
            return answer

    def _account(self) -> str:
        return f"; the node's output:\n{self.process.output()}" if self.process is not None else ""

    def connect(self, timeout: float = 20.0) -> None:
        """Wait until both directions are matched and the first samples have come."""

        def matched() -> bool:
            return (
                self._psec.get_subscription_count() > 0
                and self._stream.get_subscription_count() > 0
                and all(subscription.get_publisher_count() > 0 for subscription in self._subscriptions)
                and all(self._samples.values())
            )

        self.wait_for(matched, timeout, f"contact with {self.target}")
        time.sleep(SETTLE_S)

    def sees(self, name: str | None = None) -> bool:
        """Whether a node of this full name (the axes', by default) is in the graph."""
        full = [f"{ns.rstrip('/')}/{node}" for node, ns in self.node.get_node_names_and_namespaces()]
        return (name or self.target) in full

    # ---- time

    def now(self) -> int:
        """The newest position instant that the axes have published, ns of the node's clock."""
        with self._changed:
            return _stamp_ns(self._samples["states"][-1])

    def wait_until(self, stamp_ns: int, timeout: float) -> None:
        """Wait until everything up to `stamp_ns` has been published."""
        self.wait_for(
            lambda: all(samples and _stamp_ns(samples[-1]) >= stamp_ns for samples in self._samples.values()),
            timeout,
            f"samples up to {stamp_ns} ns",
        )

    # ---- trajectories

    @property
    def gid(self) -> bytes:
        """The middleware's id of the publisher of `psec`, as in TrajectoryResult.publisher_gid."""
        for info in self.node.get_publishers_info_by_topic(self._psec.topic_name):
            if info.node_name == self.name:
                return bytes(info.endpoint_gid[:16])
        raise LookupError(f"{self.name} does not see its own publisher of {self._psec.topic_name}")

    def send(self, trajectory: JointTrajectory) -> int:
        """Publish set-points; returns the sequence number by which the results name them."""
        with self._changed:
            self._sent += 1
            sequence_number = self._sent
            self._psec.publish(trajectory)
        return sequence_number

    def results(self, sequence_number: int | None = None) -> list[TrajectoryResult]:
        """The results so far: all, or those of one trajectory from here."""
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
        """Whether the trajectory was accepted or rejected."""
        return self.wait_for(
            lambda: self.results(sequence_number)[:1], timeout, f"decision on trajectory {sequence_number}"
        )[0]

    def end(self, sequence_number: int, timeout: float) -> TrajectoryResult:
        """How the trajectory ended: COMPLETED, DISPLACED, STOPPED, ABORTED, or REJECTED."""
        return self.wait_for(
            lambda: [r for r in self.results(sequence_number) if r.status != TrajectoryResult.ACCEPTED],
            timeout,
            f"end of trajectory {sequence_number}",
        )[0]

    def accept(self, trajectory: JointTrajectory, timeout: float = 10.0) -> TrajectoryResult:
        """Publish set-points and return their acceptance; raises Refused."""
        result = self.decision(self.send(trajectory), timeout)
        if result.status == TrajectoryResult.REJECTED:
            raise Refused(result)
        return result

    def run(self, trajectory: JointTrajectory, timeout: float = 60.0, settle: float = 0.0) -> Recording:
        """Execute set-points to their end and `settle` s on; raises Refused."""
        accepted = self.accept(trajectory)
        result = self.end(accepted.sequence_number, timeout)
        start = to_ns(accepted.start)
        last = trajectory.points[-1].time_from_start
        end = start + last.sec * NANOSECONDS + last.nanosec + round(settle * NANOSECONDS)
        if result.status == TrajectoryResult.COMPLETED:
            self.wait_until(end, timeout)
        return self.record(start, end, result)

    def record(self, start: int, end: int, result: TrajectoryResult | None = None) -> Recording:
        """What was published from `start` to `end`, ns of the node's clock, both included."""

        def gather(key: str, kind: type, fields: Sequence[str]) -> Series:
            with self._changed:
                raw = [sample for sample in self._samples[key] if start <= _stamp_ns(sample) <= end]
            return Series([deserialize_message(sample, kind) for sample in raw], fields)

        return Recording(
            start=start,
            joints=gather("joints", JointState, JOINT_FIELDS),
            currents=gather("currents", MotorCurrents, CURRENT_FIELDS),
            states=gather("states", DriveStates, STATE_FIELDS),
            result=result,
        )

    def forget(self) -> None:
        """Drop the samples so far but the newest of each topic."""
        with self._changed:
            for samples in self._samples.values():
                del samples[:-1]

    def latest(self, field: str = "position") -> dict[str, Any]:
        """A field of the newest drive states, by joint."""
        with self._changed:
            message = deserialize_message(self._samples["states"][-1], DriveStates)
        return dict(zip(message.name, getattr(message, field)))

    def stream(self, names: Sequence[str], positions: Sequence[float], stamp: int = 0) -> None:
        """Publish one set-point of a stream (m, rad); NaN, or none, leaves the joint alone.

        `stamp` is when it was sent, ns of a clock of the sender's own; 0 does not say.
        """
        message = JointState(name=list(names), position=[float(value) for value in positions])
        message.header.stamp = to_time(stamp)
        self._stream.publish(message)

    def load(self, effort: Mapping[str, float]) -> None:
        """Apply external forces or torques (N, N.m of the axis, towards plus); they time out."""
        message = JointState(name=list(effort), effort=[float(value) for value in effort.values()])
        self._load.publish(message)

    def diagnostics(self) -> list[DiagnosticArray]:
        """The diagnostics so far."""
        with self._changed:
            return list(self._diagnostics)

    # ---- services

    def call(self, kind: Any, service: str, request: Any, timeout: float = 10.0) -> Any:
        """Call one of the node's services, `service` without the node's name."""
        client = self._clients.get(service)
        if client is None:
            client = self._clients[service] = self.node.create_client(kind, f"{self.target}/{service}")
            self.wait_for(client.service_is_ready, timeout, f"service {service}")
            time.sleep(SETTLE_S)
        future = client.call_async(request)
        self.wait_for(future.done, timeout, f"answer of service {service}")
        return future.result()

    def reset(self, timeout: float = 10.0) -> str:
        """Put the axes back to rest at the start position; returns the node's message."""
        return self._trigger("reset", timeout)

    def stop(self, timeout: float = 10.0) -> str:
        """Stop the axes within their limits; returns the node's message."""
        return self._trigger("stop", timeout)

    def _trigger(self, service: str, timeout: float) -> str:
        answer = self.call(Trigger, service, Trigger.Request(), timeout)
        if not answer.success:
            raise RuntimeError(f"{service}: {answer.message}")
        return answer.message

    def list_parameters(self) -> list[str]:
        """Names of all parameters."""
        return list(self.call(ListParameters, "list_parameters", ListParameters.Request()).result.names)

    def describe(self, names: Sequence[str]) -> list[ParameterDescriptor]:
        """Descriptions, types and ranges of parameters."""
        request = DescribeParameters.Request(names=list(names))
        return list(self.call(DescribeParameters, "describe_parameters", request).descriptors)

    def get_parameters(self, names: Sequence[str]) -> dict[str, Any]:
        """Values of parameters."""
        answer = self.call(GetParameters, "get_parameters", GetParameters.Request(names=list(names)))
        return {name: parameter_value_to_python(value) for name, value in zip(names, answer.values)}

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Set parameters, each by itself; raises ParameterRefused with the node's reasons."""
        request = SetParameters.Request(parameters=_parameters(values))
        results = self.call(SetParameters, "set_parameters", request).results
        reasons = [result.reason for result in results if not result.successful]
        if reasons or len(results) != len(values):
            raise ParameterRefused("; ".join(reasons))

    def set_parameters_atomically(self, values: Mapping[str, Any]) -> None:
        """Set parameters, all at the same position instant or none; raises ParameterRefused."""
        request = SetParametersAtomically.Request(parameters=_parameters(values))
        result = self.call(SetParametersAtomically, "set_parameters_atomically", request).result
        if not result.successful:
            raise ParameterRefused(result.reason)


def _parameters(values: Mapping[str, Any]) -> list[ParameterMsg]:
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]


def _stamp_ns(sample: bytes) -> int:
    """Stamp of a serialised message that begins with a header (CDR, little endian)."""
    sec, nanosec = struct.unpack_from("<iI", sample, 4)
    return sec * NANOSECONDS + nanosec


# ------------------------------------------------------------------------------------- the process


class DomainId:
    """A ROS_DOMAIN_ID that nobody on this machine uses, ours until released."""

    # DDS listens at 7400 + 250 id: above 101 that reaches into Linux's ephemeral ports.
    RANGE = "1-101"

    def __init__(self) -> None:
        """Take a free one; VIRTUAL_AXES_DOMAIN_IDS=50-59 narrows the choice."""
        first, last = map(int, os.environ.get("VIRTUAL_AXES_DOMAIN_IDS", self.RANGE).split("-"))
        for value in random.sample(range(first, last + 1), last - first + 1):
            # Ours against other runs of this file, by a lock that the kernel takes back.
            path = Path(tempfile.gettempdir()) / f"virtual_axes_domain_{os.getuid()}_{value}.lock"
            lock = path.open("w")
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                lock.close()
                continue
            if all(_port_is_free(7400 + 250 * value + offset) for offset in (0, 10, 11)):
                self.value, self._lock = value, lock
                return
            lock.close()
        raise RuntimeError(f"no free ROS_DOMAIN_ID in {first}-{last}")

    def release(self) -> None:
        """Give it back."""
        self._lock.close()


def _port_is_free(port: int) -> bool:
    """Whether nobody listens at the port: DDS shares its ports, so binding alone must fail."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


def node_binary() -> Path:
    """The node's program: VIRTUAL_AXES_NODE, or what `cargo build --release` made."""
    if named := os.environ.get("VIRTUAL_AXES_NODE"):
        return Path(named)
    root = Path(__file__).resolve().parent.parent
    return root / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "virtual_axes_node"


def _die_with_parent() -> None:
    """Linux: end the child when this process dies, however it dies."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG


class Node:
    """A process that runs the node, in a domain of its own, on this machine only."""

    def __init__(
        self,
        ros_args: Sequence[str] = (),
        name: str = DEFAULT_NODE,
        domain_id: int | None = None,
        env: Mapping[str, str] | None = None,
        binary: Path | None = None,
        stderr: int | None = None,
    ):
        """Say what to start; `ros_args` are what follows --ros-args, `name` is the full name they give.

        `stderr` is a file descriptor for it instead of `output()`.
        """
        self.name = name
        self._own_domain = DomainId() if domain_id is None else None
        self.domain_id = self._own_domain.value if self._own_domain else domain_id
        self._command = [str(binary or node_binary()), *(["--ros-args", *ros_args] if ros_args else [])]
        self._env = {
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            **os.environ,
            "ROS_DOMAIN_ID": str(self.domain_id),
            **(env or {}),
        }
        self._stderr = stderr
        self._process: subprocess.Popen[bytes] | None = None
        # Appending: the child shares this file, reading it must not move where it writes.
        self._output = tempfile.TemporaryFile("a+b")

    def __enter__(self) -> Node:
        """Start."""
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop, by force if need be."""
        if self._process is not None and self.poll() is None:
            self.stop()
        if self._own_domain is not None:
            self._own_domain.release()

    def start(self) -> None:
        """Start the program; `Drive(process=...)` waits until it is heard."""
        self._process = subprocess.Popen(
            self._command,
            env=self._env,
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT if self._stderr is None else self._stderr,
            preexec_fn=_die_with_parent,
        )

    @property
    def pid(self) -> int:
        """Process id."""
        assert self._process is not None, "not started"
        return self._process.pid

    def poll(self) -> int | None:
        """Exit status, or None while it runs."""
        return self._process.poll() if self._process is not None else None

    def wait(self, timeout: float) -> int:
        """Exit status of a program that ends by itself; subprocess.TimeoutExpired if it does not."""
        assert self._process is not None, "not started"
        return self._process.wait(timeout)

    def stop(self, number: signal.Signals = signal.SIGINT, timeout: float = 5.0) -> int:
        """Ask the program to end and return its exit status; kills it when it does not (status -9)."""
        assert self._process is not None, "not started"
        if self._process.poll() is None:
            self._process.send_signal(number)
            try:
                self._process.wait(timeout)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait(timeout)
        return self._process.returncode

    def output(self) -> str:
        """What it wrote so far to stdout and stderr."""
        descriptor = self._output.fileno()
        return os.pread(descriptor, os.fstat(descriptor).st_size, 0).decode(errors="replace")
