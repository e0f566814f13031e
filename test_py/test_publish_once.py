"""`ros2 topic pub --once`: waits for one match, publishes, and leaves 0.1 s later."""

from __future__ import annotations

import os
import subprocess
import sys

from drive import Drive

TIMES = 20

# Equivalent of ros2 topic pub in a separate process, without its slow polling.
PUBLISHER = """
import sys, time
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

rclpy.init()
node = rclpy.create_node("once_" + sys.argv[1])
profile = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
publisher = node.create_publisher(JointTrajectory, sys.argv[2], profile)
deadline = time.monotonic() + 10
while publisher.get_subscription_count() < 1:
    if time.monotonic() > deadline:
        sys.exit("no subscriber")
    time.sleep(0.001)
publisher.publish(JointTrajectory(joint_names=["once_" + sys.argv[1]], points=[JointTrajectoryPoint(positions=[0.0])]))
time.sleep(0.1)
node.destroy_node()
rclpy.shutdown()
"""


def test_published_once_arrives_every_time(real: Drive):
    """Each publisher names its own nonexistent joint: the rejections identify the messages that arrived."""
    env = {**os.environ, "ROS_DOMAIN_ID": str(real.process.domain_id)}
    for number in range(TIMES):
        subprocess.run([sys.executable, "-c", PUBLISHER, str(number), "/psec"], env=env, check=True, timeout=30)
    wanted = {f"once_{number}" for number in range(TIMES)}

    def arrived() -> bool:
        return wanted <= {result.joint for result in real.results()}

    try:
        real.wait_for(arrived, 5, "all of them")
    except TimeoutError:
        lost = sorted(wanted - {result.joint for result in real.results()})
        raise AssertionError(f"{len(lost)} of {TIMES} lost: {lost}") from None
