"""Module `virtual_axes_py`: tables with named columns, loads, signals of the tool, times of errors, paths and types."""

from __future__ import annotations

import copy
import csv
import json
import pickle
import subprocess
import sys
import types
from datetime import timedelta
from decimal import Decimal
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import virtual_axes_py as va
from node_process import node_binary

COMMAND = str(Path(node_binary()).with_name("virtual_axes"))
COUNT = 100
X, Y = np.linspace(0, 0.01, COUNT), np.linspace(0, -0.005, COUNT)
TIMES = 0.006 * np.arange(COUNT)
# Over the change to summer time: the steps are of the time of the world.
CLOCK = pd.date_range("2024-03-31 01:59:59.9", periods=COUNT, freq="6ms", tz="Europe/Berlin")


@pytest.fixture(scope="module")
def machine() -> va.Machine:
    """Returns the default machine."""
    return va.Machine.load()


class Column:
    """Column of a stand-in for polars: values without the interface of NumPy but its conversion."""

    def __init__(self, name: str, values: np.ndarray) -> None:
        """Stores name and values."""
        self.name, self._values = name, values
        self.dtype = "Float64"

    def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
        """Returns the values."""
        return self._values


class ColumnFrame:
    """Stand-in for a DataFrame of polars, with the names that are used."""

    def __init__(self, columns: dict[str, np.ndarray]) -> None:
        """Stores the columns."""
        self.columns, self._columns = list(columns), columns

    def get_columns(self) -> list[Column]:
        """Returns the columns."""
        return [Column(name, values) for name, values in self._columns.items()]


TABLES = {
    "dictionary": {"y": Y, "x": X},
    "pandas": pd.DataFrame({"a": 0 * X, "y": Y, "x": X}),
    "pandas, nullable": pd.DataFrame({"y": Y, "x": X}).convert_dtypes(),
    "pandas, time as index": pd.DataFrame({"y": Y, "x": X}, index=pd.Index(TIMES, name="time")),
    "pandas, durations": pd.DataFrame({"y": Y, "x": X}, index=pd.to_timedelta(6 * np.arange(COUNT), unit="ms")),
    "pandas, time as column": pd.DataFrame({"y": Y, "time": TIMES, "x": X}),
    "pandas, time zone": pd.DataFrame({"y": Y, "x": X}, index=CLOCK),
    "pandas, dates as column": pd.DataFrame({"time": CLOCK.tz_convert("UTC").tz_localize(None), "y": Y, "x": X}),
    "pandas, objects": pd.DataFrame({"y": Y, "x": X}, dtype=object),
    "pandas, rows of a selection": pd.DataFrame({"y": [9, *Y], "x": [9, *X]}).iloc[1:],
    "pandas, two indices": pd.DataFrame({"x": X}, index=pd.MultiIndex.from_arrays([TIMES, Y], names=["time", "y"])),
    "dates of Python": {"time": list(CLOCK.to_pydatetime()), "y": Y, "x": X},
    "durations of Python": {"time": [timedelta(milliseconds=6 * row) for row in range(COUNT)], "y": Y, "x": X},
    "decimals": {"y": [Decimal(repr(float(value))) for value in Y], "x": X},
    "PyArrow, dates": pa.table({"y": Y, "time": pa.array(CLOCK), "x": X}),
    "pandas, axis as index": pd.DataFrame({"x": X}, index=pd.Index(Y, name="y")),
    "PyArrow": pa.table({"y": Y, "x": X}),
    "structured array": np.rec.fromarrays([Y, X], names="y,x"),
    "polars": ColumnFrame({"y": Y, "x": X}),
}


@pytest.mark.parametrize("name", TABLES)
def test_columns_of_a_table_are_matched_by_name(name: str, machine: va.Machine) -> None:
    psec = np.zeros((COUNT, 5))
    psec[:, 0], psec[:, 1] = X, Y
    found = machine.simulate(TABLES[name])
    assert np.array_equal(found.position, machine.simulate(psec).position)
    assert found.position[-1] == pytest.approx([0.01, -0.005, 0, 0, 0], abs=1e-6)


def test_columns_of_real_polars_and_xarray_are_matched_by_name(machine: va.Machine) -> None:
    polars, xarray = pytest.importorskip("polars"), pytest.importorskip("xarray")
    expected = machine.simulate({"x": X, "y": Y}).position
    tables = [
        polars.DataFrame({"y": Y, "x": X}),
        polars.DataFrame({"y": Y, "time": TIMES, "x": X}),
        xarray.Dataset({"y": ("time", Y), "x": ("time", X)}, coords={"time": TIMES}),
        xarray.DataArray(np.column_stack([Y, X]), dims=("k", "axis"), coords={"axis": ["y", "x"]}),
    ]
    for table in tables:
        assert np.array_equal(machine.simulate(table).position, expected)
    unnamed = xarray.DataArray(np.zeros((COUNT, 5)), dims=("time", "axis"), coords={"time": TIMES})
    with pytest.raises(ValueError, match="psec has the coordinates time; one of them must name the columns"):
        machine.simulate(unnamed)


def test_a_table_with_times_is_interpolated_as_by_the_command(machine: va.Machine, tmp_path: Path) -> None:
    table = pd.DataFrame({"time": 0.7 * TIMES, "y": Y, "x": X})
    table.to_csv(tmp_path / "psec.csv", index=False)
    done = subprocess.run([COMMAND, "run", tmp_path / "psec.csv", "--json"], capture_output=True, text=True, timeout=60)
    expected = json.loads(done.stdout)["runs"][0]
    run = machine.simulate(table)
    assert run.figures == {key: expected[key] for key in run.figures}


@pytest.mark.parametrize(
    ("table", "text"),
    [
        (pd.DataFrame({"x": X, "w": X}), "psec: axis 'w' is unknown; known are x, y, z, a, c .m or rad., and time .s."),
        ({"X": X}, "axis 'X' is unknown; the nearest is x"),
        (pd.DataFrame({"x": X}, index=TIMES), "psec has an index of type float64 without a name: name it time"),
        (
            pd.DataFrame({"x": X}, index=pd.MultiIndex.from_arrays([TIMES, Y])),
            "psec has an index of type object without a name",
        ),
        (
            pd.DataFrame({("x", "psec"): X, ("x", "position"): X}),
            r"columns of 2 levels, as \('x', 'psec'\); it needs one",
        ),
        (np.ma.masked_greater(np.column_stack([X] + 4 * [0 * X]), 0.005), "at 0.3 s: x: position is NaN"),
        ({"time": TIMES, "x": np.where(X > 0.005, np.nan, X)}, "psec: row 50 of x is NaN, not a finite number"),
        ({"time": np.where(X > 0, np.nan, X), "x": X}, "psec: row 1 of time is NaN, not a finite number"),
        ({"time": np.maximum(TIMES, 0.0301), "x": X}, "psec: row 1 has the time 0.0301 s, after 0.0301 s; times must"),
        ({"time": TIMES - 1, "x": X}, "psec: the times begin at -1 s; they must begin at 0 s or later"),
        (pd.DataFrame({"x": X}, index=pd.Index(X, name="z1")), "axis 'z1' is unknown"),
        (pd.DataFrame(np.column_stack([X, Y]), columns=["x", "x"]), "two columns 'x'"),
        (pd.DataFrame({"time": TIMES[::-1], "x": X}), "time"),
        (pd.DataFrame({"time": TIMES}), "psec has no column of an axis; it needs one or more of x"),
        (pd.DataFrame(np.zeros((3, 4))), "psec has 4 columns"),
    ],
)
def test_an_unknown_column_is_refused(table: object, text: str, machine: va.Machine) -> None:
    with pytest.raises(ValueError, match=text):
        machine.simulate(table)


def test_a_table_with_times_begins_at_rest_in_its_first_row(machine: va.Machine) -> None:
    run = machine.simulate({"time": TIMES, "x": 0.2 + X})
    assert run.position[0, 0] == 0.2
    assert run.position[-1, 0] == pytest.approx(0.21, abs=1e-6)


def test_a_stepper_takes_values_by_axis_name(machine: va.Machine) -> None:
    one, other = va.Stepper(machine), va.Stepper(machine)
    one.set_load({"x": 500.0})
    other.set_load([500.0, 0, 0, 0, 0])
    for row in va.scenario("corner-90").psec(machine)[:50]:
        by_name = pd.Series(dict(zip(machine.axes, row)))[::-1]
        assert np.array_equal(one.step(by_name), other.step(row))
    with pytest.raises(ValueError, match="psec has no value for y"):
        one.step({"x": 0.0})


def test_loads_have_the_bits_of_a_stepper_and_their_current(machine: va.Machine) -> None:
    psec = va.scenario("corner-90").psec(machine)
    loads = np.zeros((len(psec), 5))
    loads[:, 0] = 400 * np.sin(np.arange(len(psec)) / 20)
    run = machine.simulate(psec, loads=pd.DataFrame({"x": loads[:, 0]}))
    stepper = va.Stepper(machine)
    stepper.reset(psec[0])
    for cycle in range(len(psec) - 1):
        stepper.set_load(loads[cycle])
        assert np.array_equal(stepper.step(psec[cycle]), run.position[cycle + 1])
    constant = machine.simulate(psec, loads={"x": 500.0})
    parameters = machine.parameters
    # The torque F·p/(2π) of the screw over the torque constant.
    radius = parameters["x.transmission.screw_lead_mm"] * 1e-3 / (2 * np.pi)
    expected = -500 * radius / parameters["x.motor.torque_constant_nm_a"]
    assert constant.load_current[5:, 0] == pytest.approx(expected, rel=1e-9)
    assert not constant.load_current[:, 1].any()
    by_axis = machine.simulate(psec, loads=pd.Series({"x": 500.0}))
    assert np.array_equal(by_axis.load_current, constant.load_current)
    with pytest.raises(ValueError, match="loads: axis 'w' is unknown"):
        machine.simulate(psec, loads={"w": 1.0})
    with pytest.raises(ValueError, match=r"loads have the shapes x \(2,\), y \(3,\); they need one common length"):
        machine.simulate(psec, loads={"x": [0.0] * 2, "y": [0.0] * 3})
    with pytest.raises(ValueError, match="loads: row 0 of x is"):
        machine.simulate(psec, loads={"x": np.inf})


@pytest.mark.parametrize("every_tick", [False, True])
def test_signals_of_the_tool_have_the_figures(every_tick: bool, machine: va.Machine) -> None:
    run = machine.simulate(va.scenario("five-axis"), every_tick=every_tick)
    assert 1e6 * run.contour_error.max() == run.figures["contour_error_um"]["max"]
    errors = run.figures["orientation_error_mdeg"]
    assert np.degrees(1e3 * run.orientation_error.max()) == pytest.approx(errors["max"], rel=1e-12)
    assert run.contour_error.shape == run.feed.shape == run.time.shape
    if every_tick:
        squares = np.mean(np.square(run.contour_error))
        assert 1e6 * np.sqrt(squares) == pytest.approx(run.figures["contour_error_um"]["rms"], rel=1e-9)


def test_path_and_feed_of_the_tool_have_their_closed_form(machine: va.Machine) -> None:
    run = machine.simulate(va.scenario("corner-90"))
    # Without rotary motion the tip moves as the axes do.
    start = run.tool_path[0] - run.position[0, :3]
    assert run.tool_path == pytest.approx(run.position[:, :3] + start, abs=1e-12)
    assert run.feed == pytest.approx(np.linalg.norm(run.velocity[:, :3], axis=1), abs=1e-9)
    turning = machine.simulate({"c": np.linspace(0, 0.5, 2000), "x": np.full(2000, 0.1)})
    # The tip at 0.1 m from the axis of C: v = ω r.
    assert turning.feed[1500] == pytest.approx(0.1 * abs(turning.velocity[1500, 4]), rel=1e-6)
    assert turning.contour_error.max() < 1e-3
    with pytest.raises(AttributeError, match="'contour_error' of the tool is not recorded"):
        print(machine.simulate({"x": X}, figures="axes").contour_error)
    with pytest.raises(ValueError, match="signal 'feed' needs contour errors"):
        machine.simulate({"x": X}, figures="axes", signals=["feed"])


@pytest.mark.parametrize("row", [1, 50, 511, 512, 600, 999])
def test_a_limit_error_has_the_time_of_its_setpoint(row: int, machine: va.Machine) -> None:
    psec = np.zeros((1000, 5))
    psec[row:, 0] = 0.2
    with pytest.raises(ValueError, match=f"^at {row * 6 / 1000:.6g} s: x") as raised:
        machine.simulate(psec)
    assert ", point" not in str(raised.value) or f"x, point {row}: " in str(raised.value)
    psec = np.zeros((1000, 5))
    psec[row:, 1] = np.linspace(0, 1e-3 * (1000 - row), 1000 - row)
    psec[row, 1] = 9.0
    with pytest.raises(ValueError, match=f"^at {row * 6 / 1000:.6g} s: y"):
        machine.simulate(psec)
    with pytest.raises(ValueError, match=f"^at {row * 6 / 1000:.6g} s: y"):
        machine.simulate({"time": 0.006 * np.arange(1000), "y": psec[:, 1]})
    # Limits are results of the audit.
    assert not va.check(machine, {"time": 0.006 * np.arange(1000), "y": psec[:, 1]}).is_within_limits


def test_a_data_frame_is_a_recording(machine: va.Machine, tmp_path: Path) -> None:
    slow = machine.with_({"x.feedforward.velocity": 0.0, "x.feedforward.torque_kg_m2": 0.0})
    run = slow.simulate(va.scenario("x-there-and-back"))
    channels = {"time": run.time, **{name: run.axis("x")[name] for name in ("psec", "position", "current")}}
    expected = va.identify(channels, "x", slow, feedforward="off").parameters
    frame = pd.DataFrame(channels)
    assert va.identify(frame, "x", slow, feedforward="off").parameters == expected
    dated = pd.Timestamp("2024-01-01", tz="UTC") + pd.to_timedelta(run.time, unit="s")
    tables = [
        frame.set_index("time"),
        frame.drop(columns="time").set_index(dated),
        frame.astype(object).assign(operator="A"),
        {**channels, "time": dated},
    ]
    for table in tables:
        assert va.identify([table], "x", slow, feedforward="off").parameters == pytest.approx(expected, rel=1e-9)
    named = pd.DataFrame({"t_ms": 1e3 * run.time, "y.position": run.position[:, 1]})
    for channel, unit, factor in (("psec", "mm", 1e3), ("position", "mm", 1e3), ("current", "A", 1.0)):
        named[f"x.{channel} [{unit}]"] = factor * channels[channel]
    named.to_csv(tmp_path / "recording.csv", index=False)
    by_units = va.identify(named, "x", slow, feedforward="off")
    from_file = va.identify(tmp_path / "recording.csv", "x", slow, feedforward="off")
    assert by_units.parameters == from_file.parameters
    assert by_units.parameters["x.friction.a"] == pytest.approx(expected["x.friction.a"], rel=1e-3)


def test_paths_are_accepted_and_the_version_is_that_of_the_command(machine: va.Machine, tmp_path: Path) -> None:
    (tmp_path / "machine.yaml").write_text(machine.to_yaml())
    assert va.Machine.load(tmp_path / "machine.yaml") == machine
    (tmp_path / "part.nc").write_text("G21 G90 G94\nG1 X10 F1000\nM30\n")
    assert machine.simulate(va.nc_program(tmp_path / "part.nc")).figures["axes"]["x"]["moves"]
    root = Path(__file__).resolve().parent.parent
    assert va.scenario(root / "config/scenarios/x-constant.yaml").name
    done = subprocess.run([COMMAND, "--version"], capture_output=True, text=True, timeout=30)
    assert done.stdout.split()[-1] == va.__version__ or va.__version__ in done.stdout
    with pytest.raises(TypeError, match="name_or_path is of type int"):
        va.Machine.load(3)


KEYS = [f"{axis}.position_loop.gain" for axis in "xyzac"]


def test_the_text_of_each_object_is_short(machine: va.Machine) -> None:
    run = machine.simulate(va.scenario("ballbar"))
    results = va.sweep(machine, [{"x.position_loop.gain": 2.0}], va.scenario("x-constant"))
    response = va.design.frequency_response(machine, "x")
    model = va.design.model(machine, "x")
    rst = va.design.gpc(model, 12, lambda_rel=0.1)
    objects = [machine, run, results, results[0], response, va.Stepper(machine), va.scenario("ballbar"), *run.circles()]
    objects += [model, rst, va.design.margins(model, rst), va.random_variants(1, 5, {key: (0, 1) for key in KEYS})]
    objects += va.sweep(machine, [dict.fromkeys(KEYS, 1.0)], va.scenario("x-constant"))
    for one in objects:
        assert len(repr(one)) < 160 and "\n" not in repr(one) and "object at" not in repr(one), repr(one)
    assert f"{run.figures['contour_error_um']['max']:.6g} µm" in repr(run)
    assert {"position", "contour_error", "following_error", "plot_polar"} <= set(dir(run))
    assert {"gpc", "Rst"} <= set(dir(va.design)) and not {"Any", "Machine", "annotations"} & set(dir(va.design))


def test_an_error_of_a_key_has_the_nearest_one(machine: va.Machine) -> None:
    run = machine.simulate({"x": X})
    swept = va.sweep(machine, [{}], va.scenario("x-constant"))[0].figures
    calls = {
        "'x.position_loop.gian' is unknown; the nearest is x.position_loop.gain": lambda: machine.parameters[
            "x.position_loop.gian"
        ],
        "'contour_eror_um' is unknown; the nearest is contour_error_um": lambda: run.figures["contour_eror_um"],
        "'X' is unknown; the nearest is x; known are x, y, z, a, c": lambda: swept["axes"]["X"],
        "'positon' is unknown; the nearest is position": lambda: run.signals["positon"],
        "'curent' is unknown; the nearest is current": lambda: run.axis("x")["curent"],
        "'w' is unknown; known are x": lambda: va.check(machine, va.scenario("x-constant")).axes["w"],
    }
    for text, call in calls.items():
        with pytest.raises(KeyError, match=f"key {text}"):
            call()
    for one in (run.figures, machine.parameters, run.axis("x")):
        assert pickle.loads(pickle.dumps(one)).keys() == one.keys() == copy.deepcopy(one).keys()
    assert json.loads(json.dumps(run.figures)) == run.figures


def test_mypy_finds_wrong_names_and_nothing_else(tmp_path: Path) -> None:
    program = """\
import pathlib
import numpy as np
import pandas as pd
import virtual_axes_py as va
machine = va.Machine.load(pathlib.Path("machine.yaml"))
run = machine.simulate({"x": np.zeros(3)}, loads={"x": 1.0})
error: float = float(run.contour_error.max()) + float(run.position[0, 0])
machine.simulate(pd.DataFrame({"x": [0.0]}))
other = machine.with_controller("x", va.design.of_machine(machine, "x"))
va.Stepper(machine).step({axis: 0.0 for axis in machine.axes})
run.positon
machine.simulat
va.tunes
run.figure
"""
    file = tmp_path / "program.py"
    file.write_text(program)
    command = [sys.executable, "-m", "mypy", "--ignore-missing-imports", "--no-incremental", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    lines = [int(line.split(":")[1]) for line in done.stdout.splitlines() if ": error:" in line]
    assert lines == [11, 12, 13, 14], done.stdout


def test_recorded_signals_are_in_the_table(machine: va.Machine, tmp_path: Path) -> None:
    run = machine.simulate(va.scenario("x-constant"))
    run.to_pandas().to_csv(tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(newline="") as file:
        header = next(csv.reader(file))
    assert {"time", "x.position", "contour_error", "tool_path.x", "feed"} <= set(header)


def test_the_index_of_series_in_a_dictionary_is_the_time(machine: va.Machine) -> None:
    index = pd.Index(2 * TIMES, name="time")
    given = {"x": pd.Series(X, index=index), "y": pd.Series(Y, index=index)}
    np.testing.assert_array_equal(machine.setpoints(given), machine.setpoints(pd.DataFrame(given)))
    with pytest.raises(ValueError, match="the Series of psec have different indices; align them"):
        machine.setpoints({"x": pd.Series(X), "y": pd.Series(Y)[::-1]})
    with pytest.raises(ValueError, match=r"psec has columns of 2 levels, as \('pos', 'x'\)"):
        machine.setpoints(pd.DataFrame({("pos", "x"): X}))


class LabeledRow:
    """Stand-in for a DataArray of xarray with one value for each axis."""

    def __init__(self, **values: float) -> None:
        """Stores values by axis."""
        self.dims, self.ndim = ("axis",), 1
        self.values = np.array([*values.values()])
        self.coords = {"axis": types.SimpleNamespace(values=np.array([*values]))}

    def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
        """Returns the values without labels."""
        return self.values


def test_labels_of_a_data_array_name_the_axes(machine: va.Machine) -> None:
    stepper, row = va.Stepper(machine), LabeledRow(c=0.0, a=0.0, x=1e-4, y=0.0, z=0.0)
    for _ in range(100):
        stepper.step(row)
    np.testing.assert_allclose(stepper.position, [1e-4, 0, 0, 0, 0], atol=1e-6)
    run = machine.simulate(np.zeros((5, 5)), loads=LabeledRow(c=0.0, x=500.0))
    assert [run.load_current[:, axis].any() for axis in (0, 4)] == [True, False]


def test_iterators_and_named_series_are_setpoints(machine: va.Machine) -> None:
    expected = machine.simulate({"x": X}).position
    rows = np.column_stack([X, *[np.zeros_like(X)] * 4])
    given = [
        {"x": iter(X)},
        {"x": map(float, X)},
        (list(row) for row in rows),
        pd.Series(X, name="x"),
        pd.DataFrame({"y": 0.0 * X, "x": X})["x"],
    ]
    for one in given:
        assert np.array_equal(machine.simulate(one).position, expected)
    with pytest.raises(ValueError, match="axis 'xx' is unknown"):
        machine.simulate(pd.Series(X, name="xx"))
    changes = pd.DataFrame({"x.position_loop.gain": [1.0, 2.0]})
    assert machine.with_(changes.iloc[1]) == machine.with_({"x.position_loop.gain": 2.0})
    with pytest.raises(TypeError, match=r"variants is a DataFrame.*to_dict\('records'\)"):
        va.sweep(machine, changes, va.scenario("x-constant"))
    assert len(va.sweep(machine, changes.to_dict("records"), va.scenario("x-constant"))) == 2


class LazyTable:
    """Lazy table as of polars, whose columns are known when it is collected."""

    def collect_schema(self) -> dict:
        """Returns the types of the columns."""
        return {"x": float}

    def collect(self) -> pd.DataFrame:
        """Returns the table."""
        return pd.DataFrame({"x": X})


def test_a_lazy_table_is_collected(machine: va.Machine) -> None:
    assert np.array_equal(machine.simulate(LazyTable()).position, machine.simulate({"x": X}).position)
