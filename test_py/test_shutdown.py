"""End of the node on a signal: exit status, duration, and dispose of its endpoints."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable

import pytest

from motion import start_swing
from virtual_axes_py.ros import AxesClient


@pytest.mark.parametrize("moving", [False, True], ids=["at rest", "moving"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_exits_within_a_second_and_disposes_its_endpoints(
    start: Callable[..., AxesClient], number: signal.Signals, moving: bool
):
    """Status 0 within 1 s; removed from rclpy's graph within 2 s, not after the lease of 50 s."""
    drive = start()
    drive.wait_for(drive.is_in_graph, 5, "node in the graph")
    if moving:
        start_swing(drive)
    process, drive.process = drive.process, None
    began = time.monotonic()
    status = process.stop(number, timeout=5)
    took = time.monotonic() - began
    assert status == 0, process.output()
    assert took <= 1.0
    drive.wait_for(lambda: not drive.is_in_graph(), 2, "dispose")
    assert "ERROR" not in process.output()
    assert "panicked" not in process.output()
