"""Parameters: descriptors, validation, and changes at run time."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from rcl_interfaces.msg import ParameterType

from motion import RATIO, TSP, go_home, start_swing
from node_process import Node
from virtual_axes_py.ros import TSP_NS, AxesClient, ParameterRejected

GAIN = "x.velocity_loop.gain"
NUMBERS = {ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER}
MACHINE_KEYS = [
    "x.motor.inertia_kg_m2",
    "x.transmission.screw_lead_mm",
    "c.transmission.gear_ratio",
    "x.position_loop.gain",
    "x.current_loop.integral_time_ms",
    "x.friction.i0",
    "x.feedforward.torque_kg_m2",
    "x.delays.alpha_ms",
    "periods.position_ms",
    "max_points",
    "time",
]


def test_every_parameter_is_described(real: AxesClient):
    """Each has a type and a text, and each number a range."""
    names = real.list_parameters()
    assert not [key for key in [GAIN, *MACHINE_KEYS] if key not in names]
    for descriptor in real.describe(names):
        assert descriptor.type != ParameterType.PARAMETER_NOT_SET, descriptor.name
        assert descriptor.description.strip(), descriptor.name
        assert "missing" not in descriptor.description, descriptor.name
        if descriptor.type in NUMBERS:
            ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
            assert len(ranges) == 1, descriptor.name
            assert ranges[0].from_value < ranges[0].to_value, descriptor.name


def dump(drive: AxesClient) -> dict[str, object]:
    """Returns the parameters as `ros2 param dump` writes them: a mapping for each part of a name."""
    names = sorted(drive.list_parameters())
    values = drive.get_parameters(names)
    tree: dict[str, object] = {}
    for name in names:
        *groups, last = name.split(".")
        inner = tree
        for group in groups:
            inner = inner.setdefault(group, {})
        value = values[name]
        inner[last] = value if isinstance(value, (str, float, int, bool, type(None))) else list(value)
    return {drive.target: {"ros__parameters": tree}}


def test_a_dump_of_the_parameters_can_be_loaded(start: Callable[..., AxesClient], tmp_path: Path):
    """Parameters without value are not declared until they are set."""
    first = start("-p", "x.velocity_loop.gain:=4.25", "-p", "constraints.goal_time:=0.5", "-p", "publish_rate:=50.0")
    assert "c.limits.travel_min_deg" not in first.list_parameters()
    text = yaml.dump(dump(first), default_flow_style=False)
    file = tmp_path / "dump.yaml"
    file.write_text(text)
    second = start("--params-file", str(file))
    assert yaml.dump(dump(second), default_flow_style=False) == text
    # Older nodes dumped parameters without value as null.
    file.write_text(text.replace("    publish_rate: 50.0\n", "    publish_rate: null\n"))
    third = start("--params-file", str(file))
    assert third.get_parameters(["publish_rate"]) == {"publish_rate": 0.0}
    assert "WARN" not in third.process.output()


def test_values_are_those_of_the_default_machine(real: AxesClient):
    """Values have the units of CNC documentation."""
    assert real.get_parameters(
        [GAIN, "x.position_loop.gain", "x.transmission.screw_lead_mm", "periods.position_ms"]
    ) == {
        GAIN: 5.0,
        "x.position_loop.gain": 1.5,
        "x.transmission.screw_lead_mm": 20.0,
        "periods.position_ms": 6.0,
    }


@pytest.mark.parametrize("value", [-1.0, 1e12, float("nan"), float("inf")])
def test_gain_out_of_range_is_rejected_with_a_reason(real: AxesClient, value: float):
    """The old value stays."""
    with pytest.raises(ParameterRejected, match=r"gain"):
        real.set_parameters({GAIN: value})
    assert real.get_parameters([GAIN]) == {GAIN: 5.0}


@pytest.mark.parametrize("value", ["5.0", True, [5.0]], ids=["string", "bool", "array"])
def test_wrong_type_is_rejected_with_a_reason(real: AxesClient, value: object):
    """The old value stays."""
    with pytest.raises(ParameterRejected, match=r"\w"):
        real.set_parameters({GAIN: value})
    assert real.get_parameters([GAIN]) == {GAIN: 5.0}


def test_unknown_parameter_is_rejected_with_a_reason(real: AxesClient):
    """An unknown parameter is not declared implicitly."""
    with pytest.raises(ParameterRejected, match=r"\w"):
        real.set_parameters({"x.velocity_loop.gian": 5.0})


@pytest.mark.parametrize("name", ["periods.position_ms", "time"])
def test_a_read_only_parameter_is_rejected_with_a_reason(real: AxesClient, name: str):
    """The parameter is fixed after the start; the reason names it."""
    before = real.get_parameters([name])
    with pytest.raises(ParameterRejected, match=name.rsplit(".", 1)[-1]):
        real.set_parameters({name: 12.0 if name.endswith("_ms") else "fast"})
    assert real.get_parameters([name]) == before


def test_the_present_values_are_accepted(real: AxesClient):
    """The values of a dump can be set again; others of the start are rejected."""
    with pytest.raises(ParameterRejected, match=r"publish_rate cannot be set while the node runs.*-p"):
        real.set_parameters({"publish_rate": 10.0})
    names = real.list_parameters()
    values = real.get_parameters(names)
    assert values["use_sim_time"] is False
    real.set_parameters({name: value for name, value in values.items() if value != []})
    assert real.get_parameters(names) == values


def test_live_gain_takes_effect(real: AxesClient):
    """An integer is accepted for a double, and the node uses the new value."""
    real.set_parameters({GAIN: 4})
    assert real.get_parameters([GAIN]) == {GAIN: 4.0}
    real.set_parameters({GAIN: 5.0})
    assert real.get_parameters([GAIN]) == {GAIN: 5.0}


def test_feedforward_can_be_halved_while_moving(real: AxesClient):
    """VFFWS is halved from one position cycle on."""
    go_home(real)
    sent, start, plan = start_swing(real, duration=6.0)
    real.wait_until(start + 100 * TSP_NS, 5)
    real.set_parameters({"x.feedforward.velocity": 0.5})
    try:
        real.end(sent.sequence_number, 10)
        states = real.record(start, start + 1000 * TSP_NS).states
    finally:
        real.set_parameters({"x.feedforward.velocity": 1.0})
    forward = np.abs(states["velocity_feedforward", "x"])
    peak = np.abs(np.diff(plan["x"])).max() / TSP / RATIO
    assert forward[:100].max() > 0
    # The return motion, fastest at point 750, has the same speeds as the first half.
    assert forward[600:].max() == pytest.approx(peak / 2, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["-p", "x.velocity_loop.gain:=-1"], "x.velocity_loop.gain"),
        (["-p", "x.velocity_loop.gian:=1"], "x.velocity_loop.gian"),
        (["-p", "x.velocity_loop.gain"], "x.velocity_loop.gain"),
        (["--params-file", "/nowhere/to/be/found.yaml"], "found.yaml"),
        (["--no-such-option"], "--no-such-option"),
        (["-p", "time:=slow"], "time"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_arguments_are_rejected_with_a_message(arguments: list[str], named: str):
    """The message names the error; the exit status is not zero."""
    with Node(arguments) as process:
        assert process.wait(10) not in (0, 101, -6)
        assert named in process.output()


def test_an_argument_that_is_not_utf_8_is_rejected_and_no_panic():
    with Node(["-p", os.fsdecode(b"x:=\xff")]) as process:
        assert process.wait(10) == 2
        assert "is not UTF-8" in process.output()


def test_arguments_are_applied(start: Callable[..., AxesClient], tmp_path):
    """-p, --params-file, names and namespaces, and -- as their end."""
    file = tmp_path / "machine.yaml"
    file.write_text("/**:\n  ros__parameters:\n    y:\n      velocity_loop:\n        gain: 4.25\n")
    drive = start(
        "-r",
        "__ns:=/cell",
        "-r",
        "__node:=axes",
        "-p",
        f"{GAIN}:=4",
        "--params-file",
        str(file),
        "--",
        name="/cell/axes",
    )
    assert drive.is_in_graph("/cell/axes")
    assert drive.get_parameters([GAIN, "y.velocity_loop.gain"]) == {GAIN: 4.0, "y.velocity_loop.gain": 4.25}
