"""Nodes and an rclpy process that start at the same time."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from simultaneous_start import Trial, expected_endpoints

pytestmark = pytest.mark.extended

TRIALS = 9
AT_ONCE = 3
DELAYS_S = (0.0, 0.02, 0.04)


def test_a_process_that_starts_with_the_nodes_discovers_all_their_endpoints():
    """Three trials side by side, with two and four nodes, and the participant of the process up to 40 ms later."""
    expected = expected_endpoints()
    trials = [Trial([2, 4][number % 2], DELAYS_S[number % 3], expected) for number in range(TRIALS)]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = list(pool.map(Trial.run, trials))
    assert [trial.faults(discovered) for trial, discovered in zip(trials, found)] == [[]] * TRIALS
