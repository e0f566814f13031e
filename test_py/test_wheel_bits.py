"""Module `virtual_axes_py`: bit-identical to the command on every scenario and to the node, with every controller."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

import numpy as np
import pytest

import virtual_axes_py as va
from node_process import Node, node_binary
from virtual_axes_py.ros import AxesClient, joint_trajectory

COMMAND = str(Path(node_binary()).with_name("virtual_axes"))
CONTROLLERS = ["cascade", "gpc", "pid", "rst"]


def machine_with(controller: str) -> va.Machine:
    """Returns the default machine with a position controller on all axes; PID and pole placement are RST."""
    machine = va.Machine.load()
    kind = controller if controller in ("cascade", "gpc") else "rst"
    changes: dict[str, object] = {}
    for axis in machine.axes:
        changes[f"{axis}.position_loop.controller"] = kind
        if kind == "rst":
            model = va.design.model(machine, axis)
            if controller == "pid":
                rst = va.design.pid(model, 25.0, integral_time=0.5, velocity_feedforward=1.0)
            else:
                rst = va.design.gpc(model, 16, lambda_rel=0.2)
            parts = {"r": rst.r, "s": rst.s, "t": rst.t, "t_first": rst.t_first}
            changes |= {f"{axis}.position_loop.rst.{name}": value for name, value in parts.items()}
    return machine.with_(changes)


@pytest.fixture(scope="module", params=CONTROLLERS)
def varied(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[va.Machine, Path]:
    """Returns a machine for each controller, and its file."""
    machine = machine_with(request.param)
    file = tmp_path_factory.mktemp(request.param) / "machine.yaml"
    file.write_text(machine.to_yaml(), encoding="utf-8")
    assert va.Machine.load(str(file)) == machine
    return machine, file


@pytest.mark.parametrize("name", va.scenario_names())
def test_all_columns_of_the_trace_of_the_command_are_equal(
    name: str, varied: tuple[va.Machine, Path], tmp_path: Path
) -> None:
    machine, file = varied
    trace = tmp_path / "trace.csv"
    command = [COMMAND, "run", name, "--machine", str(file), "--trace", str(trace), "--quiet"]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    run = machine.simulate(va.scenario(name), figures="axes")
    with trace.open(newline="") as rows:
        header, *rows = csv.reader(rows)
    columns = np.array(rows, dtype=float).T
    signals = {f"{axis}.{signal}": values for axis in machine.axes for signal, values in run.axis(axis).items()}
    assert len(header) == 1 + 8 * len(machine.axes)
    for title, column in zip(header[1:], columns[1:]):
        assert np.array_equal(column, signals[title]), title
    assert np.abs(columns[0] - run.time).max() < 1e-9


def test_the_node_publishes_the_simulated_positions(varied: tuple[va.Machine, Path]) -> None:
    machine, file = varied
    psec = va.scenario("five-axis").psec(machine)
    run = machine.simulate(psec, figures="axes")
    times = np.arange(len(psec)) * machine.position_period
    with Node(["-p", "time:=fast", "--params-file", str(file)]) as node, AxesClient(process=node) as axes:
        found = axes.run(joint_trajectory(machine.axes, times, psec), settle=0.5)
    states = found.states
    assert states.name == machine.axes
    assert len(states) >= len(psec)
    for name, values in (("psec", run.psec), ("position", run.position), ("velocity", run.velocity)):
        assert np.array_equal(states[name], values[: len(states)]), name
    assert np.array_equal(found.joints["position"], run.position[: len(found.joints)])
    assert np.array_equal(found.currents["current"], run.current[: len(found.currents)])
