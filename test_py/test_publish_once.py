"""Publishers that publish at the match, and end soon after, as `ros2 topic pub --once` does.

The publishers stay for 1 s. Without the request of the node they would repeat a missed sample after 3 s only. The
losses with the 0.1 s of `ros2 topic pub --once` depend on the load of the machine: `tools/measure.py publish-once`.
"""

from __future__ import annotations

from contextlib import ExitStack

from participant import Participant
from virtual_axes_py.ros import AxesClient

TIMES = 20


def test_published_once_arrives_every_time(real: AxesClient):
    """Each publisher names its own nonexistent joint: the rejections identify the messages that arrived."""
    wanted = {f"once_{number}" for number in range(TIMES)}
    with ExitStack() as stack:
        publishers = [
            stack.enter_context(Participant(real.process.domain_id, "once", name, "transient_local", 0.001, 1.0))
            for name in sorted(wanted)
        ]
        for publisher in publishers:
            publisher.wait()

    def lost() -> set[str]:
        return wanted - {result.joint for result in real.results()}

    try:
        real.wait_for(lambda: not lost(), 5, "all of them")
    except TimeoutError:
        raise AssertionError(f"{len(lost())} of {TIMES} lost: {sorted(lost())}") from None
