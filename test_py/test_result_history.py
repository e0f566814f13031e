"""Results of trajectories for readers that join later, by their durability."""

from __future__ import annotations

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from virtual_axes.msg import TrajectoryResult

from virtual_axes_py.ros import AxesClient, joint_trajectory

TRAJECTORIES = 100
DEPTH = 50
"""Default depth of `~/trajectory_result`."""


@pytest.mark.parametrize(("durability", "kept"), [("VOLATILE", 0), ("TRANSIENT_LOCAL", DEPTH)])
def test_a_later_reader_gets_the_declared_history(fast: AxesClient, durability: str, kept: int) -> None:
    """A hundred trajectories have two results each: accepted and completed."""
    for _ in range(TRAJECTORIES):
        sequence = fast.accept(joint_trajectory(["x"], [0.0, 0.012], [[0.0], [0.0]])).sequence_number
        fast.end(sequence, 10)
    before = fast.results()
    found: list[TrajectoryResult] = []
    qos = QoSProfile(depth=1000, durability=DurabilityPolicy[durability])
    subscription = fast.node.create_subscription(
        TrajectoryResult, f"{fast.target}/trajectory_result", found.append, qos
    )
    try:
        fast.wait_for(lambda: len(found) >= kept, 10, "kept results")
        # A new result is behind those that are kept. It is repeated, since a volatile reader can miss the first.
        last = 0

        def has_new() -> bool:
            nonlocal last
            last = fast.accept(joint_trajectory(["x"], [0.0, 0.012], [[0.0], [0.0]])).sequence_number
            fast.end(last, 10)
            return any(result.sequence_number == last for result in found)

        fast.wait_for(has_new, 20, "a new result")
        number = max(result.sequence_number for result in before)
        old = [result for result in found if result.sequence_number <= number]
        assert len(old) == kept
        key = [(result.sequence_number, result.status) for result in before[len(before) - kept :]]
        assert [(result.sequence_number, result.status) for result in old] == key
    finally:
        fast.in_executor(lambda: fast.node.destroy_subscription(subscription))
