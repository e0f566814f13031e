"""Module `virtual_axes_py`: the same bits as the command, its checks of arguments, its types, and its installation."""

from __future__ import annotations

import csv
import json
import pickle
import re
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import virtual_axes_py as va
from node_process import node_binary

ROOT = Path(__file__).resolve().parent.parent
COMMAND = str(Path(node_binary()).with_name("virtual_axes"))


@pytest.fixture(scope="module")
def machine() -> va.Machine:
    """Returns the default machine."""
    return va.Machine.load()


def of_controller(machine: va.Machine, controller: str) -> va.Machine:
    """Returns the machine with a position controller on all axes."""
    return machine.with_({f"{axis}.position_loop.controller": controller for axis in machine.axes})


@pytest.mark.parametrize("controller", ["cascade", "gpc"])
@pytest.mark.parametrize("name", va.scenario_names())
def test_a_simulation_has_the_bits_and_figures_of_the_command(
    name: str, controller: str, machine: va.Machine, tmp_path: Path
) -> None:
    trace = tmp_path / "trace.csv"
    command = [COMMAND, "run", name, "--controller", controller, "--trace", str(trace), "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)
    expected = json.loads(done.stdout)["runs"][0]
    run = of_controller(machine, controller).simulate(va.scenario(name))
    assert run.figures == {key: expected[key] for key in run.figures}
    with trace.open(newline="") as file:
        header, *rows = csv.reader(file)
    columns = {title: np.array([float(row[index]) for row in rows]) for index, title in enumerate(header)}
    compared = 0
    for index, axis in enumerate(machine.axes):
        for title, signal_name in ((f"{axis}.psec", "psec"), (f"{axis}.position", "position")):
            matching = [column for column in columns if column.startswith(title)]
            for column in matching:
                assert np.array_equal(columns[column], run.signals[signal_name][:, index]), column
                compared += 1
    assert compared >= 2 * len(machine.axes), header


def test_setpoints_as_array_scenario_and_columns_are_equal(machine: va.Machine) -> None:
    ballbar = va.scenario("ballbar")
    psec = ballbar.psec(machine)
    by_scenario, by_array = machine.simulate(ballbar), machine.simulate(psec)
    by_column = machine.simulate({name: psec[:, machine.axes.index(name)] for name in ("x", "y")})
    for run in (by_array, by_column):
        assert np.array_equal(run.position, by_scenario.position)
    # An array has no path: the contour error is that to the polyline of the setpoints.
    references = [run.figures["contour_error_um"]["reference"] for run in (by_scenario, by_array)]
    assert references == ["path", "setpoints"]
    assert (by_array.setpoint_count, len(by_array.time)) == (len(psec), len(psec) + 167)
    assert by_array.time[1] == machine.position_period


def test_a_stepper_has_the_bits_of_a_simulation_and_returns_to_a_state(machine: va.Machine) -> None:
    psec = va.scenario("corner-90").psec(machine)
    run = machine.simulate(psec)
    one, many = va.Stepper(machine), va.Stepper(machine, machines=64)
    one.reset(psec[0])
    many.reset(np.tile(psec[0], (64, 1)))
    # The position at the end of a cycle is that at the start of the next one.
    middle = len(psec) // 2
    for row, expected in zip(psec[:middle], run.position[1:]):
        assert np.array_equal(one.step(row), expected)
        found = many.step(np.tile(row, (64, 1)))
        assert found.shape == (64, len(machine.axes)) and (found == expected).all()
    state = one.save()
    later = [one.step(row) for row in psec[middle:]]
    one.restore(state)
    assert all(np.array_equal(one.step(row), expected) for row, expected in zip(psec[middle:], later))
    assert np.array_equal(later[-1], run.position[len(psec)])


def test_a_load_and_other_gains_act_from_the_next_cycle(machine: va.Machine) -> None:
    pushed, free = va.Stepper(machine), va.Stepper(machine)
    pushed.set_load([5000.0, 0, 0, 0, 0])
    free.set_machine(machine.with_({"x.position_loop.gain": 1.0}))
    still = np.zeros(5)
    moved, stayed = (np.array([stepper.step(still) for _ in range(50)]) for stepper in (pushed, free))
    assert moved[:, 0].max() > 1e-5 and np.abs(moved[:, 1:]).max() < 1e-12 and np.abs(stayed).max() < 1e-12


def test_a_sweep_equals_single_simulations_for_any_number_of_threads(machine: va.Machine) -> None:
    gains = np.linspace(1.0, 2.0, 40)
    variants = [{"x.position_loop.gain": float(gain)} for gain in gains]
    # Another delay cannot run beside the others; an impossible gain is a result.
    variants += [{"x.delays.alpha_ms": 6.0}, {"x.position_loop.gain": -1.0}]
    scenario = va.scenario("corner-90")
    one, two = (va.sweep(machine, variants, scenario, figures="contour", threads=count) for count in (1, 2))
    assert list(one) == list(two)
    for index in (0, 17, 39, 40):
        alone = machine.with_(variants[index]).simulate(scenario, figures="contour")
        assert one[index].figures == alone.figures, variants[index]
    assert one[41].figures is None and "x.position_loop.gain = -1: must lie in" in one[41].error
    table = one.to_pandas()
    assert len(table) == len(variants) and table["axes.x.following_error.max"].nunique() > 30


def test_a_choice_of_figures_leaves_out_the_others(machine: va.Machine) -> None:
    everything = machine.simulate(va.scenario("ballbar")).figures
    axes = machine.simulate(va.scenario("ballbar"), figures="axes").figures
    assert everything["circles"] and everything["contour_error_um"]
    assert not axes["circles"] and axes["contour_error_um"] is None
    for name, figures in everything["axes"].items():
        assert "energy" in figures
        assert axes["axes"][name] == {key: value for key, value in figures.items() if key != "energy"}


def test_machines_runs_and_setpoints_can_be_pickled(machine: va.Machine) -> None:
    changed = machine.with_({"x.position_loop.gain": 2.0})
    assert pickle.loads(pickle.dumps(changed)) == changed != machine
    run = changed.simulate(va.scenario("x-constant"), figures="axes")
    copy = pickle.loads(pickle.dumps(run))
    assert copy.figures == run.figures and np.array_equal(copy.position, run.position)
    scenario = pickle.loads(pickle.dumps(va.scenario("x-constant", feed=3.0)))
    assert np.array_equal(scenario.psec(machine), va.scenario("x-constant", feed=3.0).psec(machine))


def test_a_part_program_runs_as_by_the_command(machine: va.Machine) -> None:
    program = str(ROOT / "config/programs/circle-diamond-square.nc")
    command = [COMMAND, "run", program, "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)
    expected = json.loads(done.stdout)["runs"][0]
    assert "circle-diamond-square" in va.nc_program_names()
    for name_or_path in (program, "circle-diamond-square"):
        run = machine.simulate(va.nc_program(name_or_path))
        assert run.figures["axes"] == expected["axes"]
        assert run.figures["part_program"] == expected["part_program"]
        assert len(run.figures["part_program"]["worst_lines"]) == 10
        page = run.report()
        worst = run.figures["part_program"]["worst_lines"][0]
        assert "Lines with the largest contour errors" in page and "Feed (m/min)" in page
        assert f"{worst['contour_error_um']:.2f}" in page
    assert "part_program" not in machine.simulate(va.nc_program(program), figures="axes").figures
    with pytest.raises(ValueError, match="circle-diamond-square: is a part program; load it with nc_program"):
        va.scenario("circle-diamond-square")


def test_options_of_a_part_program_are_those_of_the_command(machine: va.Machine, tmp_path: Path) -> None:
    file = tmp_path / "part.nc"
    file.write_text("G21 G90 G64 P0.05\nM250\nG1 X20 F6000\nG2 X30 Y10 I0 J10\nG1 Y20\nM2\n")
    options = ["--ignore", "M250", "--chord-error-um", "2", "--centripetal-m-s2", "0.2"]
    command = [COMMAND, "run", str(file), "--json", *options]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)
    expected = json.loads(done.stdout)["runs"][0]
    program = va.nc_program(str(file), ignore=["M250"], chord_error=2e-6, centripetal_acceleration=0.2)
    note = f"{file}:2: M250 is ignored, 1 in all"
    assert f"note: {note}" in done.stderr
    for given in (program, pickle.loads(pickle.dumps(program))):
        with pytest.warns(UserWarning, match=re.escape(note)):
            figures = machine.simulate(given).figures
        assert figures["part_program"] == expected["part_program"]
    with pytest.warns(UserWarning, match=re.escape(note)):
        free = machine.simulate(va.nc_program(str(file), ignore=[250])).figures["part_program"]
    assert free["cycle_time_s"] < figures["part_program"]["cycle_time_s"]
    with pytest.raises(ValueError, match="M250"):
        machine.simulate(va.nc_program(str(file)))


def test_the_setup_of_a_part_program_shifts_the_part_and_adds_its_times(tmp_path: Path) -> None:
    mill = va.Machine.load("vmc")
    file = tmp_path / "part.nc"
    file.write_text("G55 G43 H1 G0 X10 Y20 Z30\nT1 M6\nM3 S900\nG4 P500\nG0 X11\nM30\n")
    table = tmp_path / "shop.tbl"
    table.write_text("T1 Z62.5 D10\n")
    setup = {"dialect": "fanuc", "work_offset": {"G55": (-0.4, -0.25, -0.42)}, "tools": {1: (0.0625, 0.005)}}
    times = {"tool_change_s": 4.5, "spindle_s": 1.25}

    def psec(program: va.PartProgram) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return program.psec(mill)

    plain = psec(va.nc_program(str(file), **setup))
    assert plain[-1] == pytest.approx([-0.389, -0.23, -0.3275], abs=1e-12)
    texts = {"work_offset": "G55=-400,-250,-420", "tools": table}
    assert np.array_equal(psec(va.nc_program(str(file), **{**setup, **texts})), plain)
    timed = va.nc_program(str(file), **setup, **times)
    for program in (timed, pickle.loads(pickle.dumps(timed))):
        added = len(psec(program)) - len(plain)
        assert added * 0.002 == pytest.approx(4.5 + 1.25, abs=1e-9)
    # The parameters of a machine file apply where nothing is given.
    shop = {"part_program.dialect": "fanuc", "part_program.work_offsets": ["G55=-400,-250,-420"]}
    shop |= {"part_program.tools": ["T1 Z62.5"], "part_program.tool_change_s": 4.5, "part_program.spindle_s": 1.25}
    mill = mill.with_(shop)
    assert np.array_equal(psec(va.nc_program(str(file))), psec(timed))


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda m: va.nc_program("a.nc", dialect="plotter"), ValueError, "plotter: not a dialect; must be one of"),
        (lambda m: va.nc_program("a.nc", work_offset="G54=1"), ValueError, "work_offset G54=1: must be a work"),
        (lambda m: va.nc_program("a.nc", tools={1: (1e9, 0)}), ValueError, "tools: line 1: Z1"),
        (lambda m: va.nc_program("a.nc", tools="/nowhere.tbl"), ValueError, "tools: /nowhere.tbl"),
        (lambda m: va.nc_program("a.nc", spindle_s=-1.0), ValueError, "spindle_s -1: must be at least 0"),
        (lambda m: va.Machine.load("nowhere"), ValueError, "nowhere"),
        (lambda m: m.with_({"x.foo": 1}), ValueError, "unknown parameter x.foo"),
        (lambda m: m.with_({"x.position_loop.gain": object()}), TypeError, "x.position_loop.gain"),
        (lambda m: m.simulate(np.zeros((3, 2))), ValueError, "2 columns"),
        (lambda m: m.simulate({"w": [0.0]}), ValueError, "'w' is unknown; known are x, y, z, a, c"),
        (lambda m: m.simulate({"x": [0.0], "y": [0.0, 1.0]}), ValueError, "the shapes x "),
        (lambda m: m.simulate(np.full((3, 5), np.nan)), ValueError, "NaN"),
        (lambda m: m.simulate(np.full((3, 5), 99.0)), ValueError, "travel"),
        (lambda m: m.simulate(np.zeros((0, 5))), ValueError, "setpoint"),
        (lambda m: m.simulate(np.zeros((3, 5)), signals=["torque"]), ValueError, "torque"),
        (lambda m: m.simulate(np.zeros((3, 5)), figures="none"), ValueError, "none"),
        (lambda m: va.Stepper(m, 0), ValueError, "machines 0"),
        (lambda m: va.Stepper(m).step(np.zeros(4)), ValueError, "shape"),
        (
            lambda m: va.Stepper(m).step([np.inf, 0, 0, 0, 0]),
            ValueError,
            "psec: value 0 is inf; it must lie in ±1000000",
        ),
        (lambda m: va.Stepper(m).step([0, 1e308, 0, 0, 0]), ValueError, "psec: value 1 is 1e308"),
        (lambda m: va.Stepper(m).reset([0, 1e308, 0, 0, 0]), ValueError, "position: value 1 is 1e308"),
        (lambda m: va.Stepper(m).step(np.zeros(5), np.full((5, 2), -1e308)), ValueError, "the value -1e308"),
        (lambda m: va.Stepper(m).restore(va.Stepper(m, 2).save()), ValueError, "another number"),
        (lambda m: va.Stepper(m).set_load([1e300] * 5), ValueError, "load: value 0 is 1e300; it must lie in ±1000000"),
        (
            lambda m: va.Stepper(m).restore(va.Stepper(va.Machine.load("linear_motor_center")).save()),
            ValueError,
            "other periods",
        ),
        (lambda m: m.simulate({}), ValueError, "psec has no column of an axis; it needs one or more of x, y"),
        (lambda m: va.scenario("nothing"), ValueError, "nothing"),
        (lambda m: m.simulate(va.nc_program("/nowhere.nc")), ValueError, "/nowhere.nc"),
        (lambda m: va.nc_program("a.nc", feed_override=3.0), ValueError, "feed_override 3"),
        (lambda m: va.nc_program("a.nc", ignore=["x"]), ValueError, 'ignore "x": x: must be a G or M code'),
        (lambda m: va.nc_program("a.nc", chord_error=0.0), ValueError, "chord_error 0: must be above 0"),
        (lambda m: va.nc_program("a.nc", centripetal_acceleration=-1.0), ValueError, "centripetal_acceleration -1"),
        (lambda m: va.sweep(m, [], va.scenario("ballbar"), threads=0), ValueError, "threads 0"),
        (lambda m: va.design.model(m, "w"), ValueError, '"w" is unknown'),
        (lambda m: va.design.gpc(va.design.model(m, "x"), 12), ValueError, "lambda"),
        (lambda m: va.design.gpc(va.design.model(m, "x"), 0, lambda_=1.0), ValueError, "n2"),
    ],
)
def test_an_error_names_the_thing_and_what_is_allowed(call, error, text: str, machine: va.Machine) -> None:
    with pytest.raises(error, match=text.replace("(", r"\(")):
        call(machine)


def test_ctrl_c_ends_a_long_simulation() -> None:
    program = (
        "import numpy as np, virtual_axes_py as va\n"
        "psec = np.zeros((6_000_000, 5)); psec[:, 0] = 0.01 * np.sin(np.arange(len(psec)) * 0.006)\n"
        "print('ready', flush=True)\n"
        "va.Machine.load().simulate(psec, signals=[])\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
    finally:
        process.kill()
        process.wait(timeout=10)
    assert process.returncode != 0 and "KeyboardInterrupt" in errors


def test_a_frequency_response_equals_the_csv_of_the_command(machine: va.Machine) -> None:
    done = subprocess.run([COMMAND, "bode", "--csv"], check=True, capture_output=True, text=True, timeout=120)
    rows = list(csv.DictReader(done.stdout.splitlines()))
    columns = ("frequency_hz", "open_db", "open_deg", "closed_db", "closed_deg")
    for axis in machine.axes:
        for name in ("current", "velocity", "position"):
            found = va.design.frequency_response(machine, axis, name)
            own = [row for row in rows if (row["axis"], row["loop"]) == (axis, name)]
            assert len(own) > 100
            for column in columns:
                values = getattr(found, column)
                assert values.dtype == np.float64
                np.testing.assert_array_equal(values, [float(row[column]) for row in own])
    model = va.design.model(machine, "x")
    transfer = va.design.loop_transfer(model, va.design.of_machine(machine, "x"))
    found = va.design.frequency_response(machine, "x")
    inside = found.frequency_hz < 0.49 / model.period
    expected = transfer(np.exp(2j * np.pi * found.frequency_hz[inside] * model.period))
    np.testing.assert_allclose(found.open_db[inside], 20 * np.log10(np.abs(expected)), atol=1e-6)
    with pytest.raises(ValueError, match="torque.*must be current, velocity, position or contour"):
        va.design.frequency_response(machine, "x", "torque")
    with pytest.raises(ValueError, match="axis .w. is unknown"):
        va.design.frequency_response(machine, "w")


def test_margins_and_poles_equal_those_of_python_control(machine: va.Machine) -> None:
    random = np.random.default_rng(20)
    checked = 0
    while checked < 200:
        axis = str(random.choice(machine.axes))
        model = va.design.model(machine, axis)
        weight = float(10 ** random.uniform(-2, 1))
        rst = va.design.gpc(model, int(random.integers(4, 25)), nu=int(random.integers(1, 3)), lambda_rel=weight)
        try:
            found = va.design.margins(model, rst)
        except ValueError as error:
            # Of an unstable loop there are no margins.
            assert "unstable" in str(error) or "pole" in str(error)
            continue
        loop = va.design.loop_transfer(model, rst)
        gain, phase, *_ = control.stability_margins(loop)
        assert found.gain == pytest.approx(gain, rel=1e-9), (axis, checked)
        assert found.phase == pytest.approx(np.radians(phase), rel=1e-9), (axis, checked)
        assert found.modulus == pytest.approx(modulus_margin(loop), rel=1e-9), (axis, checked)
        _, phases, _, _, crossovers, _ = control.stability_margins(loop, returnall=True)
        delays = np.radians(phases % 360) / crossovers
        assert found.delay == pytest.approx(min(delays, default=np.inf), rel=1e-9), (axis, checked)
        closed = np.sort(np.abs(control.feedback(loop, 1).poles()))[::-1]
        ours = np.sort(np.abs(va.design.poles(model, rst)))[::-1]
        # Leading poles: those near 0 are ill-conditioned in either library.
        assert ours[:2] == pytest.approx(closed[:2], rel=1e-6)
        back = va.design.from_control(va.design.to_control(model))
        assert (back.a, back.period) == (pytest.approx(model.a), model.period)
        checked += 1


def modulus_margin(loop: control.TransferFunction) -> float:
    """Returns min |1 + L| of the frequency response; `stability_margins` returns some local minimum of it."""

    def distance(angle: float) -> float:
        return float(abs(1 + loop(np.exp(1j * angle))))

    grid = np.linspace(1e-6, np.pi, 20_000)
    best = int(np.argmin(np.abs(1 + loop(np.exp(1j * grid)))))
    bounds = (grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)])
    refined = minimize_scalar(distance, bounds=bounds, method="bounded", options={"xatol": 1e-12})
    return min(refined.fun, *map(distance, bounds))


def test_the_types_are_complete() -> None:
    command = [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", "--no-incremental"]
    done = subprocess.run([*command, "-p", "virtual_axes_py"], capture_output=True, text=True, timeout=300, cwd=ROOT)
    assert done.returncode == 0, done.stdout


def test_both_modules_can_be_imported_together(machine: va.Machine) -> None:
    from virtual_axes.msg import DriveStates

    assert DriveStates().get_fields_and_field_types() and machine.axes


@pytest.mark.extended
def test_the_wheel_is_small_and_runs_in_an_empty_environment(tmp_path: Path) -> None:
    wheels = list((ROOT / ".build/wheel").glob("virtual_axes_py-*.whl"))
    assert len(wheels) == 1 and wheels[0].stat().st_size < 15e6
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "env")], check=True, timeout=120)
    python = str(tmp_path / "env/bin/python")
    install = [python, "-m", "pip", "install", "--disable-pip-version-check", "-q", str(wheels[0])]
    subprocess.run(install, check=True, timeout=300)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    program = readme.split("<!-- file: ballbar.py -->\n```python\n")[1].split("```")[0]
    environment = {"PATH": "/usr/bin:/bin"}
    done = subprocess.run([python, "-c", program], capture_output=True, text=True, timeout=60, env=environment)
    assert done.returncode == 0 and done.stdout.startswith("cascade: 68.6 µm"), done.stdout + done.stderr


def test_lifting_without_friction_is_work_against_the_weight(machine: va.Machine) -> None:
    """W h; input, copper loss, work and magnetic energy are balanced."""
    coefficients = ("a", "b", "c", "d", "i0")
    frictionless = machine.with_({f"z.friction.{name}": 0.0 for name in coefficients})
    share = np.clip((np.arange(800) - 20) / 300, 0, 1)
    psec = np.zeros((800, 5))
    psec[:, 2] = 0.1 * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
    figures = frictionless.simulate(psec).figures
    energy = figures["axes"]["z"]["energy"]
    weight = machine.parameters["z.gravity.weight_n"]
    assert energy["mechanical_work_j"] == pytest.approx(0.1 * weight, rel=1e-9)
    parts = energy["copper_loss_j"] + energy["mechanical_work_j"] + energy["magnetic_j"]
    assert energy["input_j"] == pytest.approx(parts, rel=1e-9)
    # At rest the motor holds the weight: (Kt/Ke) R (r W/Kt)².
    kt, ke, resistance = (
        machine.parameters[f"z.motor.{name}"]
        for name in ("torque_constant_nm_a", "emf_constant_v_s_rad", "resistance_ohm")
    )
    lead = machine.parameters["z.transmission.screw_lead_mm"] * 1e-3
    current = weight * lead / (2 * np.pi) / kt
    assert energy["holding_power_w"] == pytest.approx(kt / ke * resistance * current**2, rel=1e-3)
