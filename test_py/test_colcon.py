"""`colcon build` and `colcon test` of the package in a workspace of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from drive import node_binary

ROOT = Path(__file__).resolve().parent.parent
FILES = ("CMakeLists.txt", "package.xml", "config", "launch", "layouts", "msg", "rviz", "test_py/smoke.py", "urdf")
PREFIX = Path(sys.prefix)


def copy_package(source: Path) -> None:
    """Copies what colcon installs and tests."""
    for name in FILES:
        target = source / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, target)


def colcon(workspace: Path, verb: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs a verb of colcon in the environment of the wheels alone."""
    environment = os.environ | {
        "AMENT_PREFIX_PATH": str(PREFIX),
        "CMAKE_PREFIX_PATH": str(PREFIX),
        "LD_LIBRARY_PATH": str(PREFIX / "lib"),
        "PYTHONPATH": "",
        "VIRTUAL_ENV": str(PREFIX),
        "COLCON_HOME": str(workspace / "colcon"),
    }
    # Set by ros_wheels_bootstrapper, which then no longer adds the wheels' libraries to LD_LIBRARY_PATH.
    environment.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
    command = [PREFIX / "bin" / "colcon", "--log-base", "log", verb, *words]
    return subprocess.run(command, cwd=workspace, env=environment, capture_output=True, text=True, timeout=240)


def build(workspace: Path, programs: Path) -> subprocess.CompletedProcess[str]:
    """Builds the package with programs compiled before."""
    return colcon(
        workspace,
        "build",
        "--cmake-args",
        "-GNinja",
        f"-DPython3_EXECUTABLE={PREFIX / 'bin' / 'python'}",
        "-DBUILD_TESTING=ON",
        f"-DVIRTUAL_AXES_BINARY_DIR={programs}",
    )


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Workspace with the built package."""
    folder = tmp_path_factory.mktemp("workspace")
    copy_package(folder / "src" / "virtual_axes")
    done = build(folder, node_binary().parent)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_the_installed_package_passes_its_smoke_test(workspace: Path):
    """All four checks run and pass; without the command's program the same test fails."""
    result = workspace / "build/virtual_axes/test_results/virtual_axes/smoke.xunit.xml"
    done = colcon(workspace, "test", "--return-code-on-test-failure", "--event-handlers", "console_direct+")
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'tests="4" failures="0"' in result.read_text()
    (workspace / "install/virtual_axes/lib/virtual_axes/virtual_axes").unlink()
    done = colcon(workspace, "test", "--return-code-on-test-failure")
    assert done.returncode != 0
    assert 'tests="4" failures="1"' in result.read_text()


def test_a_missing_program_is_an_error(tmp_path: Path, workspace: Path):
    """The installation names the program that is not there."""
    programs = tmp_path / "programs"
    programs.mkdir()
    shutil.copy(node_binary(), programs)
    done = build(workspace, programs)
    assert done.returncode != 0
    assert f"{programs}/virtual_axes" in done.stdout + done.stderr
