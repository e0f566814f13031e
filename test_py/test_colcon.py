"""`colcon build` and `colcon test` of the package in a workspace of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu

from documentation.place import Place
from node_process import node_binary

pytestmark = pytest.mark.extended

PREFIX = Path(sys.prefix)
PROGRAMS = ("virtual_axes", "virtual_axes_node")


class Workspace:
    """Copy of the checkout, with the crates compiled before, and the folders that colcon writes."""

    def __init__(self, folder: Path) -> None:
        """Copies the checkout."""
        self.folder = folder
        # Its domain is unused: the smoke test reserves one itself.
        self.place = Place(folder, node_binary(), domain_id=0)
        self.source = self.place.copy_checkout()
        self.result = folder / "build/virtual_axes/test_results/virtual_axes/smoke.xunit.xml"
        self.installed = folder / "install/virtual_axes/lib/virtual_axes"

    def colcon(self, verb: str, *words: str) -> subprocess.CompletedProcess[str]:
        """Runs a verb of colcon in the environment of the wheels alone."""
        environment = os.environ | {
            "AMENT_PREFIX_PATH": str(PREFIX),
            "CMAKE_PREFIX_PATH": str(PREFIX),
            "LD_LIBRARY_PATH": str(PREFIX / "lib"),
            "PYTHONPATH": "",
            "VIRTUAL_ENV": str(PREFIX),
            "COLCON_HOME": str(self.folder / "colcon"),
            "CARGO_TARGET_DIR": self.place.environment["CARGO_TARGET_DIR"],
            "CARGO_NET_OFFLINE": "true",
        }
        # Set by ros_wheels_bootstrapper, which then no longer adds the wheels' libraries to LD_LIBRARY_PATH.
        environment.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
        command = [PREFIX / "bin" / "colcon", "--log-base", "log", verb, "--paths", self.source, *words]
        # cargo may wait until the Rust tests are compiled, which happens beside these tests.
        return subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, text=True, timeout=1200)

    def build(self, *definitions: str) -> subprocess.CompletedProcess[str]:
        """Builds the package as the README has it, plus definitions of CMake."""
        python = f"-DPython3_EXECUTABLE={PREFIX / 'bin' / 'python'}"
        return self.colcon("build", "--cmake-args", "-GNinja", python, "-DBUILD_TESTING=ON", *definitions)


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workspace]:
    """Workspace with the built package."""
    space = Workspace(tmp_path_factory.mktemp("workspace").resolve())
    try:
        done = space.build()
        assert done.returncode == 0, done.stdout + done.stderr
        yield space
    finally:
        space.place.remove()


def test_the_installed_command_writes_an_fmu(workspace: Workspace, tmp_path: Path):
    """The library is installed beside the command."""
    fmu = tmp_path / "axes.fmu"
    subprocess.run([workspace.installed / "virtual_axes", "fmu", "--out", fmu], check=True, timeout=60)
    assert validate_fmu(str(fmu)) == []
    assert "binaries/linux64/virtual_axes_fmu.so" in zipfile.ZipFile(fmu).namelist()


def test_the_installed_package_passes_its_smoke_test(workspace: Workspace):
    """All four checks run and pass; without the command's program the same test fails."""
    done = workspace.colcon("test", "--return-code-on-test-failure", "--event-handlers", "console_direct+")
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'tests="4" failures="0"' in workspace.result.read_text()
    (workspace.installed / "virtual_axes").unlink()
    done = workspace.colcon("test", "--return-code-on-test-failure")
    assert done.returncode != 0
    assert 'tests="4" failures="1"' in workspace.result.read_text()


def test_without_the_programs_there_is_no_smoke_test(workspace: Workspace):
    """Messages alone build, and no test is registered that could only fail."""
    done = workspace.build("-DVIRTUAL_AXES_BUILD_NODE=OFF")
    assert done.returncode == 0, done.stdout + done.stderr
    listed = subprocess.run(
        [PREFIX / "bin" / "ctest", "-N"],
        cwd=workspace.folder / "build/virtual_axes",
        capture_output=True,
        text=True,
        check=True,
    )
    assert "Total Tests: 0" in listed.stdout


@pytest.mark.parametrize("missing", PROGRAMS)
def test_a_missing_program_is_an_error(tmp_path: Path, workspace: Workspace, missing: str):
    """The installation names the program that is not there."""
    for name in PROGRAMS:
        if name != missing:
            shutil.copy(node_binary().with_name(name), tmp_path)
    done = workspace.build(f"-DVIRTUAL_AXES_BINARY_DIR={tmp_path}")
    assert done.returncode != 0
    # CMake breaks the lines of its messages.
    assert f'cannot find "{tmp_path}/{missing}"' in " ".join((done.stdout + done.stderr).split())


def test_the_plugin_of_ros2_control_is_built_where_its_headers_are_found(workspace: Workspace):
    """Without them, it is skipped with one line; with stand-ins, library and description are installed."""
    log = workspace.folder / "log" / "latest_build" / "virtual_axes" / "stdout.log"
    library = workspace.folder / "install/virtual_axes/lib/libvirtual_axes_ros2_control.so"
    own = ["-DVIRTUAL_AXES_BUILD_NODE=ON", "-DVIRTUAL_AXES_BINARY_DIR="]
    done = workspace.build(*own)
    assert done.returncode == 0, done.stdout + done.stderr
    assert log.read_text().count("ros2_control plugin skipped: hardware_interface, pluginlib,") == 1
    assert not library.exists()
    standin = workspace.source / "ros2_control/test/standin/cmake"
    packages = ("hardware_interface", "pluginlib", "rclcpp", "rclcpp_lifecycle")
    done = workspace.build(*own, *(f"-D{package}_DIR={standin}" for package in packages))
    assert done.returncode == 0, done.stdout + done.stderr
    symbols = subprocess.run(["nm", "-DC", library], capture_output=True, text=True, check=True).stdout
    assert "T virtual_axes_ros2_control::VirtualAxesSystem::write" in symbols
    assert " va_step_for_ns" not in symbols
    share = workspace.folder / "install/virtual_axes/share/virtual_axes/ros2_control"
    files = sorted(str(path.relative_to(share)) for path in share.rglob("*") if path.is_file())
    assert files == ["config/controllers.yaml", "config/mikron_ucp710.ros2_control.xml", "virtual_axes_system.xml"]
