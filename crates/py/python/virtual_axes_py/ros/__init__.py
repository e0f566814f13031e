"""ROS 2 client of the node `virtual_axes_node`: sends setpoints and returns the axes' messages as NumPy arrays.

    import numpy as np
    from virtual_axes_py.ros import AxesClient, ballbar, joint_trajectory

    with AxesClient() as axes:
        path = ballbar()
        recording = axes.run(joint_trajectory(["x", "y"], path.time, np.column_stack([path.x, path.y])))
        deviation = recording.radial_deviation(path.center, path.radius)[recording.within(path.steady)]
        print(f"{deviation.mean() * 1e6:.1f} µm")

Needs rclpy and the messages of the package `virtual_axes`, which come from a ROS 2 distribution and its workspace, not
from PyPI: source the setup file of the workspace. `import virtual_axes_py` alone does not import them. Units are SI (m,
rad, s, A); stamps are integer ns of the node's clock.
"""

try:
    import rclpy as _rclpy
    import virtual_axes.msg as _messages
except ImportError as error:
    raise ImportError(
        f"virtual_axes_py.ros needs rclpy and the messages of the ROS package virtual_axes ({error}); "
        "source the setup file of the ROS 2 workspace in which it was built, or .build/env.sh of the checkout",
        name=error.name,
    ) from error
else:
    del _rclpy, _messages

from .client import (
    DEFAULT_NODE,
    RECORDING_KEYS,
    AxesClient,
    TrajectoryRejected,
    stamp_of,
    status_values,
)
from .graph_node import SETTLE_S, Process
from .qos import DEEP_QOS, PSEC_QOS, RESULT_QOS, STREAM_QOS
from .recording import Recording, Series, circular_deviation
from .services import ParameterRejected, parameter_messages
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
    "AxesClient",
    "Ballbar",
    "ParameterRejected",
    "Process",
    "Recording",
    "Series",
    "TrajectoryRejected",
    "ballbar",
    "circular_deviation",
    "joint_trajectory",
    "parameter_messages",
    "stamp_of",
    "status_values",
    "to_ns",
    "to_time",
]
