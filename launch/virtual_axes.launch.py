"""Start the virtual axes in a ROS 2 graph.

ros2 launch virtual_axes virtual_axes.launch.py machine:=my_machine.yaml namespace:=cell time:=fast
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def start_node(context: LaunchContext) -> list[Node]:
    """Make the node; without a machine file it runs the embedded machine."""
    argument = {
        key: LaunchConfiguration(key).perform(context) for key in ("machine", "namespace", "name", "time", "log_level")
    }
    parameters: list[object] = [argument["machine"]] if argument["machine"] else []
    parameters.append({"time": argument["time"]})
    return [
        Node(
            package="virtual_axes",
            executable="virtual_axes_node",
            name=argument["name"],
            namespace=argument["namespace"],
            parameters=parameters,
            arguments=["--ros-args", "--log-level", argument["log_level"]],
            output="screen",
        )
    ]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the node."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "machine", default_value="", description="Parameter file of the machine; empty: the embedded one"
            ),
            DeclareLaunchArgument("namespace", default_value="", description="Namespace of the node"),
            DeclareLaunchArgument("name", default_value="virtual_axes", description="Name of the node"),
            DeclareLaunchArgument(
                "time",
                default_value="real",
                choices=["real", "fast"],
                description="Real time, or as fast as possible with a /clock of its own",
            ),
            DeclareLaunchArgument("log_level", default_value="info", description="Level of the node's log"),
            OpaqueFunction(function=start_node),
        ]
    )
