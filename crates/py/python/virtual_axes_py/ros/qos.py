"""Quality of service of the topics, for clients of the axes."""

# rclpy has few type hints.
# mypy: disallow-untyped-calls=False

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

PSEC_QOS = QoSProfile(depth=64, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
STREAM_QOS = QoSProfile(depth=1)
"""Reliable, depth 1: the profile of ros2_control's topic-based hardware."""
DEEP_QOS = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST)
"""Depth at which a reader that is two minutes late at 6 ms loses no sample."""
# Deeper than the node's own 50: each trajectory of a burst has two results.
RESULT_QOS = QoSProfile(
    depth=20_000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
