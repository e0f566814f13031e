"""Four processes at once: trajectory source, node, process model with loads, recorder."""

from __future__ import annotations

from four_processes import DAMPING, run_graph
from motion import RATIO

TORQUE_CONSTANT = 2.64


def test_four_processes_on_an_unbroken_grid():
    """No stamp is missing or duplicated; the load opposes the motion, in proportion to the velocity."""
    figures = run_graph(3.0)
    assert figures.faults() == []
    assert all(len(stamps) > 3.0 / 0.006 for stamps in figures.stamps.values())
    # `load` of motor_currents is positive where it opposes motion in the positive direction.
    # The first loads respond to velocities from before the recording.
    assert figures.answered(DAMPING * RATIO / TORQUE_CONSTANT) > 0.98
