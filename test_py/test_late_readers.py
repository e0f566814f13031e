"""Late-joining readers of a topic with many samples: their cost does not grow with the number of samples."""

from __future__ import annotations

import numpy as np
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState

from drive import DEEP_QOS, TSP_NS, Drive, Node, joint_trajectory, own_mb, stamp_of

TOPIC = "/joint_states"
MANY = 1 << 19
"""Samples after which a topic gets a new DataWriter (src/ros/writer_rotation.rs)."""
MORE = 5_000
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
JOINING = 200
"""Maximum loss while a reader is being matched."""
LATE = 3
MAY_GROW_MB = 1.5
"""Maximum memory of each late reader, MB; half a million sequence numbers take ten times that."""


def test_a_late_reader_costs_no_more_after_half_a_million_samples():
    """The topic has a new writer by then; a subscriber loses nothing, has no duplicates, and keeps the order."""
    with Node(["-p", "time:=fast"]) as process, Drive(process=process, listen=False) as drive:
        with pytest.raises(ValueError, match="keeps no samples"):
            drive.record(0, TSP_NS)

        def listen(qos: QoSProfile, stamps: list[int]) -> Subscription:
            def keep(sample: bytes) -> None:
                stamps.append(stamp_of(sample))

            return drive.in_executor(lambda: drive.node.create_subscription(JointState, TOPIC, keep, qos, raw=True))

        def writers() -> set[bytes]:
            return {bytes(info.endpoint_gid) for info in drive.node.get_publishers_info_by_topic(TOPIC)}

        def came() -> int:
            return int(drive.next_status()["endpoints_discovered"])

        early: list[int] = []
        listen(BEST_EFFORT, early)
        drive.wait_for(lambda: early, 10, "first sample")
        first = drive.wait_for(writers, 10, "publisher")
        before_came = came()

        def write_many(target: float) -> None:
            # Best effort: without ACKNACK the axes wait for no reader.
            duration = (MANY + MORE) * TSP_NS / 1e9
            accepted = drive.accept(joint_trajectory(["x"], [duration], [target], [[0.0]]))
            drive.end(accepted.sequence_number, 200)

        write_many(0.05)
        reliable: list[int] = []
        subscription = listen(DEEP_QOS, reliable)
        drive.wait_for(lambda: (now := writers()) != first and len(now) == 1, 90, "only the new publisher")
        drive.wait_for(lambda: len(reliable) > 1000, 30, "samples")
        assert set(np.diff(reliable[JOINING:])) == {TSP_NS}
        second = writers()
        # The middleware announces all readers again when a new publisher appears.
        assert came() == before_came + 1

        before = own_mb(process.pid)
        late: list[list[int]] = [[] for _ in range(LATE)]
        for stamps in late:
            listen(BEST_EFFORT, stamps)
        drive.wait_for(lambda: all(late), 20, "samples of the late readers")
        grown = own_mb(process.pid) - before
        print(f"{LATE} late-joining readers: {grown:.1f} MB")
        assert grown < LATE * MAY_GROW_MB

        # Readers that have received the dispose of the first writer discover the next writer.
        drive.in_executor(lambda: drive.node.destroy_subscription(subscription))
        write_many(0.0)
        drive.wait_for(lambda: writers() - second, 20, "next publisher")
