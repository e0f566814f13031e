"""Module virtual_axes_py: limit audit of setpoints, and machines as FMUs."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

va = pytest.importorskip("virtual_axes_py")

TSP = 0.006
"""Position cycle, s."""


@pytest.fixture(scope="module")
def machine():
    return va.Machine.load()


def test_a_step_has_the_differences_of_its_size(machine):
    """A step of 0.1 mm: its first, second and third difference are 1, 2 and 3 steps at most."""
    psec = np.zeros((20, 5))
    psec[7, 0] = 1e-4
    found = va.check(machine, psec)
    x = found.axes["x"]
    assert set(found.axes) == {"x"}
    assert x["velocity"]["largest"] == pytest.approx(1e-4 / TSP * 60, rel=1e-9) and x["velocity"]["unit"] == "m/min"
    assert x["acceleration"]["largest"] == pytest.approx(2e-4 / TSP**2, rel=1e-9)
    assert x["jerk"]["largest"] == pytest.approx(3e-4 / TSP**3, rel=1e-9)
    assert x["highest_position"]["value"] == pytest.approx(0.1) and x["highest_position"]["unit"] == "mm"
    assert found.summary["duration_s"] == pytest.approx(19 * TSP)
    assert not found.is_within_limits
    assert "jerk of x" in found.reason and "times its limit" in repr(found)


def test_positions_beyond_the_travel_are_results(machine):
    found = va.check(machine, np.full((3, 5), [0.0, 0.3, 0.0, 0.0, 0.0]))
    assert not found.is_within_limits
    assert "beyond its travel limit 275 mm" in found.reason


def test_a_scenario_is_within_the_limits_of_its_machine(machine):
    found = va.check(machine, va.scenario("ballbar"))
    assert found.is_within_limits and found.reason is None
    assert repr(found) == "CheckResult(within limits)"
    for axis in ("x", "y"):
        assert 0.9 < found.axes[axis]["velocity"]["ratio"] <= 1.0 or found.axes[axis]["velocity"]["ratio"] < 1.0


def test_a_library_of_another_kind_is_rejected(machine, tmp_path: Path):
    text = tmp_path / "text.so"
    text.write_text("no library")
    with pytest.raises(ValueError, match="text.so: it is no shared library"):
        va.fmu(machine, tmp_path / "axes.fmu", text)
    with pytest.raises(ValueError, match="library: names no file"):
        va.fmu(machine, tmp_path / "axes.fmu", [])
    with pytest.raises(ValueError, match="is a library of the FMU"):
        va.fmu(machine, text, text)
    with pytest.raises(TypeError, match="library"):
        va.fmu(machine, tmp_path / "axes.fmu", 7)
    assert text.read_text() == "no library" and not (tmp_path / "axes.fmu").exists()


def test_an_fmu_has_the_machine_and_its_library(machine, tmp_path: Path):
    """The head of an ELF library decides its folder."""
    library = tmp_path / "lib.so"
    head = b"\x7fELF\x02\x01" + bytes(12) + (62).to_bytes(2, "little") + bytes(180)
    library.write_bytes(head + b"fmi2DoStep")
    other = machine.with_({"x.velocity_loop.gain": 4.25})
    va.fmu(other, tmp_path / "axes.fmu", library)
    with zipfile.ZipFile(tmp_path / "axes.fmu") as archive:
        names = archive.namelist()
        assert "modelDescription.xml" in names
        assert archive.read("binaries/linux64/virtual_axes_fmu.so") == library.read_bytes()
        assert "4.25" in archive.read("resources/machine.yaml").decode()
