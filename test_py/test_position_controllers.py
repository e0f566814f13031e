"""Position controllers by parameters: rejection of invalid ones, execution of valid ones."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from virtual_axes.msg import TrajectoryResult as R

from motion import assert_psec, go_home, start_swing, swing
from node_process import node_binary
from virtual_axes_py.ros import TSP_NS, AxesClient, ParameterRejected, joint_trajectory

LOOP = "x.position_loop"
UNSTABLE = {"controller": "rst", "rst.r": [250.0], "rst.s": [1.0], "rst.t": [250.0]}
"""Proportional controller with ten times the gain: unstable with the lag of the velocity loop."""


def of_x(values: dict[str, object]) -> dict[str, object]:
    """Returns parameters of X's position loop."""
    return {f"{LOOP}.{key}": value for key, value in values.items()}


def design() -> dict[str, object]:
    """Returns the design of `virtual_axes design gpc` for X with the tuning of the machine file."""
    command = [str(Path(node_binary()).with_name("virtual_axes")), "design", "gpc", "--axis", "x", "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
    return json.loads(done.stdout)["axes"]["x"]


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"gpc.n1": 15}, [f"{LOOP}.gpc.n1", f"{LOOP}.gpc.n2", "15", "14"]),
        ({"gpc.nu": 15}, [f"{LOOP}.gpc.nu", f"{LOOP}.gpc.n2", "15", "14"]),
        ({"gpc.n2": 11}, [f"{LOOP}.gpc.nu", f"{LOOP}.gpc.n2", "12", "11"]),
        ({"controller": "gpc", "gpc.n1": 9, "gpc.n2": 8, "gpc.nu": 6}, [f"{LOOP}.gpc.n1", "9", "8"]),
        # Without a weight this number of increments is not determined.
        (
            {"controller": "gpc", "gpc.n2": 200, "gpc.nu": 200, "gpc.lambda": 0.0},
            ["axis x", "singular", "n2 = 200", "nu = 200", "lambda = 0"],
        ),
        ({"gpc.lambda_rel": -1e-3}, [f"{LOOP}.gpc.lambda_rel", "-1e-3|-0.001"]),
        ({"gpc.lambda": -1.0}, [f"{LOOP}.gpc.lambda", "-1"]),
        ({"controller": "pid"}, [f"{LOOP}.controller", "pid", "cascade", "gpc", "rst"]),
        ({"controller": "rst"}, [f"{LOOP}.rst.r"]),
        (
            {"controller": "rst", "rst.r": [25.0], "rst.s": [1.0], "rst.t": [24.0]},
            ["axis x", r"T\(1\) = 24", r"R\(1\) = 25"],
        ),
        ({"rst.t": [25.0, float("nan")]}, [f"{LOOP}.rst.t", "NaN"]),
        (UNSTABLE, ["axis x", "unstable", "pole"]),
    ],
    ids=lambda value: ",".join(value) if isinstance(value, dict) else "",
)
def test_an_invalid_controller_is_rejected_and_the_motion_continues(
    values: dict[str, object], words: list[str], real: AxesClient
):
    """The reason has the key or the axis and the numbers; the configuration is unchanged."""
    go_home(real)
    accepted, start, planned = start_swing(real, duration=6.0)
    real.wait_until(start + 20 * TSP_NS, 10)
    keys = list(of_x({**dict.fromkeys(UNSTABLE), **values}))
    before = real.get_parameters(keys)
    with pytest.raises(ParameterRejected) as rejection:
        real.set_parameters_atomically(of_x(values))
    for word in words:
        assert re.search(word, str(rejection.value), re.IGNORECASE), f"no {word} in: {rejection.value}"
    assert real.get_parameters(keys) == before

    rejected_at = real.now()
    end = min(rejected_at + 50 * TSP_NS, start + (len(planned["x"]) - 1) * TSP_NS)
    assert_psec(real, start, planned, last=end)
    states = real.record(start, end).states
    assert set(states["controller", "x"]) == {"cascade"}
    # Following error of the cascade on a motion as slow as this one.
    assert np.abs(states["synchronized_tracking_error", "x"]).max() < 100e-6
    # No result reports an early end.
    assert {result.status for result in real.results(accepted.sequence_number)} <= {R.ACCEPTED, R.COMPLETED}


def test_an_unstable_loop_is_rejected_with_its_pole_unless_allowed(start: Callable[..., AxesClient]):
    """The pole is that of A S + B R; with allow_unstable the axis oscillates."""
    drive = start()
    model = design()["model"]
    (gain,) = UNSTABLE["rst.r"]
    poles = np.roots(np.array(model["a"]) + gain * np.array(model["b_s"]))
    worst = poles[np.abs(poles).argmax()]
    assert abs(worst) > 1
    with pytest.raises(ParameterRejected) as rejection:
        drive.set_parameters_atomically(of_x(UNSTABLE))
    named = re.search(r"pole (-?[\d.]+) [+±] ([\d.]+)j has the modulus ([\d.]+)", str(rejection.value))
    assert named, rejection.value
    assert [float(number) for number in named.groups()] == pytest.approx(
        [worst.real, abs(worst.imag), abs(worst)], abs=1e-5
    )

    drive.set_parameters_atomically(of_x({**UNSTABLE, "allow_unstable": True}))
    _, begin, _ = start_swing(drive, duration=1.5)
    drive.wait_until(begin + 250 * TSP_NS, 20)
    forced = drive.record(begin, begin + 250 * TSP_NS)
    assert set(forced.states["controller", "x"]) == {"rst"}
    assert forced.currents["saturated", "x"].any()
    assert not forced.currents["saturated", "y"].any()

    # The flag cannot be reset while the controller requires it, only together with it.
    with pytest.raises(ParameterRejected, match="unstable"):
        drive.set_parameters({f"{LOOP}.allow_unstable": False})
    drive.set_parameters_atomically(of_x({"allow_unstable": False, "controller": "cascade"}))
    drive.wait_for(lambda: drive.latest("controller")["x"] == "cascade", 10, "controller cascade")
    assert drive.get_parameters([f"{LOOP}.allow_unstable"]) == {f"{LOOP}.allow_unstable": False}


def test_a_predictive_controller_equals_its_polynomials(start: Callable[..., AxesClient]):
    """The polynomials of `virtual_axes design gpc` as arrays of doubles give the same bits as the design."""
    found = design()
    polynomials = {
        "rst.r": found["r_per_s"],
        "rst.s": found["s"],
        "rst.t": found["t_per_s"],
        "rst.t_first": found["t_first"],
    }
    given = [word for key, value in of_x(polynomials).items() for word in ("-p", f"{key}:={value}")]
    drive = start("-p", "time:=fast", "-p", f"{LOOP}.controller:=rst", *given)
    assert drive.get_parameters(list(of_x(polynomials))) == of_x(polynomials)
    time, position = swing(3.0, rest=0.1)

    def run(controller: str) -> dict[tuple[str, str], np.ndarray]:
        go_home(drive)
        recording = drive.run(joint_trajectory(["x", "y"], time, np.column_stack([position, -position])), settle=0.5)
        assert set(recording.states["controller", "x"]) == {controller}
        assert np.abs(recording.states["velocity", "x"]).max() > 0.04
        return {
            ("position", "x"): recording.joints["position", "x"],
            ("velocity", "x"): recording.joints["velocity", "x"],
            ("velocity_setpoint", "x"): recording.states["velocity_setpoint", "x"],
            ("voltage", "x"): recording.states["voltage", "x"],
            ("current", "x"): recording.currents["current", "x"],
            ("position", "y"): recording.joints["position", "y"],
        }

    by_arguments = run("rst")
    drive.set_parameters({f"{LOOP}.controller": "gpc"})
    designed = run("gpc")
    drive.set_parameters_atomically(of_x({"controller": "rst", **polynomials}))
    by_service = run("rst")
    for series, wanted in designed.items():
        np.testing.assert_array_equal(by_arguments[series], wanted, err_msg=str(series))
        np.testing.assert_array_equal(by_service[series], wanted, err_msg=str(series))

    # Half of it is another controller: the comparison can fail.
    drive.set_parameters_atomically(
        of_x({key: (np.array(polynomials[key]) / 2).tolist() for key in ("rst.r", "rst.t")})
    )
    assert (run("rst")["position", "x"] != designed["position", "x"]).any()
