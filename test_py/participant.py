"""Remote DDS participants, each a separate process that can be stopped and killed: this file as a program.

    python test_py/participant.py listen TOPIC DEPTH  reliable; writes the received stamps for each input line
    python test_py/participant.py send POINTS         one trajectory with this number of points on psec
    python test_py/participant.py sink DEPTH          reliable; drops joint_states, motor_currents, drive_states
    python test_py/participant.py once NAME DURABILITY POLL KEEP_ALIVE
                                                      a trajectory of a joint NAME when psec is matched, polled every
                                                      POLL s, as `ros2 topic pub --once`; leaves KEEP_ALIVE s later

Each writes a line to standard output when it is ready, and ends with its parent process.
"""

from __future__ import annotations

import contextlib
import json
import os
import struct
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration
from rclpy._rclpy_pybind11 import InvalidHandle, RCLError
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from virtual_axes.msg import DriveStates, MotorCurrents

from line_process import PATIENCE_S, LineProcess
from node_process import separate_output
from virtual_axes_py.ros import DEEP_QOS, PSEC_QOS, SETTLE_S, stamp_of

READY = "ready"
SPINS = "spins"
"""Name of the thread that spins a node."""
LEASE = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="lease" is_default_profile="true"><rtps><builtin><discovery_config>
    <leaseDuration><sec>{lease}</sec></leaseDuration>
    <leaseAnnouncement><sec>{seconds}</sec><nanosec>{nanoseconds}</nanosec></leaseAnnouncement>
  </discovery_config></builtin></rtps></participant>
</profiles>
"""


class Participant(LineProcess):
    """Process that runs this file."""

    def __init__(
        self,
        domain_id: int,
        *words: object,
        lease: int | None = None,
        announces_s: float = 0.3,
        folder: Path | None = None,
    ):
        """Starts the process; `lease` is its lease duration in s, set with the announcement period by a profile in
        `folder`.
        """
        env = {"ROS_DOMAIN_ID": str(domain_id)}
        if lease is not None:
            profile = folder / f"lease_{lease}_{announces_s}.xml"
            seconds, nanoseconds = divmod(round(announces_s * 1e9), 1_000_000_000)
            profile.write_text(LEASE.format(lease=lease, seconds=seconds, nanoseconds=nanoseconds))
            env["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(profile)
        super().__init__(__file__, *words, env=env)

    def __enter__(self) -> Participant:
        """Waits until the process is ready and returns itself."""
        try:
            assert self.read_line() == READY
        except BaseException:
            self.kill()
            raise
        return self

    def stamps(self) -> np.ndarray:
        """Returns the stamps that a listener has received so far, ns."""
        self.go_on()
        return np.array(json.loads(self.read_line()), dtype=np.int64)

    def leave(self) -> None:
        """Lets a sink leave the graph regularly."""
        self.go_on()
        self.wait()


def long_trajectory(points: int, joints: tuple[str, str] = ("y", "z")) -> bytes:
    """Returns a serialized swing of two joints with a point per millisecond: half a million objects take long."""
    values, stamp = (0.25, 0.75), (7, 13)
    known = [*(struct.pack("<d", value) for value in values), struct.pack("<iI", *stamp)]
    point = JointTrajectoryPoint(positions=values, time_from_start=Duration(sec=stamp[0], nanosec=stamp[1]))
    two = serialize_message(JointTrajectory(joint_names=joints, points=[point, point]))
    # Number of points, then number of positions of the first point, aligned to 8 octets.
    count_at = two[: two.index(known[0])].rindex(struct.pack("<II", 2, len(values)))
    second = two.index(known[-1]) + len(known[-1])
    template = two[second : two.index(known[-1], second) + len(known[-1])]
    first = bytearray(two[:second])
    first[count_at : count_at + 4] = struct.pack("<I", points)
    rows = np.tile(np.frombuffer(template, dtype=np.uint8), (points - 1, 1))
    milliseconds = np.arange(1, points, dtype=np.int64)
    seconds = milliseconds / 1000
    position = 0.02 * np.sin(seconds / 5) * np.minimum(1, seconds / 5)
    stamps = np.column_stack([milliseconds // 1000, milliseconds % 1000 * 1_000_000]).astype(np.int32)
    for wanted, column in zip(known, (position, position, stamps)):
        place = template.index(wanted)
        rows[:, place : place + 8] = column.view(np.uint8).reshape(points - 1, 8)
        first = first.replace(wanted, bytes(8))
    return bytes(first) + rows.tobytes()


# ------------------------------------------------------------------------------------ the programs


def spin(node: Any) -> threading.Thread:
    """Spins a node in its own thread until rclpy is shut down."""

    def run() -> None:
        # The exception of rclpy at shutdown depends on its state.
        with contextlib.suppress(ExternalShutdownException, InvalidHandle, RCLError):
            rclpy.spin(node)

    thread = threading.Thread(target=run, name=SPINS, daemon=True)
    thread.start()
    return thread


def listen(node: Any, topic: str, depth: int) -> None:
    """Keeps stamps and writes all of them for each input line."""
    stamps: list[int] = []
    qos = QoSProfile(depth=depth, reliability=DEEP_QOS.reliability)
    node.create_subscription(JointState, topic, lambda raw: stamps.append(stamp_of(raw)), qos, raw=True)
    spin(node)
    while not stamps:
        time.sleep(0.01)
    print(READY, flush=True)
    for _ in sys.stdin:
        print(json.dumps(stamps), flush=True)


def send(node: Any, points: int) -> None:
    """Publishes one long serialized trajectory after an input line, so that all the time is spent on sending."""
    psec = node.create_publisher(JointTrajectory, "/psec", PSEC_QOS)
    message = long_trajectory(points)
    while psec.get_subscription_count() == 0:
        time.sleep(0.01)
    time.sleep(SETTLE_S)
    print(READY, flush=True)
    sys.stdin.readline()
    psec.publish(message)
    print("sent", flush=True)
    sys.stdin.readline()


def sink(node: Any, depth: int) -> None:
    """Subscribes and drops the samples."""
    come = threading.Event()
    for kind, topic in (
        (JointState, "/joint_states"),
        (MotorCurrents, "/virtual_axes/motor_currents"),
        (DriveStates, "/virtual_axes/drive_states"),
    ):
        node.create_subscription(kind, topic, lambda _: come.set(), QoSProfile(depth=depth), raw=True)
    spin(node)
    come.wait()
    print(READY, flush=True)
    sys.stdin.readline()


def once(node: Any, name: str, durability: str, poll_s: float, keep_alive_s: float) -> None:
    """Publishes a trajectory of a joint as soon as psec is matched."""
    is_kept = durability == "transient_local"
    profile = QoSProfile(
        depth=1 if is_kept else 10,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_kept else DurabilityPolicy.VOLATILE,
    )
    psec = node.create_publisher(JointTrajectory, "/psec", profile)
    while psec.get_subscription_count() == 0:
        time.sleep(poll_s)
    psec.publish(JointTrajectory(joint_names=[name], points=[JointTrajectoryPoint(positions=[0.0])]))
    print(READY, flush=True)
    time.sleep(keep_alive_s)


def main() -> None:
    """Runs the role of the command line."""
    separate_output()
    rclpy.init()
    node = rclpy.create_node(f"participant_{os.getpid()}", enable_rosout=False, start_parameter_services=False)
    match sys.argv[1:]:
        case ["listen", topic, depth]:
            listen(node, topic, int(depth))
        case ["send", points]:
            send(node, int(points))
        case ["sink", depth]:
            sink(node, int(depth))
        case ["once", name, durability, poll_s, keep_alive_s]:
            once(node, name, durability, float(poll_s), float(keep_alive_s))
        case _:
            sys.exit(__doc__)
    rclpy.try_shutdown()
    for thread in threading.enumerate():
        if thread.name == SPINS:
            thread.join(PATIENCE_S)
    # Destroys the participant: without dispose, others count it as present until its lease expires.
    node.destroy_node()
    os._exit(0)


if __name__ == "__main__":
    main()
