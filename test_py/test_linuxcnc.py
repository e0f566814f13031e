"""LinuxCNC with the HAL component `virtual_axes`: feedback with the bits of `run`, following-error trips."""

from __future__ import annotations

import cmath
import csv
import json
import math
import os
import re
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pytest

from reference_kinematics import turn

CHECKOUT = Path(__file__).parents[1]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", CHECKOUT / "target")) / "release"
COMMAND, LIBRARY = TARGET / "virtual_axes", TARGET / "libvirtual_axes_c.a"
MODULES = Path("/usr/lib/linuxcnc/modules")
SESSION_S = 180
ATTEMPTS = 3


def reason_to_skip() -> str | None:
    """Returns what is missing for LinuxCNC with a component of our own, or `None`."""
    if not shutil.which("linuxcnc") or not Path("/usr/share/linuxcnc/Makefile.modinc").exists():
        return "LinuxCNC is not installed (tools/setup.sh --linuxcnc)"
    if not os.access(MODULES, os.W_OK):
        return f"{MODULES} is not writable"
    return None if LIBRARY.exists() else f"{LIBRARY} is missing (cargo build --release -p virtual_axes_c)"


SKIP = reason_to_skip()
pytestmark = [pytest.mark.extended, pytest.mark.skipif(SKIP is not None, reason=str(SKIP))]

MILL = [
    "G0 X-30 Y-20",
    "G64 P0.01\nG1 F6000 X-40\nY-40\nX-60 Z-5",
    "G61\nG1 F5000 X-40\nY-40\nX-60",
    "G17\nG1 F3000 X-40 Y-40\nG2 I-10 J0\nG3 X-40 Y-60 J-10",
    "G64 P0.1\nG1 F8000\n" + "\n".join(f"X-{40 + k % 2 * 15} Y-{20 + k}" for k in range(8)),
    "G0 Z-30\nG81 X-40 Y-30 Z-40 R-31 F600\nX-50\nG80\nG0 Z-1",
    "G64\nG1 F4000\n"
    + "\n".join(f"X-{50 + 8 * math.cos(k / 4):.4f} Y-{50 + 8 * math.sin(k / 4):.4f}" for k in range(26)),
    "G1 F4000 X-50 Y-50\nG2 X-60 Y-60 Z-12 J-10\nG1 Z-2",
    "G0 X-200 Y-100 Z-50\nG0 X-10 Y-10 Z-1",
    "G93\nG1 X-30 F60\nX-35 Y-30 F90\nG94",
]
FIVE_AXES = [
    "G0 X10 Y10 A5 C10",
    "G64 P0.01\nG1 F5000 X20 A10 C20\nY20 Z-5 A0 C-30\nX0",
    "G61\nG1 F3000 X5 A10\nX0 A0 C10\nC0",
    "G93\n" + "\n".join(f"G1 X{k} Y{2 * k} A{k} C{3 * k} F120" for k in range(1, 9)) + "\nG94",
    "G17\nG1 F4000 X20 Y0\nG2 X20 Y40 J20\nG1 X0 C45 A15\nX0 Y0",
]
CASES = {"mill": ("vmc", "xyz", MILL), "mikron": ("mikron_ucp710", "xyzac", FIVE_AXES)}


class Session:
    """Session of LinuxCNC without a screen, in a folder of its own."""

    def __init__(
        self, folder: Path, name: str, changes: dict[str, str], programs: list[str], has_drives: bool = True
    ) -> None:
        self.folder, self.log = folder, folder / "log.csv"
        for file in (CHECKOUT / "linuxcnc").glob("*"):
            if file.suffix in {".ini", ".hal", ".tbl"}:
                shutil.copy(file, folder)
        self.has_drives = has_drives
        if not has_drives:
            hal = folder / f"{name}.hal"
            hal.write_text(without_drives(hal.read_text()))
        text = (folder / f"{name}.ini").read_text()
        changes = {"DISPLAY": str(CHECKOUT / "linuxcnc/headless.py"), **changes}
        for key, value in changes.items():
            text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
            assert count, key
        (folder / f"{name}.ini").write_text(text)
        paths = []
        for index, program in enumerate(programs):
            paths.append(folder / f"{index}.ngc")
            paths[-1].write_text(f"G21 G90 G94 G17 G64\n{program}\nM2\n")
        with tempfile.TemporaryDirectory() as fifo_folder:
            # Writable for the user to which the process of the realtime components changes.
            os.chmod(fifo_folder, 0o777)
            self.output, self.result = self.run(name, paths, Path(fifo_folder))

    def run(self, name: str, paths: list[Path], fifo_folder: Path) -> tuple[str, dict[str, list[str]]]:
        """Executes the programs; returns the output of LinuxCNC and the result of the user interface."""
        result = self.folder / "result.json"
        env = os.environ | {
            "HOME": str(self.folder),
            "RTAPI_UID": str(os.getuid() or 1000),
            "RTAPI_FIFO_PATH": str(fifo_folder / "fifo"),
            "VIRTUAL_AXES_PROGRAMS": ":".join(map(str, paths)),
            "VIRTUAL_AXES_LOG": str(self.log),
            "VIRTUAL_AXES_RESULT": str(result),
        }
        # The user interface needs the modules of the distribution's Python.
        for key in ("PYTHONPATH", "LD_LIBRARY_PATH", "VIRTUAL_ENV"):
            env.pop(key, None)
        with (self.folder / "output.txt").open("w") as output:
            process = subprocess.Popen(
                ["linuxcnc", f"{name}.ini"],
                cwd=self.folder,
                env=env,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            try:
                process.wait(SESSION_S)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGTERM)
                try:
                    process.wait(20)
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()
        files = ["output.txt", "linuxcnc_print.txt", "linuxcnc_debug.txt"]
        texts = [(self.folder / file).read_text() for file in files if (self.folder / file).exists()]
        return "\n".join(texts), json.loads(result.read_text()) if result.exists() else {
            "completed": [],
            "messages": [],
        }

    def rows(self) -> list[list[float]]:
        """Returns command and feedback of each joint in each servo period."""
        with self.log.open() as file:
            rows = [[float(cell) for cell in row] for row in list(csv.reader(file))[1:]]
        if self.has_drives:
            assert [row[0] for row in rows] == list(range(len(rows))), "a row for each step"
        return [row[1:] for row in rows]


@pytest.fixture(scope="module", autouse=True)
def component(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Builds and installs the component as its Makefile does, and removes it at the end."""
    folder = tmp_path_factory.mktemp("component")
    for file in ("Makefile", "virtual_axes.c"):
        shutil.copy(CHECKOUT / "linuxcnc" / file, folder)
    variables = [f"INTERFACE={CHECKOUT}/crates/c/include", f"LIBRARY={LIBRARY}"]
    subprocess.run(["make", "install", *variables], cwd=folder, check=True, capture_output=True, timeout=120)
    yield
    (MODULES / "virtual_axes.so").unlink()


def completed(
    tmp_path: Path, name: str, changes: dict[str, str], programs: list[str], has_drives: bool = True
) -> Session:
    """Returns a session that has completed all programs; LinuxCNC's task sometimes ends by itself under load."""
    for attempt in range(ATTEMPTS):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        session = Session(folder, name, changes, programs, has_drives)
        if len(session.result["completed"]) == len(programs):
            return session
    raise AssertionError(f"{session.result}\n{session.output}")


def simulated(
    session: Session,
    name: str,
    period_ms: int,
    deviation: dict[str, float] | None = None,
    rotary_sign: int = 1,
) -> list[dict]:
    """Returns the trace of `virtual_axes run` on the logged commands, on plants with factors of their parameters."""
    machine, axes, _ = CASES[name]
    setpoints, trace = session.folder / "setpoints.csv", session.folder / "trace.csv"
    lines = ["time," + ",".join(axes)]
    for k, row in enumerate(session.rows()):
        signs = [rotary_sign if axis in "abc" else 1 for axis in axes]
        values = [sign * command * unit(axis) for axis, command, sign in zip(axes, row[::2], signs, strict=True)]
        lines.append(",".join(map(repr, [k * period_ms / 1000, *values])))
    setpoints.write_text("\n".join(lines) + "\n")
    options = ["--machine", machine, "--set", f"periods.position_ms={period_ms}", "--trace", str(trace), "-q"]
    for key, factor in (deviation or {}).items():
        options += [part for axis in axes for part in ("--set", f"{axis}.deviation.{key}={factor}")]
    subprocess.run([COMMAND, "run", setpoints, *options], check=True, capture_output=True, timeout=120)
    with trace.open() as file:
        return list(csv.DictReader(file))


def unit(axis: str) -> float:
    """Returns m per mm, or rad per degree."""
    return math.pi / 180 if axis in "abc" else 0.001


def scale(axis: str) -> float:
    """Returns mm per m, or degrees per rad."""
    return 180 / math.pi if axis in "abc" else 1000.0


@pytest.mark.parametrize("period_ms", [1, 2, 6])
@pytest.mark.parametrize("name", CASES)
def test_feedback_has_the_bits_of_run_on_the_logged_commands(tmp_path: Path, name: str, period_ms: int) -> None:
    _, axes, programs = CASES[name]
    changes = {
        "SERVO_PERIOD": str(period_ms * 1_000_000),
        "SET": f"periods.position_ms={period_ms}",
        # The limit of the following error is not under test here.
        "FERROR": "50",
        "MIN_FERROR": "50",
    }
    session = completed(tmp_path, name, changes, programs)
    rows, trace = session.rows(), simulated(session, name, period_ms)
    assert len(rows) > 500
    for index, axis in enumerate(axes):
        moved = [row[2 * index] for row in rows]
        assert max(moved) - min(moved) > 1
        wanted = [float(row[f"{axis}.position"]) * scale(axis) for row in trace[: len(rows)]]
        assert [row[2 * index + 1] for row in rows] == wanted, axis


def test_following_error_trips_at_the_computed_limit(tmp_path: Path) -> None:
    wide = {"FERROR": "50", "MIN_FERROR": "50"}
    (tmp_path / "wide").mkdir()
    session = completed(tmp_path / "wide", "mill", wide, ["G0 X-30"])
    commands = [row[0] for row in session.rows()]
    positions = [float(row["x.position"]) * 1000 for row in simulated(session, "mill", 1)]
    # The control compares the feedback that it has read with its command of the period before.
    largest = max(abs(c - p) for c, p in zip(commands, positions[1:], strict=False))
    assert 0.5 < largest < 5
    passing = f"{1.001 * largest:.9f}"
    (tmp_path / "passing").mkdir()
    completed(tmp_path / "passing", "mill", {"FERROR": passing, "MIN_FERROR": passing}, ["G0 X-30"])
    tripping = f"{0.999 * largest:.9f}"
    (tmp_path / "tripping").mkdir()
    for attempt in range(ATTEMPTS):
        folder = tmp_path / "tripping" / str(attempt)
        folder.mkdir()
        tripped = Session(folder, "mill", {"FERROR": tripping, "MIN_FERROR": tripping}, ["G0 X-30"])
        if tripped.result["messages"]:
            break
    assert tripped.result["completed"] == []
    assert any("following error" in text for text in tripped.result["messages"]), tripped.result


def test_pid_of_linuxcnc_closes_the_position_loop(tmp_path: Path) -> None:
    changes = {"HALFILE": "mill-velocity.hal", "FERROR": "20", "MIN_FERROR": "20"}
    rows = completed(tmp_path, "mill", changes, ["G1 F3000 X-40 Y-20 Z-5", "G4 P0.5"]).rows()
    for command, position in zip(rows[-1][::2], rows[-1][1::2], strict=True):
        assert abs(command) > 1
        assert abs(command - position) < 2e-3
    errors = [abs(row[0] - row[1]) for row in rows]
    assert 1e-3 < max(errors) < 1


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("OFF", "hold", "off=hold is unknown; allowed: stop, brake, coast"),
        ("MACHINE", "vcm", "vmc"),
        ("SET", "x.position_loop.gian=2", "x.position_loop.gain"),
    ],
)
def test_invalid_module_parameters_name_what_is_allowed(tmp_path: Path, key: str, value: str, reason: str) -> None:
    session = Session(tmp_path, "mill", {key: value}, [])
    assert session.result["completed"] == []
    assert reason in session.output


# The limits of mikron.ini: 500 mm/s along the path.
CONTROL = ["periods.position_ms=1", "control.profile=linuxcnc", "control.path_velocity_m_min=30"]
# xyzac-trt-kins has the tool tip at the joints X, Y, Z when A and C are at 0.
CONTROL += ["kinematics.tool_length_mm=0"]
PERTURBED = [
    {},
    {"inertia": 1.27, "friction": 0.78, "torque_constant": 0.76},
    {"inertia": 0.76, "friction": 1.24, "torque_constant": 1.27},
    {"inertia": 1.22, "friction": 1.28, "torque_constant": 0.8},
]
"""Factors of the parameters of all axes; none of them is among the plants of the compilation but the nominal one."""
WAIT_ROWS = 400
"""Servo periods of a standstill that is the dwell before the cuts."""


def cuts(x: float, y: float, *lines: str) -> str:
    """Returns a program that waits above the first cut, plunges, cuts and retracts."""
    return "\n".join(["G64 P0.01", f"G0 X{x} Y{y}", "G0 Z0", "G4 P0.5", "G1 Z-1 F600", *lines, "G1 Z0 F600"])


def pocket_lines() -> list[str]:
    """Returns squares from the inside to the outside."""
    rounds = [
        [f"X{r - 40} Y{-40 - r}", f"Y{r - 40}", f"X{-40 - r}", f"Y{-40 - r}", f"X{r - 40}"] for r in range(4, 20, 4)
    ]
    return ["G1 F3000 X-40 Y-40", *sum(rounds, [])]


def raster_lines() -> list[str]:
    """Returns rows back and forth over a waved surface."""
    points = []
    for row in range(6):
        places = range(61) if row % 2 == 0 else range(60, -1, -1)
        points += [(-60 + 0.5 * place, -50 + 0.8 * row) for place in places]
    return ["F2500", *(f"G1 X{x} Y{y} Z{1.2 * math.sin(x / 4) * math.cos(y / 3) - 1:.4f}" for x, y in points)]


def five_axis_lines() -> list[str]:
    """Returns short lines of the tool tip while both rotary axes turn."""
    return ["F2500"] + [
        f"G1 X{2 * k - 25} Y{20 * math.sin(k / 6):.4f} Z{1.5 * math.cos(k / 4.5) - 2.5:.4f} "
        f"A{20 * math.sin(k / 7.5):.4f} C{3 * k}"
        for k in range(1, 25)
    ]


PARTS = {
    "corners": cuts(-30, -30, "G1 F3000 X-60", *2 * ["Y-60", "X-30", "Y-30", "X-60"], "Y-60", "X-30", "Y-30"),
    "circles": cuts(
        *(-30, -55, "G1 F4000 Y-50", "G3 X-40 Y-40 I-10 J0", "G3 I0 J-15", "G3 I0 J-15"),
        *("G3 X-50 Y-50 I0 J-10", "G1 Y-55"),
    ),
    "pocket": cuts(-40, -40, *pocket_lines()),
    "raster": cuts(-60, -50, *raster_lines()),
    "five axes": "G43.4\n" + cuts(-25, 0, *five_axis_lines()),
}


def for_linuxcnc(program: str) -> str:
    """Returns a program for xyzac-trt-kins, which always controls the tool tip and has the other sense of A and C."""
    lines = [line for line in program.splitlines() if line not in {"G43.4", "G49"}]
    return re.sub(r"([AC])(-?)(\d)", lambda m: f"{m[1]}{'' if m[2] else '-'}{m[3]}", "\n".join(lines))


def path_of_cuts(program: str) -> np.ndarray:
    """Returns the points of the motions at feed of a program, arcs by chords, mm."""
    at, code, points = {"X": 0.0, "Y": 0.0, "Z": 0.0}, 0, []
    for line in program.splitlines():
        words = [(letter, float(number)) for letter, number in re.findall(r"([A-Z])(-?[\d.]+)", line)]
        codes = [int(float(number)) for letter, number in words if letter == "G"]
        values = {letter: number for letter, number in words if letter in "XYZIJ"}
        code = next((code for code in codes if code < 4), code)
        end = at | {letter: number for letter, number in values.items() if letter in at}
        if code == 0:
            points = []
        elif values and not points:
            points.append(tuple(at.values()))
        if values.keys() & {"I", "J"}:
            center = complex(at["X"] + values.get("I", 0), at["Y"] + values.get("J", 0))
            spoke = complex(at["X"], at["Y"]) - center
            sweep = cmath.phase((complex(end["X"], end["Y"]) - center) / spoke) % math.tau or math.tau
            spokes = [center + spoke * cmath.exp(1j * sweep * step / 500) for step in range(1, 501)]
            points += [(place.real, place.imag, at["Z"]) for place in spokes]
        elif values and code:
            points.append(tuple(end.values()))
        at = end
    return np.array(points)


def largest_distance(points: np.ndarray, polyline: np.ndarray) -> float:
    """Returns the largest distance of points from a polyline."""
    starts, steps = polyline[:-1], np.diff(polyline, axis=0)
    squares = np.maximum((steps**2).sum(1), 1e-30)

    def distance(point: np.ndarray) -> float:
        along = np.clip(((point - starts) * steps).sum(1) / squares, 0, 1)
        return float(np.sqrt(((starts + along[:, None] * steps - point) ** 2).sum(1).min()))

    return max(map(distance, points))


def tool_tip(x: float, y: float, z: float, a: float, c: float) -> np.ndarray:
    """Returns the tool tip in the frame of the workpiece, m."""
    return turn(2, c) @ turn(0, a) @ np.array([x, y, z])


def largest_error(session: Session, deviation: dict[str, float], path: np.ndarray) -> float:
    """Returns the largest distance of the cuts from the programmed path, and of that path from the cuts, µm."""
    commands = np.array([row[::2] for row in session.rows()])
    starts = np.flatnonzero(np.any(np.diff(commands, axis=0), axis=1))
    begin = starts[1 + np.flatnonzero(np.diff(starts) > WAIT_ROWS)[-1]]
    rows = simulated(session, "mikron", 1, deviation, rotary_sign=-1)[begin:]
    cut = np.array([tool_tip(*(float(row[f"{axis}.position"]) for axis in "xyzac")) for row in rows]) * 1000
    return 1000 * max(largest_distance(cut, path), largest_distance(path, cut))


def motion_rows(session: Session) -> int:
    """Returns the number of servo periods from the first to the last motion."""
    rows = session.rows()
    moving = [k for k in range(1, len(rows)) if rows[k][::2] != rows[k - 1][::2]]
    return moving[-1] - moving[0]


def without_drives(text: str) -> str:
    """Returns a HAL file of this package with the commanded positions as feedback."""
    omitted = ("loadrt virtual_axes", "addf virtual-axes", "net drive-fault", "net fb-", "net enable-")
    text = "\n".join(line for line in text.splitlines() if not line.startswith(omitted))
    for joint in range(5):
        feedback = f"joint.{joint}.motor-pos-fb sampler.0.pin.{2 * joint + 1}"
        text = text.replace(f"virtual-axes.{joint}.cmd", feedback)
    # Rows are logged from the first on.
    return text.replace("net steps virtual-axes.steps =>", "net steps") + "\nsets steps 2\n"


@pytest.mark.parametrize("name", PARTS)
def test_a_compiled_program_halves_the_error_of_deviating_axes(tmp_path: Path, name: str) -> None:
    program = PARTS[name]
    part, better = tmp_path / "part.ngc", tmp_path / "better.ngc"
    part.write_text(f"G21 G90 G94 G17 G64\n{program}\nM2\n")
    options = ["--machine", "mikron_ucp710", "--work-offset", "G54=0,0,0", "--same-time", "--more-time", "2.4"]
    sets = [part for value in CONTROL for part in ("--set", value)]
    command = [COMMAND, "compile", part, *options, *sets, "--out", better, "-q"]
    subprocess.run(command, check=True, capture_output=True, timeout=400)
    compiled = "\n".join(better.read_text().splitlines()[1:-1])
    sessions = []
    for index, text in enumerate([program, compiled]):
        folder = tmp_path / f"session{index}"
        folder.mkdir()
        sessions.append(completed(folder, "mikron", {}, [for_linuxcnc(text)], has_drives=False))
    path = path_of_cuts(program)
    errors = [[largest_error(session, deviation, path) for deviation in PERTURBED] for session in sessions]
    times = [motion_rows(session) / 1000 for session in sessions]
    cells = [f"{before:.1f} → {after:.1f}" for before, after in zip(*errors, strict=True)]
    print("|", " | ".join([name, *cells, "{:.2f} → {:.2f}".format(*times)]), "|")
    assert max(errors[1]) <= 0.5 * max(errors[0])
    assert times[1] <= 1.03 * times[0]


def test_the_profile_of_linuxcnc_is_identified_from_its_setpoints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VIRTUAL_AXES_PROGRAM_TIMEOUT_S", "170")
    probe, log = tmp_path / "probe.nc", tmp_path / "log.csv"
    options = ["--machine", "vmc", "--work-offset", "G54=0,0,0"]
    subprocess.run([COMMAND, "psec", "--probe", *options, "--out", probe], check=True, timeout=60)
    changes = {"FERROR": "9999", "MIN_FERROR": "9999"}
    program = probe.read_text().replace("M2\n", "")
    rows = completed(tmp_path, "mill", changes, [program], has_drives=False).rows()
    lines = (f"{1e-3 * k}," + ",".join(repr(1e-3 * value) for value in row[::2]) for k, row in enumerate(rows))
    log.write_text("time,x,y,z\n" + "\n".join(lines) + "\n")
    command = [COMMAND, "identify-control", probe, log, *options, "--json"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout)
    values = {value["parameter"]: value["value"] for value in found["values"]}
    choices = {choice["parameter"]: choice["value"] for choice in found["choices"]}
    assert choices["control.corners"] == "arc" and choices["control.jerk_limited"] == "false", found
    # The limits of mill.ini, and what was read off the logs of other programs.
    known = {f"{axis}.limits.acceleration_m_s2": 4.0 for axis in "xyz"}
    known |= {"x.limits.velocity_m_min": 24.0, "y.limits.velocity_m_min": 24.0}
    known |= {"control.normal_fraction": 0.866, "control.tangential_fraction": 0.5, "control.overlap_fraction": 0.5}
    known["control.kink_fraction"] = 0.1
    wrong = {key: values.get(key) for key, value in known.items() if not abs(values.get(key, 0) / value - 1) < 0.02}
    assert not wrong, found
    # The interpreter supplies short lines at a varying rate.
    assert abs(found["profile_time_s"] / found["log_time_s"] - 1) < 0.05, found
