"""FMU of `virtual_axes fmu`, in FMPy: valid, bit-identical to `virtual_axes run --trace`, states, steps, instances."""

from __future__ import annotations

import csv
import shutil
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

import virtual_axes_py as va
from fmu_instance import COMMAND, TSI, TSP, Fmu, Instance, write_fmu

SIGNALS = ["position", "velocity", "current"]


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    """Returns the FMU of the default machine."""
    return write_fmu(tmp_path_factory.mktemp("fmu"))


@pytest.fixture
def instance(fmu: Fmu) -> Iterator[Callable[[], Instance]]:
    """Returns a function that creates instances, which end with the test."""
    made: list[Instance] = []

    def create() -> Instance:
        made.append(Instance(fmu, f"axes{len(made)}"))
        return made[-1]

    yield create
    for one in made:
        one.close()


@pytest.mark.parametrize("machine", va.machine_names())
def test_validation_has_no_message(machine: str, tmp_path: Path) -> None:
    assert validate_fmu(str(write_fmu(tmp_path, "--machine", machine).file)) == []


def test_variables_have_units_and_the_variability_of_the_schema(fmu: Fmu) -> None:
    variables = {v.name: v for v in fmu.description.modelVariables}
    assert all(v.description for v in variables.values())
    assert variables["x.setpoint"].unit == "m" and variables["c.setpoint"].unit == "rad"
    assert variables["x.load"].unit == "N" and variables["c.load"].unit == "N·m"
    assert variables["x.position_loop.gain"].variability == "tunable"
    assert variables["x.motor.inertia_kg_m2"].variability == "fixed"
    assert variables["x.motor.inertia_kg_m2"].start == "0.028"
    assert fmu.description.coSimulation.canGetAndSetFMUstate
    assert fmu.description.coSimulation.canSerializeFMUstate


def test_values_are_displayed_in_units_of_a_control(fmu: Fmu) -> None:
    variables = {v.name: v for v in fmu.description.modelVariables}
    factors = {(u.name, d.name): float(d.factor) for u in fmu.description.unitDefinitions for d in u.displayUnits}
    wanted = {
        "x.setpoint": ("m", "mm", 1e3),
        "c.position": ("rad", "°", 180 / np.pi),
        "x.velocity": ("m/s", "m/min", 60),
        "c.velocity": ("rad/s", "rpm", 30 / np.pi),
        "x.following_error": ("m", "µm", 1e6),
        "c.following_error": ("rad", "mdeg", 180e3 / np.pi),
    }
    for name, (unit, display, factor) in wanted.items():
        # FMPy resolves displayUnit to the definition.
        found = variables[name].displayUnit
        assert (variables[name].unit, getattr(found, "name", found)) == (unit, display)
        assert factors[unit, display] == pytest.approx(factor, rel=1e-15)


def test_no_step_ends_after_the_stop_time(instance: Callable[[], Instance]) -> None:
    one, other = instance(), instance()
    with pytest.raises(FMICallException):
        one.slave.setupExperiment(startTime=1.0, stopTime=0.5)
    assert one.messages == ["stopTime is 0.5; it must be finite and not before startTime, 1"]
    one.initialize(stop=3 * TSP)
    one.slave.doStep(0.0, TSP)
    stored = one.slave.serializeFMUstate(one.slave.getFMUstate())
    other.slave.setFMUstate(other.slave.deSerializeFMUstate(stored))
    for each in (one, other):
        each.slave.doStep(TSP, TSP)
        with pytest.raises(FMICallException):
            each.slave.doStep(2 * TSP, 2 * TSP)
        assert "ends after stopTime, 0.018 s" in each.messages[-1]
        each.slave.doStep(2 * TSP, TSP)
        with pytest.raises(FMICallException):
            each.slave.doStep(3 * TSP, TSI)
    one.slave.reset()
    one.initialize()
    one.slave.doStep(0.0, 4 * TSP)


def trace_of(folder: Path, scenario: str, *arguments: str) -> dict[str, np.ndarray]:
    """Returns the columns of the trace of a scenario."""
    trace = folder / "trace.csv"
    command = [COMMAND, "run", scenario, "--trace", str(trace), "--quiet", *arguments]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    with trace.open(newline="") as rows:
        header, *rows = csv.reader(rows)
    return dict(zip(header, np.array(rows, dtype=float).T))


@pytest.mark.parametrize("scenario", va.scenario_names())
def test_each_scenario_has_the_bits_of_the_trace(
    scenario: str, instance: Callable[[], Instance], tmp_path: Path
) -> None:
    trace = trace_of(tmp_path, scenario)
    axes = [name.removesuffix(".psec") for name in trace if name.endswith(".psec")]
    psec = np.column_stack([trace[f"{axis}.psec"] for axis in axes])
    names = [f"{axis}.{signal}" for axis in axes for signal in SIGNALS]
    wanted = np.column_stack([trace[name] for name in names])
    one = instance()
    one.initialize(**dict(zip(axes, wanted[0, :: len(SIGNALS)])))
    inputs = [one.references[f"{axis}.setpoint"] for axis in axes]
    outputs = [one.references[name] for name in names]
    found = np.empty_like(wanted)
    for cycle, setpoints in enumerate(psec):
        found[cycle] = one.slave.getReal(outputs)
        one.slave.setReal(inputs, setpoints)
        one.slave.doStep(cycle * TSP, TSP)
    assert np.ptp(found[:, :: len(SIGNALS)], axis=0).max() > 0.001
    assert np.array_equal(found, wanted)


def test_steps_of_the_current_cycle_have_the_bits_of_whole_position_cycles(instance: Callable[[], Instance]) -> None:
    whole, parts = instance(), instance()
    for one in (whole, parts):
        one.initialize()
    for cycle in range(20):
        for one in (whole, parts):
            one.set("x.setpoint", 0.0001 * cycle, "c.setpoint", 0.001 * cycle)
        whole.slave.doStep(cycle * TSP, TSP)
        for tick in range(48):
            parts.slave.doStep(cycle * TSP + tick * TSI, TSI)
            # Read at the start of the next position cycle only.
            parts.set("x.setpoint", 1.0)
        assert whole.get("x.position", "c.current") == parts.get("x.position", "c.current")


def test_a_predictive_controller_reads_the_preview(tmp_path: Path) -> None:
    change = ["--set", "x.position_loop.controller=gpc"]
    trace = trace_of(tmp_path, "x-constant", *change)
    psec = trace["x.psec"]
    fmu = write_fmu(tmp_path, *change)
    assert validate_fmu(str(fmu.file)) == []
    count = sum(name.startswith("x.preview[") for name in fmu.references)
    assert count >= 1
    errors = {}
    for uses_preview in (True, False):
        one = Instance(fmu)
        one.slave.setBoolean([fmu.references["uses_preview"]], [uses_preview])
        one.initialize()
        found = np.empty_like(psec)
        for cycle, setpoint in enumerate(psec):
            found[cycle] = one.get("x.position")[0]
            future = [psec[min(cycle + k, len(psec) - 1)] for k in range(1, count + 1)]
            pairs = [word for k, value in enumerate(future, 1) for word in (f"x.preview[{k}]", value)]
            one.set("x.setpoint", setpoint, *pairs)
            one.slave.doStep(cycle * TSP, TSP)
        one.close()
        errors[uses_preview] = np.abs(found - psec).max()
        assert np.array_equal(found, trace["x.position"]) == uses_preview
    assert errors[True] < errors[False]


def move(one: Instance, first: int, cycles: int) -> list[list[float]]:
    """Returns the outputs over position cycles of a motion."""
    found = []
    for cycle in range(first, first + cycles):
        one.set("x.setpoint", 0.01 * np.sin(0.05 * cycle), "y.load", 50.0 * (cycle % 7))
        one.slave.doStep(cycle * TSP, TSP)
        found.append(one.get("x.position", "x.velocity", "y.position", "z.current", "x.following_error"))
    return found


def test_a_saved_state_repeats_the_bits_here_and_in_another_instance(instance: Callable[[], Instance]) -> None:
    one, other = instance(), instance()
    one.initialize()
    move(one, 0, 50)
    one.set("x.position_loop.gain", 1.7)
    one.slave.doStep(50 * TSP, 3 * TSI)
    state = one.slave.getFMUstate()
    stored = one.slave.serializeFMUstate(state)

    def go_on(one: Instance) -> list[list[float]]:
        one.slave.doStep(50 * TSP + 3 * TSI, TSP - 3 * TSI)
        return move(one, 51, 40)

    wanted = go_on(one)
    one.set("x.position_loop.gain", 1.2)
    one.slave.setFMUstate(state)
    assert one.get("x.position_loop.gain") == [1.7]
    assert go_on(one) == wanted
    one.slave.freeFMUstate(state)
    # The other instance was never initialized: the state has all of it.
    read = other.slave.deSerializeFMUstate(stored)
    other.slave.setFMUstate(read)
    assert go_on(other) == wanted
    for at in (0, 9, len(stored) // 2, len(stored) - 1):
        damaged = bytearray(stored)
        damaged[at] ^= 4
        with pytest.raises(FMICallException):
            other.slave.deSerializeFMUstate(bytes(damaged))
        assert "state" in other.messages[-1]


@pytest.mark.parametrize("step", [0.0001, 0.0061, 0.0, -TSP, float("nan"), 2000.0])
def test_other_steps_are_rejected_and_change_nothing(step: float, instance: Callable[[], Instance]) -> None:
    one, undisturbed = instance(), instance()
    for each in (one, undisturbed):
        each.initialize()
    with pytest.raises(FMICallException, match=r"status 3"):
        one.slave.doStep(0.0, step)
    (message,) = one.messages
    assert "communicationStepSize is" in message and "multiple of the current cycle Tsi, 0.000125 s" in message
    assert move(one, 0, 30) == move(undisturbed, 0, 30)


def test_another_communication_point_is_rejected(instance: Callable[[], Instance]) -> None:
    one = instance()
    one.initialize(start=2.0)
    with pytest.raises(FMICallException):
        one.slave.doStep(0.0, TSP)
    assert one.messages == ["currentCommunicationPoint is 0 s; it must be 2 s, the end of the last step"]
    one.slave.doStep(2.0, TSP)


def test_rejected_values_are_named_in_the_log(instance: Callable[[], Instance]) -> None:
    one = instance()
    with pytest.raises(FMICallException):
        one.set("x.position_loop.gain", -1.0)
    with pytest.raises(FMICallException):
        one.set("x.setpoint", float("inf"))
    with pytest.raises(FMICallException):
        one.set("y.setpoint", 1e308)
    with pytest.raises(FMICallException):
        one.set("x.position", 1.0)
    with pytest.raises(FMICallException):
        one.slave.setReal([100_000], [1.0])
    with pytest.raises(FMICallException):
        one.slave.getInteger([one.references["x.setpoint"]])
    with pytest.raises(FMICallException):
        one.slave.doStep(0.0, TSP)
    one.initialize()
    with pytest.raises(FMICallException):
        one.set("x.motor.inertia_kg_m2", 0.05)
    words = [
        "x.position_loop.gain",
        "x.setpoint is inf; it must lie in ±1000000",
        "y.setpoint is 1e308; it must lie in ±1000000",
        "x.position is an output",
        "value reference is 100000; it must be below",
        "x.setpoint is of type Real",
        'the state of the instance is "instantiated"',
        "x.motor.inertia_kg_m2 is a fixed parameter",
    ]
    assert len(one.messages) == len(words)
    for message, part in zip(one.messages, words):
        assert part in message


def test_parameters_have_their_effect_before_and_after_the_start(instance: Callable[[], Instance]) -> None:
    plain, fixed, tuned = instance(), instance(), instance()
    fixed.set("x.motor.inertia_kg_m2", 0.056)
    for one in (plain, fixed, tuned):
        one.initialize()
    first = [move(one, 0, 40) for one in (plain, fixed, tuned)]
    assert first[0] == first[2] != first[1]
    tuned.set("x.position_loop.gain", 1.0)
    assert tuned.get("x.position_loop.gain") == [1.0]
    assert move(plain, 40, 40) != move(tuned, 40, 40)


def test_an_unstable_combination_is_rejected_until_it_is_changed(instance: Callable[[], Instance]) -> None:
    one, undisturbed = instance(), instance()
    for each in (one, undisturbed):
        each.initialize()
        move(each, 0, 10)
    before = one.slave.getFMUstate()
    loop = "x.position_loop"
    # Values of one call are checked together.
    one.slave.setInteger([one.references[f"{loop}.gpc.{name}"] for name in ("n2", "n1", "nu")], [1, 1, 1])
    one.set(f"{loop}.gpc.lambda_rel", 0.0)
    one.slave.setString([one.references[f"{loop}.controller"]], ["gpc"])
    for _ in range(2):
        with pytest.raises(FMICallException):
            one.slave.doStep(10 * TSP, TSP)
        assert one.messages[-1].startswith("axis x: position_loop: the closed loop is unstable")
    one.slave.setString([one.references[f"{loop}.controller"]], ["cascade"])
    move(one, 10, 5)
    one.slave.setFMUstate(before)
    assert move(one, 10, 30) == move(undisturbed, 10, 30)


def test_instances_and_resets_are_independent(instance: Callable[[], Instance]) -> None:
    one, other = instance(), instance()
    for each in (one, other):
        each.initialize()
    wanted = move(one, 0, 30)
    assert other.get("x.position") == [0.0]
    assert move(other, 0, 30) == wanted
    one.slave.terminate()
    one.slave.reset()
    one.initialize()
    assert move(one, 0, 30) == wanted
    assert move(other, 30, 5) != wanted[:5]


def test_instances_in_several_threads_have_the_same_bits(instance: Callable[[], Instance]) -> None:
    instances = [instance() for _ in range(4)]
    for one in instances:
        one.initialize()
    with ThreadPoolExecutor(4) as threads:
        first, *others = threads.map(lambda one: move(one, 0, 300), instances)
    assert all(found == first for found in others)


def test_a_spring_computed_every_half_millisecond_is_overcome(instance: Callable[[], Instance]) -> None:
    one = instance()
    one.initialize()
    one.set("x.setpoint", 0.001)
    for step in range(2000):
        (position,) = one.get("x.position")
        one.set("x.load", -1e6 * position)
        one.slave.doStep(step * 0.0005, 0.0005)
    # The velocity controller has an integral part: after a second, no error is left under a force of 1 kN.
    position, load, error = one.get("x.position", "x.load", "x.following_error")
    assert position == pytest.approx(0.001, abs=1e-12)
    assert load == pytest.approx(-1000, abs=0.01) and error == pytest.approx(0, abs=1e-12)
    assert abs(one.get("x.load_current")[0]) > 1


def test_an_instance_of_another_archive_is_rejected(fmu: Fmu, tmp_path: Path) -> None:
    other = write_fmu(tmp_path, "--set", "x.position_loop.gain=1.7")
    assert other.description.guid != fmu.description.guid
    other.description.guid = fmu.description.guid
    with pytest.raises(Exception, match="Failed to instantiate"):
        Instance(other)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "No such file"),
        (b"text", "is no shared library"),
        (b"\x7fELF\x02\x01" + bytes(12) + b"\x3e\0", "fmi2DoStep"),
    ],
)
def test_a_wrong_library_is_rejected_and_no_archive_is_written(
    content: bytes | None, reason: str, tmp_path: Path
) -> None:
    library = tmp_path / "library.so"
    if content is not None:
        library.write_bytes(content)
    out = tmp_path / "axes.fmu"
    done = subprocess.run(
        [COMMAND, "fmu", "--out", str(out), "--library", str(library)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2 and str(library) in done.stderr and reason in done.stderr
    assert not out.exists()


def test_a_command_without_its_library_names_the_remedy(tmp_path: Path) -> None:
    command = shutil.copy(COMMAND, tmp_path)
    arguments = [command, "fmu", "--out", str(tmp_path / "axes.fmu")]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and "libvirtual_axes_fmu.so is not beside this program" in done.stderr
    assert str(tmp_path) in done.stderr and "--library" in done.stderr
    library = Path(COMMAND).parent / "deps" / "libvirtual_axes_fmu.so"
    for added in (["--library", str(library)], []):
        if not added:
            shutil.copy(library, tmp_path)
        subprocess.run([*arguments, *added], check=True, timeout=60)
        assert validate_fmu(arguments[3]) == []
