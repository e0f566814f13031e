"""Cycle times of the profile `linuxcnc` beside those that LinuxCNC took."""

from __future__ import annotations

import csv
import json
import os
import statistics
import subprocess
from pathlib import Path

from linuxcnc_programs import PROGRAMS, TIMES

CHECKOUT = Path(__file__).parents[1]
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", CHECKOUT / "target")) / "release" / "virtual_axes"
MEASURED = json.loads(TIMES.read_text())
MACHINES = {"mill": ("vmc", 24), "mikron": ("mikron_ucp710", 30)}
"""Machine file, and MAX_LINEAR_VELOCITY of the configuration in m/min."""


def planned_time(folder: Path, machine: str, text: str) -> float:
    """Returns the time from the first to the last motion of a program in the profile `linuxcnc`, s."""
    program, setpoints = folder / "part.ngc", folder / "setpoints.csv"
    program.write_text(f"G21 G90 G94 G17 G64\n{text}\nM2\n")
    name, velocity = MACHINES[machine]
    settings = ["periods.position_ms=1", "control.profile=linuxcnc", f"control.path_velocity_m_min={velocity}"]
    for axis in "xyz":
        settings += [f"{axis}.limits.travel_min_mm=-9999", f"{axis}.limits.travel_max_mm=9999"]
    options = [word for setting in settings for word in ("--set", setting)]
    offset = ["--work-offset", "G54=0,0,0", "--dialect", "linuxcnc"]
    command = [COMMAND, "psec", program, "--machine", name, *options, *offset, "--out", setpoints]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    with setpoints.open() as file:
        rows = [row[1:] for row in csv.reader(file)][1:]
    moved = [index for index in range(1, len(rows)) if rows[index] != rows[index - 1]]
    return 1e-3 * (moved[-1] - moved[0] + 1)


def test_cycle_times_are_those_of_linuxcnc(tmp_path: Path) -> None:
    assert list(MEASURED) == list(PROGRAMS)
    errors = {}
    for name, (machine, text) in PROGRAMS.items():
        errors[name] = planned_time(tmp_path, machine, text) / MEASURED[name] - 1
    table = "\n".join(f"{name}: {MEASURED[name]} s, {100 * error:+.2f} %" for name, error in errors.items())
    sizes = [abs(error) for error in errors.values()]
    assert statistics.median(sizes) < 0.01, table
    assert max(sizes) < 0.05, table
