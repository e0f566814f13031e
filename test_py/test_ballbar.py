"""Circle of the paper's figure 10, measured on the published positions."""

import numpy as np
import pytest

from motion import assert_psec, go_home
from virtual_axes_py.ros import AxesClient, Recording, ballbar, joint_trajectory

PATH = ballbar()
FEEDFORWARD = [f"{axis}.feedforward.{part}" for axis in "xy" for part in ("velocity", "torque_kg_m2")]


def run(drive: AxesClient) -> Recording:
    """Runs the circle once, from home."""
    go_home(drive)
    return drive.run(joint_trajectory(["x", "y"], PATH.time, np.column_stack([PATH.x, PATH.y])))


def deviation_um(recording: Recording) -> np.ndarray:
    """Returns the radial deviation at steady feed, µm."""
    return recording.radial_deviation(PATH.center, PATH.radius)[recording.within(PATH.steady)] * 1e6


def test_path_is_the_specified_one():
    """The path turns by 4 pi at full feed and by v T / R in the ramps, without a step in the feed."""
    feed = np.hypot(np.diff(PATH.x), np.diff(PATH.y)) / np.diff(PATH.time)
    assert PATH.x[0] == 0 and PATH.y[0] == 0
    assert feed.max() == pytest.approx(0.25, rel=1e-4)
    assert np.abs(np.diff(feed)).max() <= 0.25 / 2 * np.pi / 0.5 * 0.006 * 1.01
    turned = np.unwrap(np.arctan2(PATH.y, PATH.x + 0.15))[-1]
    assert turned == pytest.approx(4 * np.pi + 0.25 * 0.5 / 0.15, abs=1e-12)


def test_with_feedforward_the_circle_is_49_um_too_large(fast: AxesClient):
    """[P] figure 10, left: 50 µm."""
    recording = run(fast)
    assert_psec(fast, recording.start, {"x": PATH.x, "y": PATH.y})
    deviation = deviation_um(recording)
    assert deviation.mean() == pytest.approx(49.0, abs=0.5)
    assert deviation.min() == pytest.approx(47.7, abs=1.5)
    assert deviation.max() < 68.6 + 1.5


def test_without_feedforward_the_circle_is_283_um_too_small(fast: AxesClient):
    """Feedforward is switched off by parameter while the node runs, and on again."""
    before = fast.get_parameters(FEEDFORWARD)
    fast.set_parameters(dict.fromkeys(FEEDFORWARD, 0.0))
    try:
        recording = run(fast)
    finally:
        fast.set_parameters(before)
    assert not recording.states["velocity_feedforward", "x"].any()
    assert not recording.states["torque_feedforward", "y"].any()
    assert deviation_um(recording).mean() == pytest.approx(-283.1, abs=1.5)


def test_errors_in_the_result_are_those_of_the_samples(fast: AxesClient):
    """The figures per axis of the result equal those of the samples of the same motion."""
    recording = run(fast)
    result = recording.result
    for column, joint in enumerate(result.name):
        error = np.abs(recording.states["tracking_error", joint])
        synchronized = np.abs(recording.states["synchronized_tracking_error", joint])
        # The node also evaluates the settling after the last point; the samples end before it.
        assert result.max_tracking_error[column] >= error.max()
        assert result.max_synchronized_tracking_error[column] == pytest.approx(synchronized.max(), rel=1e-9)
        assert result.peak_current[column] >= np.abs(recording.currents["current", joint]).max()
    for joint in ("x", "y"):
        np.testing.assert_array_equal(recording.following_error(joint), recording.states["tracking_error", joint])
        np.testing.assert_allclose(
            recording.delay_compensated_following_error(joint)[2:],
            recording.states["synchronized_tracking_error", joint][2:],
            atol=1e-15,
        )


def test_the_same_circle_twice_is_the_same_bit_for_bit(fast: AxesClient):
    """From home, positions and currents do not depend on earlier motions."""
    first, second = run(fast), run(fast)
    for series in ("joints", "currents", "states"):
        a, b = getattr(first, series), getattr(second, series)
        for field in ("position",) if series != "currents" else ("current",):
            np.testing.assert_array_equal(a[field], b[field])
