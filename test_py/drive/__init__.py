"""Python client of the virtual axes: an example for users, used by the tests and the demo.

    with Node(["-p", "time:=fast"]) as process, Drive(process=process) as drive:
        path = ballbar()
        recording = drive.run(joint_trajectory(["x", "y"], path.time, np.column_stack([path.x, path.y])))
        deviation = recording.radial_deviation(path.center, path.radius)[recording.within(path.steady)]
        print(f"{deviation.mean() * 1e6:.1f} µm")

`trajectories` makes setpoints, `client` sends them and keeps what comes back, `recording` makes arrays of it, and
`process` starts a node of one's own.

Needs rclpy and this package's messages: `tools/setup.sh && source .build/env.sh`, or a ROS 2 Jazzy
workspace with virtual_axes built. Units are SI (m, rad, s, A); times of the node are integer ns.
"""

from .client import (
    RECORDING_KEYS,
    SETTLE_S,
    Drive,
    ParameterRejected,
    TrajectoryRejected,
    parameter_messages,
    stamp_of,
    status_values,
)
from .process import DEFAULT_NODE, DomainId, Node, die_with_parent, node_binary, own_mb, resident_mb, status_of
from .qos import DEEP_QOS, PSEC_QOS, RESULT_QOS, STREAM_QOS
from .recording import Recording, Series, circular_deviation
from .trajectories import NANOSECONDS, TSP_NS, Ballbar, ballbar, joint_trajectory, to_ns, to_time

__all__ = [
    "DEEP_QOS",
    "DEFAULT_NODE",
    "NANOSECONDS",
    "PSEC_QOS",
    "RECORDING_KEYS",
    "RESULT_QOS",
    "SETTLE_S",
    "STREAM_QOS",
    "TSP_NS",
    "Ballbar",
    "DomainId",
    "Drive",
    "Node",
    "ParameterRejected",
    "Recording",
    "TrajectoryRejected",
    "Series",
    "ballbar",
    "circular_deviation",
    "die_with_parent",
    "joint_trajectory",
    "node_binary",
    "own_mb",
    "parameter_messages",
    "resident_mb",
    "stamp_of",
    "status_of",
    "status_values",
    "to_ns",
    "to_time",
]
