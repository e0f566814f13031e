"""Services ~/reset and ~/stop."""

from __future__ import annotations

import numpy as np
from virtual_axes.msg import TrajectoryResult as R

from motion import go_home, start_swing
from virtual_axes_py.ros import TSP_NS, AxesClient, joint_trajectory


def test_reset_puts_the_axes_back_to_rest_at_the_start(real: AxesClient):
    """The active motion gets a result; positions and currents equal those of the start exactly."""
    go_home(real)
    home_position, home_current = real.latest("position"), real.latest("voltage")
    accepted, start, _ = start_swing(real, joints=("x", "z", "a"))
    real.wait_until(start + 200 * TSP_NS, 5)
    assert real.latest("position") != home_position
    real.reset()
    assert real.end(accepted.sequence_number, 5).status == R.ABORTED
    real.wait_until(real.now() + 2 * TSP_NS, 5)
    assert real.latest("position") == home_position
    assert real.latest("voltage") == home_current
    assert not any(real.latest("velocity").values())


def test_stop_is_controlled(real: AxesClient):
    """The stop is within the limits of the axis, and the motion gets a result."""
    go_home(real)
    accepted, start, _ = start_swing(real, duration=3.0, amplitude=0.2)
    real.wait_until(start + 125 * TSP_NS, 5)
    real.stop()
    assert real.end(accepted.sequence_number, 5).status == R.STOPPED
    last = real.now() + 200 * TSP_NS
    real.wait_until(last, 5)
    psec = real.record(start, last).states["psec", "x"]
    assert np.abs(np.diff(psec, 2)).max() <= 2.5 * 0.006**2 * (1 + 1e-6)
    assert np.ptp(psec[-50:]) == 0 and 0.01 < psec[-1] < 0.2


def test_services_at_rest_change_nothing(real: AxesClient):
    """Both succeed, and the axes stay where they are."""
    go_home(real)
    before = real.latest("position")
    real.stop()
    real.reset()
    real.wait_until(real.now() + 2 * TSP_NS, 5)
    assert real.latest("position") == before


def test_after_a_stop_a_new_motion_starts_from_there(real: AxesClient):
    """The stop leaves no residual state."""
    go_home(real)
    _, start, _ = start_swing(real, duration=3.0)
    real.wait_until(start + 125 * TSP_NS, 5)
    real.stop()
    real.wait_until(real.now() + 100 * TSP_NS, 5)
    recording = real.run(joint_trajectory(["x"], [1.2], [[0.0]], [[0.0]]))
    assert recording.result.status == R.COMPLETED
    assert recording.states["psec", "x"][-1] == 0.0
