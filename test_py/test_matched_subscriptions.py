"""Messages without matched subscriptions are not built; new subscribers get samples at once, also after others left."""

from __future__ import annotations

import threading
import time

from control_msgs.msg import JointTrajectoryControllerState
from rclpy.subscription import Subscription

from virtual_axes_py.ros import TSP_NS, AxesClient, to_ns

TOPIC = "/virtual_axes/controller_state"
LOOKED_S = 2.5
"""Period at which the node polls its matched subscriptions, s."""
SAMPLES = 50


def test_each_subscriber_gets_an_unbroken_grid_of_samples(real: AxesClient):
    """The node's count of matched subscriptions must not cause lost samples."""
    for _ in range(2):
        stamps: list[int] = []
        came = threading.Event()

        def keep(message: JointTrajectoryControllerState, stamps: list[int] = stamps, came=came) -> None:
            stamps.append(to_ns(message.header.stamp))
            if len(stamps) == SAMPLES:
                came.set()

        def listen(keep=keep) -> Subscription:
            return real.node.create_subscription(JointTrajectoryControllerState, TOPIC, keep, 100)

        subscription = real.in_executor(listen)
        assert came.wait(5), f"{len(stamps)} samples"
        assert {b - a for a, b in zip(stamps[:SAMPLES], stamps[1:SAMPLES])} == {TSP_NS}
        real.in_executor(lambda subscription=subscription: real.node.destroy_subscription(subscription))
        time.sleep(LOOKED_S)
