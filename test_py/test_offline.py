"""Online equals offline: the node's samples are bit-identical to the trace of `virtual_axes run`."""

from __future__ import annotations

import csv
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from motion import swing
from node_process import node_binary
from virtual_axes_py.ros import TSP_NS, AxesClient, Recording, joint_trajectory

AXES = ["x", "y", "z", "a", "c"]
AMPLITUDES = [0.05, -0.03, 0.02, 0.4, 1.0]
"""Amplitudes, m on linear axes, rad on rotary axes."""


def plan() -> tuple[np.ndarray, np.ndarray]:
    """Returns a motion of all five axes, each with its own frequency, from home and back."""
    time, base = swing(3.0, amplitude=1.0)
    turns = [1, 2, 3, 1, 2]
    phase = np.clip(time / time[-1], 0, 1)
    columns = [a / 2 * (1 - np.cos(2 * np.pi * n * phase)) for a, n in zip(AMPLITUDES, turns)]
    return time, np.column_stack(columns)


Offline = Callable[[str], dict[str, np.ndarray]]


@pytest.fixture(scope="module")
def offline(tmp_path_factory: pytest.TempPathFactory) -> Offline:
    """Returns a function that runs the command line with a position controller; it returns the trace by column."""
    folder = tmp_path_factory.mktemp("offline")
    psec = folder / "psec.csv"
    time, positions = plan()
    with psec.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *AXES])
        # repr of a float is read back exactly.
        writer.writerows([repr(float(t)), *map(repr, map(float, row))] for t, row in zip(time, positions))

    @cache
    def run(controller: str) -> dict[str, np.ndarray]:
        trace = folder / f"{controller}.csv"
        program = str(Path(node_binary()).with_name("virtual_axes"))
        command = [program, "run", str(psec), "--controller", controller, "--trace", str(trace)]
        subprocess.run(command, check=True, timeout=60, stdout=subprocess.DEVNULL)
        with trace.open(newline="") as file:
            header, *rows = csv.reader(file)
        values = np.array(rows, dtype=float)
        return {name: values[:, column] for column, name in enumerate(header)}

    return run


def record(drive: AxesClient, controller: str) -> Recording:
    """Returns the recording of the plan, run by the node from home with a position controller."""
    drive.set_parameters_atomically({f"{axis}.position_loop.controller": controller for axis in AXES})
    drive.reset()
    time, positions = plan()
    return drive.run(joint_trajectory(AXES, time, positions))


@pytest.mark.parametrize("controller", ["cascade", "gpc"])
@pytest.mark.parametrize("mode", ["fast", "real"])
def test_the_node_computes_what_the_command_line_computes(
    mode: str, controller: str, offline: Offline, request: pytest.FixtureRequest
):
    """Compares every instant of the motion and every signal that both have."""
    recording, wanted = record(request.getfixturevalue(mode), controller), offline(controller)
    instants = len(recording.states.stamp)
    assert instants == len(plan()[0])
    expected = np.arange(instants) * TSP_NS + recording.start
    np.testing.assert_array_equal(recording.states.stamp, expected)
    assert set(recording.states["controller"].flat) == {controller}
    for axis in AXES:
        for series, field, signal in [
            (recording.states, "psec", "psec"),
            (recording.joints, "position", "position"),
            (recording.joints, "velocity", "velocity"),
            (recording.states, "voltage", "voltage"),
            (recording.currents, "current", "current"),
            (recording.currents, "current_setpoint", "current_setpoint"),
            (recording.currents, "friction", "friction_current"),
        ]:
            np.testing.assert_array_equal(
                series[field, axis], wanted[f"{axis}.{signal}"][:instants], err_msg=f"{axis} {signal}"
            )
