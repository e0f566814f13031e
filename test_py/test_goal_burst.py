"""Many goals at once: the results of all of them are published, and later ones too."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Iterator

import pytest
from virtual_axes.msg import TrajectoryResult as R

from action import Follow, goal, line
from node_process import die_with_parent
from virtual_axes_py.ros import AxesClient, joint_trajectory

pytestmark = pytest.mark.extended

BURSTS, GOALS = 3, 300
TIMEOUT_S = 60.0


def _spin() -> None:
    die_with_parent()
    while True:
        pass


@pytest.fixture
def busy() -> Iterator[None]:
    """Keeps all cores busy during a test."""
    context = multiprocessing.get_context("forkserver")
    processes = [context.Process(target=_spin, daemon=True) for _ in range(os.cpu_count() or 1)]
    for process in processes:
        process.start()
    yield
    for process in processes:
        process.kill()
        process.join()


def test_results_of_a_burst_of_goals_are_published(real: AxesClient, busy: None) -> None:
    """One in five goals is invalid, results are requested, and half of the goals are canceled."""
    assert real.process is not None
    with Follow(real) as follow:
        for _ in range(BURSTS):
            sent = [follow.send(goal(line(["x" if k % 5 else "q"], [0.001], 2.0))) for k in range(GOALS)]

            def answered(sent: list = sent) -> list:
                return [one for one in sent if one._accepting.done()]

            # Of more requests at once than the depth of the service, the oldest are lost.
            end = time.monotonic() + 10
            while len(answered()) < GOALS and time.monotonic() < end:
                time.sleep(0.05)
            found = answered()
            assert len(found) > GOALS // 10
            for k, one in enumerate(found):
                one.ask()
                if k % 2:
                    real.in_executor(one.handle.cancel_goal_async)
            ids = {one.id for one in found}

            def missing(ids: set[bytes] = ids) -> set[bytes]:
                ended = {bytes(result.goal_id) for result in real.results() if result.status != R.ACCEPTED}
                return ids - ended

            real.wait_for(lambda: not missing(), TIMEOUT_S, "the results of all goals")
            real.drop_samples()
        sequence = real.accept(joint_trajectory(["y"], [0.5], [[0.001]])).sequence_number
        assert real.end(sequence, 20).status == R.COMPLETED
    assert "stalled reader" not in real.process.output()
