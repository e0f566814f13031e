"""Quality of service of the topics, as whoever drives the axes wants it."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

PSEC_QOS = QoSProfile(depth=64, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
STREAM_QOS = QoSProfile(depth=1)
"""Reliable, of one sample: as ros2_control's topic-based hardware publishes."""
DEEP_QOS = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST)
"""Deep enough that a reader which is late by two minutes at 6 ms loses nothing."""
# Deeper than the node's own 50: a burst of trajectories has two results each.
RESULT_QOS = QoSProfile(
    depth=20_000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
