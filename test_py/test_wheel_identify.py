"""Module `virtual_axes_py`: identification, tuning, recordings and reports equal those of the command."""

from __future__ import annotations

import copy
import json
import pickle
import subprocess
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import virtual_axes_py as va
from node_process import node_binary

COMMAND = str(Path(node_binary()).with_name("virtual_axes"))


def command(*arguments: str | Path) -> str:
    """Returns the output of the command."""
    done = subprocess.run([COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def machine() -> va.Machine:
    """Returns the default machine."""
    return va.Machine.load()


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the trace of the campaign's part without feedforward, of X."""
    folder = tmp_path_factory.mktemp("campaign")
    command("psec", "campaign", "--axis", "x", "--part", "off", "--out", folder / "psec.csv")
    trace = folder / "trace.csv"
    command("run", folder / "psec.csv", "--controller", "cascade-noff", "--trace", trace, "--json")
    return trace


@pytest.fixture(scope="module")
def expected(campaign: Path) -> dict:
    """Returns the identification of the command."""
    return json.loads(command("identify", campaign, "--axis", "x", "--feedforward", "off", "--json"))


def test_an_identification_from_a_file_has_the_values_of_the_command(
    campaign: Path, expected: dict, machine: va.Machine
) -> None:
    found = va.identify(campaign, "x", feedforward="off")
    assert found.summary == expected
    assert found.parameters == {value["key"]: value["value"] for value in expected["values"]}
    assert len(found.findings) == len(expected["findings"])
    # The simulated machine is the initial one, so that the identification must return its friction.
    key = "x.friction.a"
    assert found.parameters[key] == pytest.approx(machine.parameters[key], rel=0.02)
    assert found.machine.parameters[key] == found.parameters[key] != machine.parameters[key]
    assert found.machine.parameters["y.friction.a"] == machine.parameters["y.friction.a"]


def test_an_identification_from_arrays_has_the_values_of_the_file(campaign: Path, expected: dict) -> None:
    table = np.genfromtxt(campaign, delimiter=",", names=True, deletechars="")
    channels = {"time": table["time"]}
    for channel in ("psec", "position", "velocity", "current", "velocity_feedforward", "torque_feedforward"):
        if f"x.{channel}" in table.dtype.names:
            channels[channel] = table[f"x.{channel}"]
    assert {"psec", "position", "current"} <= set(channels)
    found = va.identify(channels, "x", feedforward="off")
    errors = {value["key"]: value["standard_error"] for value in expected["values"]}
    for value in expected["values"]:
        assert found.parameters[value["key"]] == value["value"], value["key"]
    assert found.deviations == errors


@pytest.fixture(scope="module")
def both_encoders() -> dict[str, np.ndarray]:
    """Returns a chirp of an elastic X with a gap of 9 µm, recorded with both encoders each millisecond."""
    changes = {
        "x.transmission.stiffness_n_um": 40.0,
        "x.transmission.damping_n_s_m": 15000.0,
        "x.transmission.load_mass_kg": 1300.0,
        "x.transmission.backlash_um": 9.0,
    }
    time = 0.006 * np.arange(2000)
    phase = 2 * np.pi * 20 / np.log(12) * (12 ** (time / 12) - 1)
    steady = np.clip(10 * np.sin(np.pi * time), -1, 1)
    psec = np.cumsum(0.006 * np.minimum(time / 0.2, 1) * (0.025 * steady + 0.018 * np.sin(phase)))
    signals = ["position", "wind_up", "current"]
    run = va.Machine.load().with_(changes).simulate({"x": psec}, signals=signals, every_tick=True, figures="axes")
    position, wind_up, current = (run.signals[name][::8, 0] for name in signals)
    return {
        "time": run.time[::8],
        "position": position,
        "motor_position": position + wind_up,
        "current": current,
    }


def columns(campaign: Path) -> pd.DataFrame:
    """Returns the recording as a table of channels."""
    table = pd.read_csv(campaign).rename(columns=lambda name: name.removeprefix("x."))
    return table[["time", "psec", "position", "current"]]


def quick(table: object) -> va.Identification:
    """Identifies X without refinement."""
    return va.identify(table, "x", feedforward="off", refine=())


def test_a_slip_in_the_name_of_a_column_gives_a_warning(campaign: Path, tmp_path: Path) -> None:
    table = columns(campaign)
    text = (
        "column curent is not read; the nearest channel is current; rename it, or select it by column='current=curent'"
    )
    with pytest.warns(UserWarning, match=text):
        quick(table.rename(columns={"current": "curent"}))
    with pytest.warns(UserWarning, match="column velocty is not read; the nearest channel is velocity; rename it"):
        expected = quick(table.assign(velocty=0.0)).parameters
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The channel of the name is there, and a column of another axis.
        assert quick(table.assign(**{"curent": 0.0, "y.velocty": 0.0})).parameters == expected


@pytest.mark.parametrize("other", ["Current", " current ", "current [A]"])
def test_two_columns_of_one_channel_are_rejected(campaign: Path, other: str) -> None:
    table = columns(campaign)
    table[other] = 2 * table["current"]
    with pytest.raises(ValueError) as raised:
        quick(table)
    text = f"the columns 'current' and {other!r} for current; select one by its number: column='current=#4'"
    assert text in str(raised.value)
    chosen = va.identify(table, "x", feedforward="off", refine=(), column="current=#4")
    assert chosen.parameters == quick(columns(campaign)).parameters


def test_rows_without_order_and_joined_recordings_have_the_right_reason(campaign: Path) -> None:
    table = columns(campaign)
    with pytest.raises(ValueError, match="stamps are earlier than the one before; sort the rows by time"):
        quick(table.sample(frac=1.0, random_state=1))
    with pytest.raises(ValueError, match="stamps are earlier than the one before; sort the rows by time"):
        quick(table[::-1])
    noise = np.random.default_rng(1).normal(0.0, 1e-7, len(table))
    again = table.assign(position=table["position"] + noise)
    joined = quick(pd.concat([table, again]).sort_values("time", kind="stable"))
    assert joined.parameters == quick(table).parameters
    rows = f"{len(table)} rows have the stamp of the row before and nearly its position"
    assert any(rows in line for line in joined.findings), joined.findings
    # A clock of half the sampling rate has two samples for each stamp.
    coarse = quick(table.assign(time=np.repeat(table["time"].to_numpy()[::2], 2)[: len(table)]))
    assert not any("nearly its position" in line for line in coarse.findings)


def test_recordings_come_from_iterators_and_without_times(campaign: Path) -> None:
    table = columns(campaign)
    expected = quick(table).parameters
    assert quick(campaign.parent.glob("trace.csv")).parameters == quick(campaign).parameters
    assert quick(map(columns, [campaign])).parameters == expected
    period = float(table["time"][1] - table["time"][0])
    timed = table.assign(time=period * np.arange(len(table)))
    untimed = va.identify(table.drop(columns="time"), "x", feedforward="off", refine=(), rate_hz=1 / period)
    assert untimed.parameters == pytest.approx(quick(timed).parameters, rel=1e-6)


def test_an_identification_can_be_copied_and_pickled(campaign: Path) -> None:
    found = quick(campaign)
    assert copy.deepcopy(found).report() == copy.copy(found).report() == found.report()
    again = pickle.loads(pickle.dumps(found))
    assert (again.summary, again.findings, again.machine) == (found.summary, found.findings, found.machine)
    assert repr(again) == repr(found) and pickle.loads(pickle.dumps(again)).summary == found.summary
    with pytest.raises(ValueError, match="a copy from a pickle has no recordings to plot"):
        again.report()
    assert again._repr_html_() is None


def test_both_encoders_identify_a_transmission(both_encoders: dict[str, np.ndarray]) -> None:
    found = va.identify([], "x", transmission=both_encoders)
    found_hz = found.summary["transmission"]["antiresonance_hz"]
    low, high = found_hz["interval"]
    truth = np.sqrt(40e6 / 1300) / (2 * np.pi)
    assert low < truth < high
    assert found.summary["transmission_recordings"][0]["name"] == "recording 1"
    one = {name: values for name, values in both_encoders.items() if name != "motor_position"}
    with pytest.raises(ValueError, match="one encoder does not tell"):
        va.identify([], "x", transmission=one)
    with pytest.raises(ValueError, match="recordings: are empty"):
        va.identify([], "x")


def test_the_report_of_an_identification_has_its_values(campaign: Path) -> None:
    page = va.identify(campaign, "x", feedforward="off", refine=()).report()
    assert page.startswith("<!DOCTYPE html>") and "x.friction.a" in page and "Plotly" in page


@pytest.mark.parametrize(
    ("arguments", "options", "text"),
    [
        (("/nowhere.csv", "x"), {}, "/nowhere.csv"),
        (({"time": [0.0], "angle": [0.0]}, "x"), {}, "channel 'angle' is unknown"),
        (({"time": [0.0], "curent": [0.0]}, "x"), {}, "channel 'curent' is unknown; the nearest is current"),
        (({"position": [0.0]}, "x"), {}, "recording has no channel time (s); add it, or give rate_hz"),
        (({"time": [0.0, 1.0], "position": [0.0]}, "x"), {}, "recording 1"),
        ((([]), "x"), {}, "at least one"),
        (("/nowhere.csv", "w"), {}, '"w" is unknown; known are x, y, z, a, c'),
        (("/nowhere.csv", "x"), {"feedforward": "some"}, "off, velocity or both"),
        (("/nowhere.csv", "x"), {"feedforward": ["off", "both"]}, "2 values for 1 recordings"),
        (("/nowhere.csv", "x"), {"refine": ["mass"]}, "mass"),
        (("/nowhere.csv", "x"), {"psec_shift": 2000.0}, "-1000 to 1000 ms"),
        (("/nowhere.csv", "x"), {"format": "xls"}, "xls"),
    ],
)
def test_an_error_of_an_identification_names_the_thing(arguments: tuple, options: dict, text: str) -> None:
    with pytest.raises(ValueError) as raised:
        va.identify(*arguments, **options)
    assert text in str(raised.value)


@pytest.mark.parametrize("controller", ["gpc", "cascade"])
def test_a_tuning_has_the_values_of_the_command(controller: str, machine: va.Machine) -> None:
    text = command("tune", "corner-90", "--controller", controller, "--also", "x-constant", "--json")
    found = va.tune(machine, va.scenario("corner-90"), controller=controller, also=[va.scenario("x-constant")])
    assert found.summary == json.loads(text)
    assert found.cost < found.initial_cost
    assert found.pareto[0]["cost"] == found.cost
    again = found.machine.simulate(va.scenario("corner-90"))
    assert again.figures["contour_error_um"]["max"] == pytest.approx(found.cost, rel=1e-12)


def test_a_robustness_has_the_values_of_the_command(machine: va.Machine) -> None:
    expected = json.loads(command("robustness", "corner-90", "--by", "0.2", "--json"))
    found = va.robustness(machine, va.scenario("corner-90"), by=0.2)
    assert found.summary == expected
    nominal = machine.simulate(va.scenario("corner-90"))
    assert found.nominal_cost == pytest.approx(nominal.figures["contour_error_um"]["max"], rel=1e-12)
    assert found.worst_cost > found.nominal_cost
    with pytest.raises(ValueError, match=r"by 0.9: must be in 0 … 0.8"):
        va.robustness(machine, va.scenario("corner-90"), by=0.9)


def test_learned_setpoints_have_the_values_of_the_command(machine: va.Machine) -> None:
    expected = json.loads(command("learn", "corner-90", "--iterations", "3", "--json"))
    found = va.learn(machine, va.scenario("corner-90"), iterations=3)
    assert found.summary == expected
    assert found.best == expected["best"] > 0
    # The compensated setpoints are repeatable: a run of them has the following errors of the iteration.
    again = machine.simulate(found.psec, figures="axes").figures["axes"]
    figures = expected["iterations"][found.best]["figures"]["axes"]["x"]
    assert again["x"] == {key: value for key, value in figures.items() if key != "energy"}
    with pytest.raises(ValueError, match=r"gain 3\.0: must be above 0 and at most 2"):
        va.learn(machine, va.scenario("corner-90"), gain=3)


def test_only_stated_values_make_a_recording_implausible(machine: va.Machine, tmp_path: Path) -> None:
    slow = machine.with_({"x.feedforward.velocity": 0.0, "x.feedforward.torque_kg_m2": 0.0})
    run = slow.simulate(va.scenario("x-there-and-back"))
    channels = {"time": run.time, **{name: run.axis("x")[name] for name in ("psec", "position")}}
    limit = machine.parameters["x.motor.max_current_a"]
    # Up to 8 times the current limit of the built-in motor, more than the 5 times that are plausible.
    steady = np.quantile(np.abs(run.current[:, 0]), 0.99)
    channels["current"] = run.current[:, 0] * 8 * limit / steady
    assert 8 * limit < 1000
    (tmp_path / "machine.yaml").write_text(slow.to_yaml())

    def doubts(given: va.Machine) -> bool:
        try:
            findings = va.identify(channels, "x", given, feedforward="off", refine=()).findings
        except ValueError as error:
            findings = [str(error)]
        return any("the current reaches" in line for line in findings)

    stated = [va.Machine.load(tmp_path / "machine.yaml"), slow.with_({"x.motor.max_current_a": limit})]
    assert [doubts(one) for one in (slow, *stated)] == [False, True, True]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"controller": "rst"}, "must be gpc, cascade or contour"),
        ({"controller": "gpc", "seed": 3}, "seed requires controller cascade"),
        ({"controller": "cascade", "designs": 3}, "designs requires controller gpc"),
        ({"controller": "gpc", "designs": 0}, "designs 0: must be from 1 to 1000000"),
        ({"controller": "gpc", "modulus_margin": 2.0}, "modulus_margin 2: must be in 0 … 1"),
        ({"controller": "gpc", "cost": "beauty"}, "beauty"),
        ({"controller": "gpc", "contrast": True}, "exactly one path"),
        ({"controller": "gpc", "modulus_margin": 1.0}, "x-constant: "),
    ],
)
def test_an_error_of_a_tuning_names_the_option(options: dict, text: str, machine: va.Machine) -> None:
    with pytest.raises(ValueError) as raised:
        va.tune(machine, va.scenario("x-constant"), **options)
    assert text in str(raised.value)


def test_a_recording_of_a_run_has_the_bytes_of_the_command(machine: va.Machine, tmp_path: Path) -> None:
    command("run", "corner-90", "--trace", tmp_path / "command.mcap", "--json")
    run = machine.simulate(va.scenario("corner-90"), signals=["position"], figures="axes")
    run.to_mcap(tmp_path / "module.mcap")
    assert (tmp_path / "module.mcap").read_bytes() == (tmp_path / "command.mcap").read_bytes()
    with pytest.raises(ValueError, match=r"must be \.mcap"):
        run.to_mcap(tmp_path / "trace.csv")
    with pytest.raises(OSError):
        run.to_mcap("/nowhere/trace.mcap")


def test_the_report_of_a_run_is_the_page_of_the_command(machine: va.Machine, tmp_path: Path) -> None:
    run = machine.simulate(va.scenario("ballbar"), signals=[])
    command("run", "ballbar", "--report", tmp_path / "page.html", "--quiet")
    page, expected = run.report(), (tmp_path / "page.html").read_text()
    # The last section of the page says how it was made: date, command line and machine file.
    end = expected.index("virtual_axes 0")
    head = expected[: expected.rindex("<h2", 0, end)]
    assert len(head) > 50_000 and page.startswith(head)
    embedded = run._repr_html_()
    assert embedded.startswith("<iframe srcdoc=") and "circular deviation G" in embedded
    # The script runs, without the origin of the notebook.
    assert embedded.endswith('sandbox="allow-scripts"></iframe>')


def test_a_run_without_its_part_program_shows_a_table(machine: va.Machine, tmp_path: Path) -> None:
    program = tmp_path / "line.nc"
    program.write_text("G21 G90 G94\nG1 X10 F1000\nM30\n")
    run = machine.simulate(va.nc_program(str(program)))
    assert "<iframe" in run._repr_html_()
    program.unlink()
    assert run._repr_html_().startswith("<table>")
