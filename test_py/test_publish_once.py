"""Publishers that publish at the match, and end soon after, as `ros2 topic pub --once` does.

The publishers stay for 1 s. Without the request of the node they would repeat a missed sample after 3 s only. The
losses with the 0.1 s of `ros2 topic pub --once` depend on the load of the machine: tools/measure_publish_once.py.
"""

from __future__ import annotations

import os
import subprocess
import sys

from virtual_axes_py.ros import AxesClient

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
print("published", flush=True)
time.sleep(1.0)
node.destroy_node()
rclpy.shutdown()
"""


def test_published_once_arrives_every_time(real: AxesClient):
    """Each publisher names its own nonexistent joint: the rejections identify the messages that arrived."""
    env = {**os.environ, "ROS_DOMAIN_ID": str(real.process.domain_id)}
    publishers = []
    try:
        for number in range(TIMES):
            command = [sys.executable, "-c", PUBLISHER, str(number), "/psec"]
            publishers.append(subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True))
            assert publishers[-1].stdout.readline() == "published\n"
        for publisher in publishers:
            assert publisher.wait(30) == 0
    finally:
        for publisher in publishers:
            publisher.kill()
            publisher.wait()
            publisher.stdout.close()
    wanted = {f"once_{number}" for number in range(TIMES)}

    def arrived() -> bool:
        return wanted <= {result.joint for result in real.results()}

    try:
        real.wait_for(arrived, 5, "all of them")
    except TimeoutError:
        lost = sorted(wanted - {result.joint for result in real.results()})
        raise AssertionError(f"{len(lost)} of {TIMES} lost: {lost}") from None
