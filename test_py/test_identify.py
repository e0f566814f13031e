"""Identification from MCAP recordings of the real node: all parameters compared with model.md.

The campaigns of all five axes run simultaneously on one node, once without feedforward, once with velocity feedforward,
once with both. The published signals are disturbed like those of an oscilloscope (encoder quantization, current noise),
written to MCAP, and the command starts from a machine with wrong values.
"""

from __future__ import annotations

import json
import math
import random
import subprocess
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rclpy.serialization import serialize_message
from virtual_axes.msg import DriveStates, MotorCurrents

from motion import go_home
from node_process import Node, node_binary
from virtual_axes_py.ros import AxesClient, Recording, joint_trajectory, to_time

AXES = ("x", "y", "z", "a", "c")
LINEAR = ("x", "y", "z")
PARTS = ("off", "velocity", "both")
STEP = {axis: 1e-6 if axis in LINEAR else math.radians(1e-3) for axis in AXES}
"""Encoder resolution: 1 µm, 1 mdeg."""
NOISE = 0.02
"""Standard deviation of the current noise, relative to the maximum current."""

INERTIA = {"x": 0.028, "y": 0.024, "z": 0.0225, "a": 0.001, "c": 0.001}
FRICTION = {
    "x": (1.576, 0.01965, -0.5332, -0.2801),
    "y": (1.253, 0.01895, -0.3629, -0.4026),
    "z": (1.420, 0.01650, -0.6301, -0.2625),
    "a": (0.6, 0.019, -0.2, -0.3),
    "c": (0.6, 0.019, -0.2, -0.3),
}
BREAKAWAY = {"x": 1.043, "y": 0.890, "z": 0.790, "a": 0.4, "c": 0.4}
TORQUE_FEEDFORWARD = {"x": 0.002034, "y": 0.002030, "z": 0.002030, "a": 0.0, "c": 0.0}
DELAY_MS = 9.0
"""Pure delays α = β = γ, ms."""
TSV_MS = 0.25

WRONG = {
    "friction.a": 1.0,
    "friction.b": 0.01,
    "friction.c": -0.1,
    "friction.d": -1.0,
    "friction.i0": 0.9,
    "feedforward.velocity": 0.9,
    "feedforward.torque_kg_m2": 0.001,
    "delays.alpha_ms": 20.0,
    "delays.beta_ms": 3.0,
    "delays.gamma_ms": 1.0,
}
"""Deviations of the initial machine file."""
WRONG_OF = {
    "x": {"motor.inertia_kg_m2": 0.015},
    "y": {"motor.inertia_kg_m2": 0.015},
    "z": {"motor.inertia_kg_m2": 0.015, "gravity.weight_n": 100.0},
    "a": {"motor.inertia_kg_m2": 0.002, "gravity.tilt_nm": 5.0, "gravity.tilt_phase_deg": 30.0},
    "c": {"motor.inertia_kg_m2": 0.002},
}


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs the command beside the node."""
    program = node_binary().with_name("virtual_axes")
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False)


def campaign(part: str, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Returns times and setpoints of a part for all axes; axes that finish early wait for the others."""
    columns = []
    for axis in AXES:
        file = folder / f"psec-{axis}-{part}.csv"
        done = command("psec", "campaign", "--axis", axis, "--part", part, "--out", file)
        assert done.returncode == 0, done.stderr
        columns.append(np.genfromtxt(file, delimiter=",", names=True))
    longest = max(columns, key=len)["time"]
    rows = [np.pad(column[axis], (0, len(longest) - len(column)), "edge") for axis, column in zip(AXES, columns)]
    return longest, np.column_stack(rows)


def feedforward(part: str) -> dict[str, object]:
    """Returns the feedforward parameters of a part for all axes."""
    weights: dict[str, object] = {}
    for axis in AXES:
        weights[f"{axis}.feedforward.velocity"] = 0.0 if part == "off" else 1.0
        weights[f"{axis}.feedforward.torque_kg_m2"] = TORQUE_FEEDFORWARD[axis] if part == "both" else 0.0
    return weights


def write_mcap(file: Path, recording: Recording, seed: int) -> None:
    """Writes published messages with encoder quantization and current noise."""
    noise = random.Random(seed)
    states, currents = recording.states, recording.currents
    assert states.stamp.tolist() == currents.stamp.tolist(), "both topics are complete"
    position = np.column_stack([np.round(states["position", axis] / STEP[axis]) * STEP[axis] for axis in AXES])
    measured = np.column_stack([currents["current", axis] for axis in AXES])
    measured = measured + NOISE * np.abs(measured).max(axis=0) * np.array(
        [[noise.gauss(0, 1) for _ in AXES] for _ in measured]
    )
    order = [states.name.index(axis) for axis in AXES]
    with file.open("wb") as out:
        writer = Writer(out, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="test")
        channels = {}
        for topic, kind in (
            ("/virtual_axes/drive_states", DriveStates),
            ("/virtual_axes/motor_currents", MotorCurrents),
        ):
            name = f"virtual_axes/msg/{kind.__name__}"
            text = (Path(__file__).parents[1] / "msg" / f"{kind.__name__}.msg").read_bytes()
            schema = writer.register_schema(name=name, encoding="ros2msg", data=text)
            channels[kind] = writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
        for row, stamp in enumerate(states.stamp.tolist()):
            drive = DriveStates(
                name=list(AXES),
                psec=states["psec"][row, order],
                position=position[row],
                velocity_feedforward=states["velocity_feedforward"][row, order],
                torque_feedforward=states["torque_feedforward"][row, order],
            )
            current = MotorCurrents(name=list(AXES), current=measured[row])
            for message in (drive, current):
                message.header.stamp = to_time(stamp)
                data = serialize_message(message)
                writer.add_message(channels[type(message)], log_time=stamp, data=data, publish_time=stamp)
        writer.finish()


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Returns the three parts of the campaign, all axes in each."""
    folder = tmp_path_factory.mktemp("campaign")
    files = []
    with Node(["-p", "time:=fast"]) as process, AxesClient(process=process) as drive:
        for seed, part in enumerate(PARTS):
            time, psec = campaign(part, folder)
            go_home(drive)
            drive.set_parameters_atomically(feedforward(part))
            recording = drive.run(joint_trajectory(AXES, time, psec), timeout=240, settle=0.5)
            files.append(folder / f"{part}.mcap")
            write_mcap(files[-1], recording, seed)
    return files


def identify(recordings: list[Path], axis: str, *more: object) -> dict[str, dict]:
    """Returns the identified values of an axis by key, without the axis name."""
    wrong = [("--set", f"{axis}.{key}={value}") for key, value in (WRONG | WRONG_OF[axis]).items()]
    arguments = [*recordings, "--axis", axis, "--feedforward", ",".join(PARTS), *sum(wrong, ())]
    done = command("identify", *arguments, "--json", *more)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [f for f in found["findings"] if f["severity"] == "missing"] == []
    return {value["key"].removeprefix(f"{axis}."): value for value in found["values"]}


@pytest.mark.parametrize("axis", AXES)
def test_parameters_of_an_axis_are_identified_from_its_recording(axis: str, recordings: list[Path], tmp_path: Path):
    """Inertia to 1 %, friction to 2 %, i0 to 3 %, gravity to 2 %, feedforward to 0.5 %, β to Tsv."""
    machine = tmp_path / "found.yaml"
    values = identify(recordings, axis, "--out", machine)
    value = {key: entry["value"] for key, entry in values.items()}

    assert value["motor.inertia_kg_m2"] == pytest.approx(INERTIA[axis], rel=0.01)
    speeds = np.arange(0.5, 20.01, 0.5)
    a, b, c, d = FRICTION[axis]
    truth = a * np.exp(b * speeds) + c * np.exp(d * speeds)
    a, b, c, d = (value[f"friction.{name}"] for name in "abcd")
    np.testing.assert_allclose(a * np.exp(b * speeds) + c * np.exp(d * speeds), truth, rtol=0.02)
    assert value["friction.i0"] == pytest.approx(BREAKAWAY[axis], rel=0.03)

    assert value["feedforward.velocity"] == pytest.approx(1.0, rel=0.005)
    assert value["feedforward.torque_kg_m2"] == pytest.approx(TORQUE_FEEDFORWARD[axis], rel=0.005)
    for delay in ("alpha", "gamma"):
        if delay == "gamma" and TORQUE_FEEDFORWARD[axis] == 0:
            assert "delays.gamma_ms" not in values, "it is not identifiable"
            continue
        low, high = values[f"delays.{delay}_ms"]["interval"]
        assert low < DELAY_MS <= high
    assert value["delays.beta_ms"] == pytest.approx(DELAY_MS, abs=TSV_MS)

    if axis == "z":
        assert value["gravity.weight_n"] == pytest.approx(400.0, rel=0.02)
    if axis == "a":
        assert value["gravity.tilt_nm"] == pytest.approx(30.0, rel=0.02)
        assert math.radians(value["gravity.tilt_phase_deg"]) == pytest.approx(0.0, abs=0.02)

    # The written machine file contains the identified values and is valid.
    done = command("check", machine)
    assert done.returncode == 0, done.stderr
    assert f"{value['motor.inertia_kg_m2']}" in machine.read_text()
