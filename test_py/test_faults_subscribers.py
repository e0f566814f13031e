"""Subscribers that are killed or stopped while the axes move and others subscribe."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from motion import assert_psec, go_home, start_swing
from node_process import resident_mb
from participant import Participant
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory, status_values

STOPPED_S = 20
LEASE_S = 60
"""Lease of stopped processes, s: with the 20 s of Fast DDS they would be removed."""
SHALLOW, DEEP = 10, 20_000
FAST_S = 300.0
"""Machine time of the motion in `fast`, s."""
SHORT_LEASE_S = 3
SILENT_S = 9.0
"""Time for which a process is stopped until its lease has expired and the node has removed it, s."""
RETURN_S = 30.0
"""Timeout for the samples after the return of a participant, s: 5 s to settle, and the announcement period."""
GROWTH_MB = 24.0
"""Maximum memory of 20 s of unread samples of a topic, MB, including discovery data."""


def test_killed_and_stopped_subscribers_do_not_affect_others(real: AxesClient, tmp_path: Path):
    """The axes move in real time, others lose no sample, memory is bounded; later each gets its history depth."""
    go_home(real)
    assert real.process is not None
    pid, domain = real.process.pid, real.process.domain_id
    topic = "/joint_states"
    with (
        Participant(domain, "listen", topic, 100) as killed,
        Participant(domain, "listen", topic, SHALLOW, lease=LEASE_S, folder=tmp_path) as shallow,
        Participant(domain, "listen", topic, DEEP, lease=LEASE_S, folder=tmp_path) as deep,
    ):
        before = resident_mb(pid)
        accepted, start, plan = start_swing(real, duration=STOPPED_S + 1.0)
        killed.kill()
        for participant in (shallow, deep):
            participant.stop()
        stopped = real.now()
        real.wait_until(stopped + STOPPED_S * NANOSECONDS, STOPPED_S + 30)
        resumed = real.now()
        grown = resident_mb(pid) - before
        for participant in (shallow, deep):
            participant.resume()
        # Undisturbed subscribers receive all samples, and the motion is as planned.
        assert_psec(real, start, plan)
        recording = real.record(stopped, resumed)
        for series in (recording.joints, recording.currents, recording.states):
            assert set(np.diff(series.stamp)) == {TSP_NS}
        assert grown < GROWTH_MB, f"{grown:.1f} MB more"
        assert status_values(real.diagnostics()[-1].status[0])["dropped_samples"] == "0"
        # Resumed subscribers receive all new samples, and of the earlier ones their history depth.
        real.wait_until(resumed + 2 * NANOSECONDS, 30)
        until = real.now()
        stamps = {}
        for name, participant in (("shallow", shallow), ("deep", deep)):

            def caught_up(participant: Participant = participant, name: str = name) -> bool:
                stamps[name] = participant.stamps()
                return bool(stamps[name][-1] >= until)

            real.wait_for(caught_up, 20, f"samples of the resumed {name} subscriber")
        assert set(np.diff(stamps["deep"])) == {TSP_NS}, "its history depth is sufficient"
        assert np.all(np.diff(stamps["shallow"]) > 0)
        assert real.end(accepted.sequence_number, 10).status == 2


def test_a_subscriber_that_was_silent_beyond_its_lease_is_matched_again(
    start: Callable[..., AxesClient], tmp_path: Path
):
    """It receives each sample after the match, of the old writer and the next one, and so does another subscriber."""
    drive = start()
    assert drive.process is not None
    with Participant(
        drive.process.domain_id, "listen", "/joint_states", DEEP, lease=SHORT_LEASE_S, folder=tmp_path
    ) as participant:
        drive.wait_for(lambda: len(participant.stamps()) > 0, 20, "samples before the silence")
        participant.stop()
        stopped = drive.now()
        drive.wait_until(stopped + round(SILENT_S * NANOSECONDS), SILENT_S + 30)
        participant.resume()
        resumed = drive.now()

        def continues() -> bool:
            return bool(participant.stamps()[-1] > resumed + 12 * NANOSECONDS)

        drive.wait_for(continues, RETURN_S, "samples after the silence")
        stamps = participant.stamps()
        assert np.all(np.diff(stamps) > 0)
        [gap] = np.flatnonzero(np.diff(stamps) != TSP_NS)
        assert stamps[gap] < resumed, "only the silence is missing"
        assert stamps[gap + 1] < resumed + 10 * NANOSECONDS
        assert set(np.diff(drive.record(stopped, int(stamps[-1])).joints.stamp)) == {TSP_NS}


def test_shallow_subscribers_do_not_stall_fast_axes(start: Callable[..., AxesClient]):
    """Depth as of `ros2 topic echo`: a sample lost before it reaches such a reader is lost without notice."""
    drive = start("-p", "time:=fast")
    assert drive.process is not None
    with ExitStack() as participants:
        for _ in range(3):
            participants.enter_context(Participant(drive.process.domain_id, "sink", SHALLOW))
        recording = drive.run(joint_trajectory(["x"], [0.0, FAST_S], [[0.0], [0.3]]), timeout=120)
    assert set(np.diff(recording.joints.stamp)) == {TSP_NS}
    assert len(recording.joints) == FAST_S * NANOSECONDS / TSP_NS + 1
    assert "stalled reader" not in drive.process.output()
