"""External forces on the topic `load`, as from a process model."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from motion import RATIO, go_home
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient

TORQUE_CONSTANT = 2.64
FORCE = 2000.0
"""Load, N, above static friction: 2.41 A against 1.04 A."""


def test_load_moves_the_axis_and_times_out(real: AxesClient):
    """A positive load pushes in the positive direction against the motor; it ends 0.1 s after the last message."""
    go_home(real)
    begin = real.now()
    for _ in range(25):
        real.load({"x": FORCE})
        time.sleep(0.02)
    end = real.now() + NANOSECONDS // 2
    real.wait_until(end, 5)
    recording = real.record(begin, end)
    load, current = (recording.currents[field, "x"] for field in ("load", "current"))
    assert load.min() == pytest.approx(-FORCE * RATIO / TORQUE_CONSTANT, rel=1e-12)
    assert load.max() <= 0.0
    assert load[-1] == 0.0
    assert not recording.currents["load", "y"].any()
    # Steady state under load: the motor supplies what exceeds friction.
    assert current.min() < -(FORCE * RATIO / TORQUE_CONSTANT - 1.043) * 0.9
    assert recording.joints["position", "x"].max() > 1e-7
    assert np.abs(recording.joints["position", "x"]).max() < 1e-3


def test_load_of_an_unknown_joint_is_ignored(real: AxesClient):
    """The message is ignored; the axes stay where they are."""
    go_home(real)
    before = real.latest("position")
    real.load({"q": 1e6})
    real.load({"x": math.nan})
    real.load({"x": math.inf})
    real.wait_until(real.now() + 20 * TSP_NS, 5)
    assert real.latest("position") == before
