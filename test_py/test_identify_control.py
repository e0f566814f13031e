"""Control profiles identified from setpoints of generated controls, whose parameters are known."""

from __future__ import annotations

import csv
import json
import math
import os
import random
import statistics
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from generated_control import Control, motion_time, write

CHECKOUT = Path(__file__).parents[1]
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", CHECKOUT / "target")) / "release" / "virtual_axes"
OFFSET = ["--work-offset", "G54=0,0,0"]
SEEDS = range(2000, 2016)
"""Seeds of the test; 100 of them with `python test_identify_control.py 2000 2100`."""
PARAMETERS, TIME = 0.02, 0.01
"""Largest relative errors of parameters and of the time of unseen programs."""
RECORDED_SEEDS = (3003, 3004, 3009, 3014)
"""Seeds with recorded positions: each kind of smoothing and of corners; `--recorded` after the range for others."""
RECORDED_PARAMETERS = 0.05
"""Largest relative error of parameters from recorded positions."""
ENCODER = 1e-7
"""Resolution of the recorded positions, m."""
DRIVES = [f"{axis}.motor.{value}" for axis in "xyz" for value in ("max_speed_rpm=3000", "max_voltage_v=400")]
"""Drives that reach the rapid traverse of all controls."""


def command(*words: object) -> str:
    """Runs the command and returns its output."""
    run = subprocess.run([COMMAND, *map(str, words)], capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


def unseen(seed: int) -> str:
    """Returns a program with pockets, polylines, plunges and circles."""
    draw = random.Random(seed)
    text = ["G21 G90 G94 G17 G64 P0.05"]
    for _ in range(4):
        x, y = draw.uniform(-500, -250), draw.uniform(-300, -100)
        tolerance = draw.choice([0.01, 0.02, 0.05, 0.1])
        text += [
            f"G64 P{tolerance}",
            f"G0 X{x:.3f} Y{y:.3f}",
            f"G1 Z-{draw.uniform(1, 5):.3f} F{draw.uniform(300, 2000):.0f}",
        ]
        heading, feed = draw.uniform(0, 360), draw.uniform(1500, 9000)
        for index in range(draw.randint(8, 25)):
            heading += draw.choice([-1, 1]) * draw.uniform(12, 130)
            length = draw.choice([draw.uniform(2, 8), draw.uniform(8, 40)])
            x, y = x + length * math.cos(math.radians(heading)), y + length * math.sin(math.radians(heading))
            text.append(f"G1 X{x:.4f} Y{y:.4f}" + (f" F{feed:.0f}" if index == 0 else ""))
        text += ["G4 P0.1", f"G3 I{draw.uniform(3, 20):.3f} J0 F{draw.uniform(2000, 12000):.0f}", "G4 P0.1", "G0 Z0"]
    return "\n".join([*text, "M2\n"])


def record(folder: Path, log: Path, control: Control, deviation: float) -> None:
    """Replaces setpoints by the positions of axes whose inertia deviates by a factor."""
    trace = folder / "trace.csv"
    settings = [*DRIVES, f"periods.position_ms={1e3 * control.period:g}"]
    limits = ("limits.velocity_m_min=45", "limits.acceleration_m_s2=20", f"deviation.inertia={deviation}")
    settings += [f"{axis}.{limit}" for axis in "xyz" for limit in limits]
    options = [word for setting in settings for word in ("--set", setting)]
    command("run", log, "--machine", "vmc", "--trace", trace, "--quiet", *options)
    with trace.open() as file:
        rows = [
            [row[name] for name in ("time", *(f"{axis}.position" for axis in "xyz"))] for row in csv.DictReader(file)
        ]
    lines = (",".join([row[0], *(f"{ENCODER * round(float(cell) / ENCODER):.7f}" for cell in row[1:])]) for row in rows)
    log.write_text("\n".join(["time,x,y,z", *lines, ""]))


def planned_time(folder: Path, machine: Path, program: Path) -> float:
    """Returns the time from the first to the last motion in a profile, s."""
    out = folder / "planned.csv"
    settings = ["periods.position_ms=1"]
    settings += [f"{axis}.limits.travel_{end}" for axis in "xyz" for end in ("min_mm=-9999", "max_mm=9999")]
    options = [word for setting in settings for word in ("--set", setting)]
    command("psec", program, "--machine", machine, "--out", out, *options, *OFFSET)
    with out.open() as file:
        rows = [[round(float(cell), 9) for cell in row[1:]] for row in list(csv.reader(file))[1:]]
    moved = [index for index in range(1, len(rows)) if rows[index] != rows[index - 1]]
    return 1e-3 * (moved[-1] - moved[0] + 1)


def expected(control: Control) -> dict[str, float]:
    """Returns the parameters that the setpoints of a probe program show."""
    found = {
        "control.wait_ms": 1e3 * control.wait,
        "control.tangential_fraction": control.tangential_fraction,
        "control.normal_fraction": control.normal_fraction,
        "control.overlap_fraction": 1.0,
        "control.block_cycle_ms": 1e3 * control.block_cycle,
        "control.look_ahead": control.look_ahead,
    }
    for index, axis in enumerate("xyz"):
        found[f"{axis}.limits.acceleration_m_s2"] = control.acceleration[index]
        found[f"{axis}.limits.velocity_m_min"] = 60 * control.velocity[index]
        if control.jerk is not None:
            found[f"{axis}.limits.jerk_m_s3"] = control.jerk[index]
            # An axis whose rapid traverse is slower than a²/j does not reach its acceleration.
            if control.velocity[index] < control.acceleration[index] ** 2 / control.jerk[index]:
                del found[f"{axis}.limits.acceleration_m_s2"]
                if axis in "xy":
                    found.pop("control.normal_fraction", None)
                    found.pop("control.tangential_fraction", None)
    for index, time in enumerate(control.filters):
        found[f"control.filter_{index + 1}_ms"] = 1e3 * time
    if control.corners == "velocity_step":
        found["control.corner_velocity_m_min"] = 60 * control.corner_velocity
    if control.corners in ("arc", "deviation"):
        found["control.corner_tolerance_mm"] = 1e3 * control.corner_tolerance
    return found


def difference(key: str, value: float, truth: float, control: Control) -> float:
    """Returns a relative error; that of a wait and of a number of blocks is at least their resolution."""
    resolution = {"control.wait_ms": 1.5e3 * control.period, "control.look_ahead": 1.0}.get(key, 0.0)
    return max(abs(value - truth) - resolution, 0.0) / truth


def judged(
    folder: Path, seed: int, probe: Path, *, recorded: bool = False
) -> tuple[dict[str, float], list[float], list[str], Control]:
    """Returns errors of parameters, of the times of unseen programs, and what is wrong otherwise.

    Recorded positions are those of axes with 10 % more inertia than the machine file, or less with an odd seed.
    """
    control = Control.drawn(seed)
    log, machine = folder / "log.csv", folder / "identified.yaml"
    write(log, control, probe.read_text())
    options = ["--machine", "vmc", *OFFSET, "--out", machine, "--json"]
    if recorded:
        record(folder, log, control, 0.9 if seed % 2 else 1.1)
        options += ["--recorded-positions", *(word for setting in DRIVES for word in ("--set", setting))]
    found = json.loads(command("identify-control", probe, log, *options))
    values = {value["parameter"]: value["value"] for value in found["values"]}
    choices = {choice["parameter"]: choice["value"] for choice in found["choices"]}
    truth = expected(control)
    wrong = [] if choices.get("control.corners") == control.corners else [f"corners {choices.get('control.corners')}"]
    smoothings = {key for key in values if "filter" in key or "jerk" in key}
    wrong += sorted(smoothings ^ {key for key in truth if "filter" in key or "jerk" in key})
    # The limit may not slow down rows of short lines and corners without P; a jerk limit may hide the ramps of circles.
    optional = {"control.block_cycle_ms", "control.look_ahead", "control.corner_tolerance_mm"}
    optional |= {"control.tangential_fraction"} if control.jerk is not None else set()
    wrong += sorted(set(truth) - set(values) - optional)
    errors = {key: difference(key, values[key], truth[key], control) for key in truth if key in values}
    times = [found["profile_time_s"] / found["log_time_s"] - 1]
    for index in range(2):
        program = folder / "unseen.nc"
        program.write_text(unseen(10 * seed + index))
        times.append(planned_time(folder, machine, program) / motion_time(control, program.read_text()) - 1)
    return errors, times, wrong, control


@pytest.fixture(scope="module")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the program that shows the profile."""
    return written_probe(tmp_path_factory.mktemp("probe"))


def written_probe(folder: Path) -> Path:
    """Writes the program that shows the profile."""
    path = folder / "probe.nc"
    command("psec", "--probe", "--machine", "vmc", *OFFSET, "--out", path)
    return path


@pytest.mark.parametrize("seed", SEEDS)
def test_parameters_and_times_are_those_of_the_control(tmp_path: Path, probe: Path, seed: int) -> None:
    errors, times, wrong, control = judged(tmp_path, seed, probe)
    text = f"{control}\n{errors}\n{times}\n{wrong}"
    assert not wrong, text
    assert max(errors.values()) < PARAMETERS, text
    assert max(map(abs, times)) < TIME, text


@pytest.mark.parametrize("seed", RECORDED_SEEDS)
def test_recorded_positions_show_the_control(tmp_path: Path, probe: Path, seed: int) -> None:
    errors, times, wrong, control = judged(tmp_path, seed, probe, recorded=True)
    text = f"{control}\n{errors}\n{times}\n{wrong}"
    assert not wrong, text
    assert max(errors.values()) < RECORDED_PARAMETERS, text
    assert max(map(abs, times)) < TIME, text


def identified(folder: Path, machine: str, *settings: str, recorded_axes: str = "") -> dict[str, float]:
    """Returns the values identified from the setpoints of the profile `linuxcnc` for the probe program.

    With `recorded_axes`, from the positions of these axes with 10 % more inertia than in the machine file.
    """
    probe, log = folder / "probe.nc", folder / "log.csv"
    options = ["--machine", machine, *OFFSET]
    sets = ["periods.position_ms=1", "control.profile=linuxcnc", *settings]
    command("psec", "--probe", *options, "--out", probe)
    command("psec", probe, *options, *(word for text in sets for word in ("--set", text)), "--out", log)
    if recorded_axes:
        setpoints, log = log, folder / "trace.csv"
        changes = ["periods.position_ms=1", *(f"{axis}.deviation.inertia=1.1" for axis in recorded_axes)]
        given = [word for text in changes for word in ("--set", text)]
        command("run", setpoints, "--machine", machine, *given, "--trace", log, "--quiet")
        units = {axis: "rad" if axis in "abc" else "m" for axis in recorded_axes}
        columns = (f"{axis}={axis}.position[{unit}]" for axis, unit in units.items())
        options += ["--recorded-positions", *(word for text in columns for word in ("--column", text))]
    found = json.loads(command("identify-control", probe, log, *options, "--json"))
    return {value["parameter"]: value["value"] for value in found["values"]}


@pytest.mark.parametrize(("recorded_axes", "tolerance"), [("", 1e-3), ("xyzac", 1e-2)])
def test_limits_of_all_axes_are_identified(tmp_path: Path, recorded_axes: str, tolerance: float) -> None:
    truth = {
        "a.limits.velocity_rpm": 9.0,
        "a.limits.acceleration_rev_s2": 0.6,
        "c.limits.velocity_rpm": 16.0,
        "c.limits.acceleration_rev_s2": 0.7,
        "x.limits.acceleration_m_s2": 2.5,
        "y.limits.acceleration_m_s2": 3.0,
        "z.limits.acceleration_m_s2": 2.1,
    }
    settings = [f"{key}={value}" for key, value in truth.items()]
    found = identified(tmp_path, "mikron_ucp710", *settings, recorded_axes=recorded_axes)
    for key, value in truth.items():
        assert abs(found[key] / value - 1) < tolerance, found


def test_intervals_contain_what_other_drives_change(tmp_path: Path) -> None:
    probe, log, trace = (tmp_path / name for name in ("probe.nc", "log.csv", "trace.csv"))
    command("psec", "--probe", "--machine", "vmc", "--out", probe)
    sets = ["--set", "periods.position_ms=1"]
    command("psec", probe, "--machine", "vmc", *sets, "--set", "control.profile=linuxcnc", "--out", log)
    for axis, factor in (("x", 0.8), ("y", 0.8), ("z", 1.2)):
        sets += ["--set", f"{axis}.deviation.torque_constant={factor}"]
    command("run", log, "--machine", "vmc", *sets, "--trace", trace, "--quiet")
    columns = [word for axis in "xyz" for word in ("--column", f"{axis}={axis}.position[m]")]
    words = ["identify-control", probe, trace, "--machine", "vmc", "--recorded-positions", *columns, "--json"]
    found = {value["parameter"]: value for value in json.loads(command(*words))["values"]}
    truth = {"x.limits.acceleration_m_s2": 4, "control.normal_fraction": 0.866, "control.kink_fraction": 0.1}
    truth |= {"control.overlap_fraction": 0.5, "control.wait_ms": 25}
    for key, value in truth.items():
        assert abs(found[key]["value"] - value) < found[key]["half_width"], found[key]


def test_gaps_of_short_lines_change_no_other_parameter(tmp_path: Path) -> None:
    base, found = (identified(tmp_path, "vmc", f"control.gap_cycles={cycles}") for cycles in (0, 40))
    assert base.keys() == found.keys()
    for key, value in base.items():
        assert abs(found[key] / value - 1) < 1e-3, key


def test_control_outside_the_profile_is_reported(tmp_path: Path, probe: Path) -> None:
    control = Control.drawn(2013)
    assert control.jerk is not None
    for filters, is_outside in (([], False), ([0.03], True)):
        log = tmp_path / "log.csv"
        write(log, replace(control, filters=filters), probe.read_text())
        found = json.loads(command("identify-control", probe, log, "--machine", "vmc", *OFFSET, "--json"))
        assert any("outside the profile" in text for text in found["warnings"]) == is_outside, found


def test_log_without_parameters_is_unusable(tmp_path: Path) -> None:
    program, log, out = (tmp_path / name for name in ("line.nc", "log.csv", "mine.yaml"))
    program.write_text("G21 G90 G94 G17 G61\nG0 X-90 Y-90\nG1 X-60 Y-70 F600\nM2\n")
    command("psec", program, "--machine", "vmc", *OFFSET, "--out", log)
    words = ["identify-control", program, log, "--machine", "vmc", *OFFSET, "--out", out]
    run = subprocess.run([COMMAND, *words], capture_output=True, text=True, timeout=120, check=False)
    assert (run.returncode, out.exists()) == (1, False), run
    assert "nothing in the log fits; the first cause: acceleration of X: no straight motion" in run.stderr, run.stderr


def main(first: int, end: int, *, recorded: bool) -> None:
    """Prints the distribution of the errors over seeds."""
    import tempfile

    limit = RECORDED_PARAMETERS if recorded else PARAMETERS
    of_key: dict[str, list[float]] = {}
    all_times: list[float] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = written_probe(folder)
        for seed in range(first, end):
            try:
                errors, times, wrong, control = judged(folder, seed, program, recorded=recorded)
            except AssertionError as error:
                print(seed, error)
                continue
            bad = {key: round(error, 4) for key, error in errors.items() if error >= limit}
            late = [round(time, 4) for time in times if abs(time) >= TIME]
            if bad or late or wrong:
                smoothing = "jerk" if control.jerk is not None else f"{len(control.filters)} filters"
                print(seed, smoothing, control.corners, bad, late, wrong)
            for key, error in errors.items():
                of_key.setdefault(key.split(".", 1)[1] if key[1] == "." else key, []).append(error)
            all_times += times[1:]
    for key, values in [*of_key.items(), ("time", [abs(time) for time in all_times])]:
        within = sum(value < (TIME if key == "time" else limit) for value in values)
        middle, most = 100 * statistics.median(values), 100 * max(values)
        print(f"{key}: median {middle:.3f} %, largest {most:.2f} %, {within} of {len(values)} within")


if __name__ == "__main__":
    import sys

    main(int(sys.argv[1]), int(sys.argv[2]), recorded="--recorded" in sys.argv)
