"""The node in the graph: present soon after its start, absent soon after its end."""

from __future__ import annotations

import signal

from control_msgs.msg import SpeedScalingFactor
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from interface import interfaces
from node_process import Node
from virtual_axes_py.ros import AxesClient


def of_the_node(drive: AxesClient) -> set[str]:
    """Returns topics and services of the node by name."""
    namespace, name = drive.target.rsplit("/", 1)
    if not drive.is_in_graph():
        return set()
    ask = drive.node
    return {
        found
        for get in (
            ask.get_publisher_names_and_types_by_node,
            ask.get_subscriber_names_and_types_by_node,
            ask.get_service_names_and_types_by_node,
        )
        for found, _ in get(name, namespace or "/")
    }


def test_appears_and_disappears_within_two_seconds():
    """All interfaces appear, and none remains afterwards."""
    process = Node()
    rows = [row for row in interfaces() if not row.conditions and row.direction != "action"]
    wanted = {row.resolved(process.name, {}) for row in rows}
    try:
        with AxesClient(process=process, connect=False) as drive:
            process.start()
            drive.wait_for(lambda: wanted <= of_the_node(drive), 2, "complete node in the graph")
            drive.process = None
            assert process.stop(signal.SIGTERM) == 0

            def left() -> list[str]:
                ask = drive.node
                topics = [name for name, _ in ask.get_topic_names_and_types()]
                endpoints = [
                    f"{name} of {info.node_name}"
                    for name in topics
                    for info in (*ask.get_publishers_info_by_topic(name), *ask.get_subscriptions_info_by_topic(name))
                    if info.node_name != drive.name
                ]
                return endpoints + [name for name, _ in ask.get_service_names_and_types() if drive.target in name]

            drive.wait_for(lambda: not drive.is_in_graph() and not left(), 2, "end of the node")
    finally:
        process.__exit__()


def test_incompatible_qos_is_logged_with_the_policy(fast: AxesClient):
    """Both directions; a volatile publisher of a topic that is also received latched is no fault."""
    best_effort = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    fast.in_executor(lambda: fast.node.create_publisher(JointTrajectory, "/psec", best_effort))
    fast.in_executor(lambda: fast.node.create_subscription(JointState, "/joint_states", lambda _: None, latched))
    manual = QoSProfile(depth=5, liveliness=LivelinessPolicy.MANUAL_BY_TOPIC)
    fast.in_executor(
        lambda: fast.node.create_subscription(PoseStamped, f"{fast.target}/tool_pose", lambda _: None, manual)
    )
    fast.in_executor(lambda: fast.node.create_publisher(SpeedScalingFactor, f"{fast.target}/speed_scaling_input", 10))
    for line in (
        f"/psec: the QoS of the publisher of node /{fast.name} does not match (reliability)",
        f"/joint_states: the QoS of the subscription of node /{fast.name} does not match (durability)",
        f"/virtual_axes/tool_pose: the QoS of the subscription of node /{fast.name} does not match (liveliness)",
    ):
        fast.wait_for(lambda: line in fast.process.output(), 5, line)
    assert "speed_scaling_input: the QoS" not in fast.process.output()


def test_type_hash_is_not_sent(fast: AxesClient):
    """Limit of RustDDS (docs/internals/middleware.md). If this test fails, compare the hash with rclpy's."""
    fast.node.create_publisher(JointState, "/joint_states", 10)
    hashes = fast.wait_for(
        lambda: (
            {
                info.node_name: str(info.topic_type_hash).split("_")[0]
                for info in fast.node.get_publishers_info_by_topic("/joint_states")
            }
            if fast.node.count_publishers("/joint_states") == 2
            else None
        ),
        5,
        "both publishers",
    )
    assert hashes == {"virtual_axes": "INVALID", fast.name: "RIHS01"}
