"""Late-joining readers of a topic with many samples: their cost does not grow with the number of samples."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState

from node_process import Node, own_mb
from virtual_axes_py.ros import DEEP_QOS, TSP_NS, AxesClient, joint_trajectory, stamp_of

pytestmark = pytest.mark.extended

TOPIC = "/joint_states"
MANY = 1 << 19
"""Samples after which a topic gets a new DataWriter (crates/dds/src/defects/writer_rotation.rs)."""
MORE = 5_000
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
JOINING = 200
"""Maximum loss while a reader is being matched."""
LATE = 3
SETTLED_S = 5
"""Time without a new participant before a topic gets its next writer, s (`returned_participants.rs` of crates/dds)."""
JOIN_S = 1
"""Lifetime of a joining participant, s."""
MAY_GROW_MB = 1.5
"""Maximum memory of each late reader, MB; half a million sequence numbers take ten times that."""


class Joining:
    """Participants that join the graph and leave, one after the other."""

    def __init__(self, domain_id: int):
        """Sets the domain."""
        self._domain_id = domain_id
        self._end = threading.Event()
        self._joined = [time.monotonic()]
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        while not self._end.is_set():
            context = Context()
            rclpy.init(context=context, domain_id=self._domain_id, signal_handler_options=SignalHandlerOptions.NO)
            node = rclpy.create_node("joining", context=context, enable_rosout=False, start_parameter_services=False)
            self._joined.append(time.monotonic())
            self._end.wait(JOIN_S)
            node.destroy_node()
            rclpy.shutdown(context=context)

    def longest_pause(self) -> float:
        """Returns the longest time without a new participant so far, s."""
        return float(np.diff([*self._joined, time.monotonic()]).max())

    def __enter__(self) -> Joining:
        """Starts the first participant."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Ends the last participant."""
        self._end.set()
        self._thread.join(30)


def test_a_late_reader_costs_no_more_after_half_a_million_samples():
    """The topic has a new writer by then; a subscriber loses nothing, has no duplicates, and keeps the order."""
    with Node(["-p", "time:=fast"]) as process, AxesClient(process=process, keep_samples=False) as drive:
        with pytest.raises(ValueError, match="keep_samples=False has no samples"):
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

        # The next writer is created when no participant has joined for 5 s. Readers that have received the dispose of
        # the first writer discover it.
        drive.in_executor(lambda: drive.node.destroy_subscription(subscription))
        with Joining(process.domain_id) as joining:
            write_many(0.0)
            until = time.monotonic() + SETTLED_S + 3
            while time.monotonic() < until:
                # Read before the time of the last participant, since a writer may be created after it.
                now = writers()
                assert now == second or joining.longest_pause() > SETTLED_S - 1
                time.sleep(0.1)
            assert joining.longest_pause() < SETTLED_S - 1, "participants joined too slowly for this test"
        drive.wait_for(lambda: writers() - second, 20, "next publisher")
