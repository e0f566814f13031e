"""Two machines on one computer, separated by ROS_DOMAIN_ID only."""

from __future__ import annotations

from collections.abc import Callable

from motion import assert_psec, start_swing
from virtual_axes_py.ros import TSP_NS, AxesClient


def test_domains_are_separate(start: Callable[..., AxesClient]):
    """A motion in one domain leaves the other at rest, without a result."""
    moved, still = start(), start()
    assert moved.process.domain_id != still.process.domain_id
    before = still.latest("position")
    _, begin, plan = start_swing(moved, duration=1.2)
    assert_psec(moved, begin, plan)
    still.wait_until(still.now() + 10 * TSP_NS, 5)
    assert still.latest("position") == before
    assert still.results() == []
    assert len(moved.results()) >= 1


def test_two_namespaces_share_a_domain(start: Callable[..., AxesClient]):
    """In one domain the namespaces separate the machines."""
    left = start("-r", "__ns:=/left", name="/left/virtual_axes")
    right = start("-r", "__ns:=/right", name="/right/virtual_axes", domain_id=left.process.domain_id)
    _, begin, plan = start_swing(left, duration=1.2)
    assert_psec(left, begin, plan)
    assert right.latest("psec")["x"] == 0.0
    assert right.results() == []
