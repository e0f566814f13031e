"""Module `virtual_axes_py`: wrong arguments, interruptions, threads and processes."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import control
import numpy as np
import pytest

import virtual_axes_py as va
from virtual_axes_py.arguments import in_python

STILL = np.zeros((5, 5))


@pytest.fixture(scope="module")
def machine() -> va.Machine:
    """Returns the default machine."""
    return va.Machine.load()


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda m: m.simulate(None), TypeError, "psec is of type NoneType; it must have real numbers"),
        (lambda m: m.simulate("ballbar"), TypeError, r"psec is 'ballbar'; a scenario is scenario\(name\)"),
        (lambda m: m.simulate(np.zeros(5)), ValueError, r"shape \(5,\); it needs \(setpoints, 5\)"),
        (lambda m: m.simulate(np.zeros((2, 3, 5))), ValueError, r"shape \(2, 3, 5\)"),
        (lambda m: m.simulate(0.0), ValueError, r"shape \(\)"),
        (lambda m: m.simulate(STILL.astype(complex)), TypeError, "complex128"),
        (lambda m: m.simulate([[0.0, 0.0], [0.0]]), ValueError, "rows of different lengths"),
        (lambda m: m.simulate({"x": ["a", "b"]}), TypeError, "psec of x"),
        (lambda m: m.simulate({"x": 0.1}), ValueError, r"psec of x is one number; .*\[0\.1\]"),
        (lambda m: va.nc_program("G0 X0\nM2\n"), ValueError, r"name_or_path is the text of a program; .*write_text"),
        (lambda m: va.identify(SimpleNamespace(columns=[]), "x", m), ValueError, "recording has no columns"),
        (lambda m: m.simulate(STILL, signals="position"), TypeError, "signals is 'position'"),
        (lambda m: m.simulate(STILL, signals=["psec"]).following_error, ValueError, "'position' is not recorded"),
        (lambda m: m.simulate(STILL, signals=5), TypeError, "signals is 5; it must be a list"),
        (lambda m: m.simulate(STILL, loads=np.zeros((0, 5))), ValueError, "loads has no rows"),
        (lambda m: m.simulate(STILL, loads={"time": [0.0], "x": [1.0]}), ValueError, "loads has a column time"),
        (lambda m: m.simulate({"x": object()}), TypeError, "psec of x is of type object"),
        (lambda m: m.simulate(STILL).plot([]), ValueError, "axes is empty; it needs one or more of x, y"),
        (lambda m: va.Machine.from_yaml(b""), TypeError, "text is b''; it must be a text"),
        (lambda m: va.tune(m, STILL, controller="gpc", also=None), TypeError, "also is of type NoneType"),
        (lambda m: va.robustness(m, STILL, cost=5), TypeError, "cost is 5; it must be a text"),
        (lambda m: va.identify({b"time": [0.0]}, "x", m), TypeError, "channel is b'time'; it must be a text"),
        (lambda m: va.identify({"time": [0.0]}, "x", m, rate_hz=0), ValueError, "rate_hz 0.0: must be above 0 Hz"),
        (lambda m: va.design.model(m, None), TypeError, "axis is None; it must be a text"),
        (lambda m: va.design.place_poles(va.design.model(m, "x"), [0.5, None]), TypeError, "poles is .*None"),
        (lambda m: va.design.plot_bode(m, []), ValueError, "axes is empty"),
        (lambda m: va.Stepper(m, 2).reset(only=[True]), TypeError, "machine True: must be an integer"),
        (lambda m: va.design.from_control(control.tf([1], [1, 0], True), period=True), TypeError, "period is True"),
        (lambda m: va.design.from_control(control.tf([1, 0], [1, 0.5], 0.006)), ValueError, "multiply by 1/z"),
        (lambda m: va.Stepper("axes"), TypeError, "machine is of type str"),
        (lambda m: va.Stepper(m, -1), ValueError, "machines -1: must be from 1 to 100000"),
        (lambda m: va.Stepper(m, 10**20), ValueError, "machines 1000"),
        (lambda m: va.Stepper(m, 1.5), TypeError, "machines 1.5: must be an integer"),
        (lambda m: va.Stepper(m, 2).reset(only=[-1]), ValueError, "machine -1: must be from 0 to 1"),
        (lambda m: va.Stepper(m).step(np.zeros(5), np.zeros((3, 4))), ValueError, r"it needs \(5, cycles\)"),
        (lambda m: va.Stepper(m, 3).step(np.zeros((3, 5)), np.zeros((5, 3, 4))), ValueError, r"\(3, 5, cycles\)"),
        (lambda m: va.Stepper(m).step(np.zeros(5), np.full((5, 2), np.nan)), ValueError, "preview has the value NaN"),
        (lambda m: va.Stepper(m).set_machine(3), TypeError, "machine is of type int"),
        (lambda m: va.design.gpc(va.design.model(m, "x"), -1, lambda_rel=0.1), ValueError, "n2 -1"),
        (lambda m: va.identify({"time": np.zeros((3, 3))}, "x", m), ValueError, r"channel time has the shape \(3, 3\)"),
        (lambda m: va.sweep(m, [{}], STILL, threads=10**7), ValueError, "threads 10000000: must be from 1 to 1024"),
        (lambda m: va.sweep(m, [{}], STILL, threads=1.5), TypeError, "threads 1.5"),
        (lambda m: va.sweep(m, [{}], STILL, chunk="a"), TypeError, "chunk 'a'"),
        (lambda m: va.sweep(m, [{}], STILL, executor=3), TypeError, "executor is of type int"),
        (lambda m: va.sweep(m, {"x.position_loop.gain": 1.0}, STILL), TypeError, "variants is a dictionary"),
        (lambda m: va.sweep(m, ["abc"], STILL), TypeError, "variant 0 is of type str"),
        (
            lambda m: va.sweep(m, [{}], np.full((3, 5), np.nan)),
            ValueError,
            "at 0 s: x: position is NaN, not a finite number",
        ),
        (lambda m: va.sweep(m, [{}], STILL, out="nowhere", shard=(0, 1, 2)), ValueError, "must be two numbers"),
        (lambda m: va.merge("/nowhere"), ValueError, "/nowhere has no study"),
        (lambda m: va.random_variants(1, 1, {"x.position_loop.gain": ("a", "b")}), TypeError, "must be two numbers"),
        (lambda m: va.random_variants(1, 1, {"x.position_loop.gain": (0, 10**30)}), ValueError, "1e.18 in amount"),
        (lambda m: va.random_variants(1, 1.5, {}), TypeError, "n 1.5"),
        (lambda m: va.Machine(3), TypeError, r"native is of type int; Machine.load\(name_or_path\)"),
        (lambda m: m.with_("x"), TypeError, "changes is of type str; it must be a dictionary"),
        (lambda m: m.simulate({"time": [0.0, 1.0]}), ValueError, "psec has no column of an axis; it needs one or more"),
        (lambda m: va.Stepper(m).step("a"), TypeError, "psec is 'a'; it must have numbers"),
        (lambda m: va.Stepper(m).set_load(["a"] * 5), TypeError, "load has elements of type <U1"),
        (lambda m: va.Stepper(m).step(np.zeros(5), "a"), TypeError, "preview is 'a'; it must have numbers"),
        (lambda m: va.design.rst(25.0, [1.0], [25.0]), ValueError, r"r has the shape \(\); it needs one dimension"),
        (lambda m: va.design.rst([25.0], ["a"], [25.0]), TypeError, "s has elements of type <U1"),
        (lambda m: va.design.rst([1.0], [1.0], [1.0], 0.5), TypeError, "t_first 0.5: must be an integer"),
        (lambda m: va.design.gpc(m, 12, lambda_rel=0.1), TypeError, "model is of type Machine; it must be a Predict"),
        (lambda m: va.design.gpc(va.design.model(m, "x"), 12, lambda_rel="a"), TypeError, "lambda_rel is 'a'"),
        (lambda m: va.design.pid(va.design.model(m, "x"), "a"), TypeError, "gain is 'a'; it must be a real number"),
        (lambda m: va.design.place_poles(va.design.model(m, "x"), 0.5), TypeError, "poles is 0.5; it must be a list"),
        (lambda m: va.design.margins(va.design.model(m, "x"), 25.0), TypeError, "rst is of type float; it must be an"),
        (lambda m: va.design.poles(m, None), TypeError, "model is of type Machine"),
        (lambda m: va.design.to_control(3), TypeError, "model is of type int"),
        (lambda m: va.scenario("ballbar", feed="a"), TypeError, "feed is 'a'; it must be a real number"),
        (lambda m: va.nc_program("pocket", "a"), TypeError, "feed_override is 'a'; it must be a real number"),
        (
            lambda m: va.nc_program("pocket", work_offset={"G54": 3}),
            ValueError,
            r"work_offset of G54 has the shape \(\)",
        ),
        (lambda m: va.nc_program("pocket", work_offset={"G54": (1, 2)}), ValueError, "has 2 values; it must have X, Y"),
        (lambda m: va.nc_program("pocket", work_offset={"G54": [0.0] * 7}), ValueError, "has 7 values; it must have X"),
        (lambda m: va.nc_program("pocket", tools={1: 0.05}), ValueError, r"tools: tool 1 has the shape \(\)"),
        (lambda m: va.nc_program("pocket", tools={1: (0.05,)}), ValueError, "tool 1 has 1 values; it must have length"),
        (lambda m: va.scenario("ballbar").psec("vmc"), TypeError, "machine is of type str; it must be a Machine"),
        (lambda m: va.nc_program("pocket").psec(None), TypeError, "machine is of type NoneType; it must be a Machine"),
        (lambda m: va.merge(3), TypeError, "directory is of type int; it must be a name or a path"),
        (lambda m: va.sweep(m, [{}], STILL, out=3), TypeError, "out is of type int; it must be a name or a path"),
        (lambda m: va.random_variants(1, 1, {"x.position_loop.gain": 3}), TypeError, "bounds 3 must be two numbers"),
        (lambda m: va.robustness(m, STILL, by="a"), TypeError, "by is 'a'; it must be a real number"),
        (lambda m: va.learn(m, STILL, gain="a"), TypeError, "gain is 'a'; it must be a real number"),
        (lambda m: va.learn(m, STILL, bandwidth_hz="a"), TypeError, "bandwidth_hz is 'a': must be real number"),
        (lambda m: va.tune("vmc", STILL), TypeError, "machine is of type str; it must be a Machine"),
        (lambda m: va.tune(m, STILL, cost=3), TypeError, "cost is 3; it must be a text"),
        (lambda m: va.tune(m, STILL, modulus_margin="a"), TypeError, "modulus_margin is 'a': must be real number"),
        (lambda m: va.tune(m, STILL, controller="gpc", designs=1.5), TypeError, "designs 1.5: must be an integer"),
        (lambda m: va.tune(m, STILL, controller="cascade", seed=-1), ValueError, "seed -1: must be from 0 to"),
        (lambda m: va.nc_program("pocket", tool_change_s="a"), TypeError, "tool_change_s is 'a': must be real number"),
        (lambda m: m.simulate(STILL, figures=None), TypeError, "figures is None: 'None' is not an instance of 'str'"),
        (lambda m: m.simulate(STILL, every_tick="no"), TypeError, "every_tick is 'no': 'str' object"),
        (lambda m: m.simulate(STILL, signals=["positon"]), ValueError, "signal 'positon' is unknown; the nearest is"),
        (lambda m: m.simulate({"x": ["0"]}), TypeError, "psec of x has elements of type <U1"),
        (lambda m: m.simulate([{"x": 0.0}]), TypeError, "psec has the element {'x': 0.0} of type dict"),
        (lambda m: m.simulate({"x": [0.0, None]}), ValueError, "at 0.006 s: x: position is NaN"),
        (lambda m: va.identify(3, "x"), TypeError, "recording is of type int; it must be a path, a dictionary"),
        (lambda m: va.optimize("vmc", STILL, {}, "x"), TypeError, "machine is of type str; it must be a Machine"),
        (
            lambda m: va.optimize(m, STILL, {"x.position_loop.gian": (1.0, 2.0)}, "x"),
            ValueError,
            "parameter 'x.position_loop.gian' is unknown; the nearest is x.position_loop.gain",
        ),
    ],
)
def test_a_wrong_argument_is_named(call, error, text: str, machine: va.Machine) -> None:
    with pytest.raises(error, match=text):
        call(machine)


def test_values_of_numpy_are_values_of_python(machine: va.Machine) -> None:
    changes = {
        "x.position_loop.gain": np.float32(1.5),
        "allow_nonzero_velocity_at_trajectory_end": np.bool_(True),
        "x.position_loop.gpc.n2": np.int64(12),
    }
    expected = {"x.position_loop.gain": 1.5, "allow_nonzero_velocity_at_trajectory_end": True}
    assert machine.with_(changes) == machine.with_({**expected, "x.position_loop.gpc.n2": 12})
    coefficients = {"x.position_loop.rst.r": np.array([1.0, -0.5])}
    assert machine.with_(coefficients) == machine.with_({"x.position_loop.rst.r": [1.0, -0.5]})


def test_a_layout_of_an_array_does_not_matter(machine: va.Machine) -> None:
    psec = va.scenario("corner-90").psec(machine)
    expected = machine.simulate(psec).position
    padded = np.zeros((2 * len(psec), 10))
    padded[::2, ::2] = psec
    locked = psec.copy()
    locked.flags.writeable = False
    for same in (np.asfortranarray(psec), padded[::2, ::2], locked, psec.tolist()):
        assert np.array_equal(machine.simulate(same).position, expected)


def test_models_and_controllers_can_be_pickled(machine: va.Machine) -> None:
    assert va.Rst([25.0], [1.0], [25.0]) == va.design.rst([25.0], [1.0], [25.0])
    model = va.design.model(machine, "x")
    rst = va.design.gpc(model, 12, lambda_rel=0.1)
    assert pickle.loads(pickle.dumps(model)) == model != va.design.model(machine, "y")
    assert pickle.loads(pickle.dumps(rst)) == rst != va.design.gpc(model, 12, lambda_rel=0.2)
    assert va.design.margins(*pickle.loads(pickle.dumps((model, rst)))) == va.design.margins(model, rst)
    with pytest.raises(ValueError) as found:
        machine.with_({"x.position_loop.gain": -1.0})
    assert pickle.loads(pickle.dumps(found.value)).args == found.value.args


@pytest.mark.parametrize("machines", [1, 3])
def test_a_stepper_goes_on_with_the_same_bits_after_pickling(machine: va.Machine, machines: int) -> None:
    changed = machine.with_({"x.position_loop.gain": 2.0, "y.position_loop.controller": "gpc"})
    stepper = va.Stepper(machine, machines)
    rows = va.scenario("ballbar").psec(machine)[:300]

    def run(which: va.Stepper, some: np.ndarray) -> np.ndarray:
        return np.array([which.step(np.broadcast_to(row, (machines, 5)).squeeze()) for row in some])

    run(stepper, rows[:100])
    stepper.set_machine(changed)
    run(stepper, rows[100:200])
    copies = [pickle.loads(pickle.dumps(stepper)), copy.deepcopy(stepper), va.Stepper(machine, machines)]
    copies[2].restore(pickle.loads(pickle.dumps(stepper.save())))
    expected = run(stepper, rows[200:])
    for one in copies:
        assert one.time == pytest.approx(1.2) and one.machines == machines
        assert np.array_equal(run(one, rows[200:]), expected)


def final_position(machine: va.Machine) -> list[float]:
    """Returns the last positions of a scenario."""
    return machine.simulate(va.scenario("corner-90"), figures="axes").position[-1].tolist()


def test_threads_and_processes_have_the_same_bits(machine: va.Machine) -> None:
    machines = [machine.with_({"x.position_loop.gain": gain}) for gain in (1.0, 1.5, 2.0, 2.5)]
    expected = [final_position(one) for one in machines]
    assert len({tuple(position) for position in expected}) == 4
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(final_position, machines * 4)) == expected * 4
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as processes:
        assert list(processes.map(final_position, machines, timeout=60)) == expected


LONG = """
import numpy as np, virtual_axes_py as va
m = va.Machine.load()
psec = np.zeros((300_000, 5)); psec[:, 0] = 0.01 * np.sin(np.arange(len(psec)) * 0.006) ** 2
designs = va.random_variants(1, 100_000, {"x.position_loop.gain": (1.0, 2.0)})
"""
CALLS = {
    "simulate": "m.simulate(np.tile(psec, (20, 1)), signals=[])",
    "sweep": "va.sweep(m, designs, psec)",
    "tune": "va.tune(m, psec, controller='gpc', designs=100_000)",
}


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_ends_a_long_call_within_2_seconds(name: str) -> None:
    program = f"{LONG}\nprint('ready', flush=True)\n{CALLS[name]}\n"
    command = [sys.executable, "-c", program]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(1.5)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        # Seconds of a thread that is always ready to run: other load stretches them as much as those of the call.
        start = time.thread_time()
        while process.poll() is None:
            assert time.thread_time() - start < 2.0
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait(timeout=10)
    assert process.returncode != 0 and errors.rstrip().endswith("KeyboardInterrupt"), errors


@pytest.mark.parametrize(
    "call",
    [
        lambda m, psec: m.simulate(psec, signals=[]),
        lambda m, psec: va.sweep(m, [{}, {"x.position_loop.gain": 2.0}] * 16, psec[:30_000]),
        lambda m, psec: va.tune(m, psec[:20_000], controller="gpc", designs=100),
    ],
    ids=["simulate", "sweep", "tune"],
)
def test_other_threads_of_python_run_during_a_long_call(call, machine: va.Machine) -> None:
    psec = np.zeros((300_000, 5))
    psec[:, 0] = 0.01 * np.sin(np.arange(len(psec)) * 0.006) ** 2
    count, is_running = 0, True

    def tick() -> None:
        nonlocal count
        while is_running:
            count += 1
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.monotonic()
    before = count
    try:
        call(machine, psec)
    finally:
        duration, ticks = time.monotonic() - start, count - before
        is_running = False
        thread.join(timeout=10)
    # With the lock held the thread would advance once at most.
    assert duration > 0.05 and ticks > 50 * duration, (ticks, duration)


def test_a_part_program_of_a_sweep_needs_no_file_at_the_workers(machine: va.Machine, tmp_path: Path) -> None:
    file = tmp_path / "part.nc"
    file.write_text("G21 G90 G94\nG1 X20 F3000\nY10\nM30\n")
    program = va.nc_program(str(file))
    found = va.sweep(machine, [{"x.position_loop.gain": 2.0}], program)
    alone = machine.with_({"x.position_loop.gain": 2.0}).simulate(program, figures="axes")
    assert found[0].figures == alone.figures


def test_an_error_of_the_identification_names_arguments(machine: va.Machine) -> None:
    table = np.zeros(50, dtype=[("t_ms", float), ("position", float)])
    with pytest.raises(ValueError, match='no column "clock".*by column=CHANNEL=.* or give the .* by rate_hz') as found:
        va.identify(table, "x", machine, column="time=clock[ms]")
    assert "--" not in str(found.value)


def test_messages_of_the_command_have_names_of_arguments() -> None:
    text = "give those by --set, or --trace-filter-hz; --column 'time=#4' (`virtual_axes psec campaign --part off`)"
    expected = (
        "give those by Machine.with_, or trace_filter_hz; column='time=#4' (`virtual_axes psec campaign --part off`)"
    )
    assert in_python(text) == expected


def test_a_note_of_a_part_program_names_arguments(machine: va.Machine, tmp_path: Path) -> None:
    file = tmp_path / "part.nc"
    file.write_text("O0001\nG21 G90 G94\nG1 X20 F3000\nM30\n")
    with pytest.warns(UserWarning, match="dialect fanuc, detected from .*; dialect sets another"):
        va.nc_program(file).psec(machine)


def test_one_code_without_effect_needs_no_list(machine: va.Machine, tmp_path: Path) -> None:
    file = tmp_path / "part.nc"
    file.write_text("G21 G90 G94\nM7\nG1 X20 F3000\nM30\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        machine.simulate(va.nc_program(file))
    for ignored in (7, "M7", [7]):
        with pytest.warns(UserWarning, match="M7 is ignored"):
            machine.simulate(va.nc_program(file, ignore=ignored))


def test_the_module_lists_its_public_names_only() -> None:
    names = set(dir(va))
    assert {"Machine", "simulate", "numpy", "os", "math"} & names == {"Machine"} and set(va.__all__) <= names
