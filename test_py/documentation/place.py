"""Where a page is executed: empty home and working directory, a copy of the checkout, stand-ins for ROS."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROS = Path("/opt/ros/jazzy")
STANDIN = ROOT / "test_py" / "ros2_standin.py"

LEFT_SECONDS = 3600
"""Age from which a copy of cargo's output is a remainder."""
LINKED = {"bin", "cmeel.prefix", "include", "install", "lib", "lib64", "pyvenv.cfg", "share"}
"""Entries of .venv and .build that the copy of the checkout has by links."""

SETUP = """# Stand-in for ROS 2's setup.bash: the packages from PyPI, control_msgs, and a `ros2` command.
export VIRTUAL_ENV="{venv}"
export PATH="{ros}/bin:{venv}/bin:$PATH"
export AMENT_PREFIX_PATH="{ros}:{ros}/pypi" CMAKE_PREFIX_PATH="{ros}:{ros}/pypi"
export LD_LIBRARY_PATH="{ros}/lib:{venv}/lib"
export PYTHONPATH="{packages}"
export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
"""

WORKSPACE = """# Stand-in for the setup.bash of a workspace with this package.
export AMENT_PREFIX_PATH="{prefix}:$AMENT_PREFIX_PATH"
export LD_LIBRARY_PATH="{prefix}/lib:$LD_LIBRARY_PATH"
export PYTHONPATH="{packages}:{root}/crates/py/python:$PYTHONPATH"
"""

# In the copy of the checkout, tools/setup.sh finds its stages done: it would install from PyPI for minutes.
STAMPS = """set -euo pipefail
root=$PWD venv=$PWD/.venv build=$PWD/.build overlay=test_py/overlay/control_msgs
eval "$(sed -n '/^hash_of() {/,/^}/p; /^venv_hash=/,/^messages_stamp=/p' tools/setup.sh)"
echo "$venv_hash" >"$venv_stamp"
echo "$messages_hash" >"$messages_stamp"
"""


class Place:
    """Directories and environment of one page."""

    def __init__(self, directory: Path, program: Path, domain_id: int) -> None:
        """Creates empty directories; `program` is the node that cargo built."""
        self.directory = directory
        self.home, self.work, self.checkout = (directory / name for name in ("home", "work", "virtual_axes"))
        for path in (self.home, self.work):
            path.mkdir()
        self._program = program
        self._target: Path | None = None
        self._ros: Path | None = None
        self.standins: set[str] = set()
        """Stand-ins that the page has used so far."""
        user = Path.home()
        cargo = Path(os.environ.get("CARGO_HOME", user / ".cargo"))
        tools = [self.home / ".cargo" / "bin", Path(shutil.which("cargo") or cargo / "bin" / "cargo").parent]
        self.environment = {
            "HOME": str(self.home),
            "PATH": ":".join([*map(str, tools), "/usr/local/bin:/usr/bin:/bin"]),
            "LANG": "C.UTF-8",
            "COLUMNS": "100",
            "ROS_DOMAIN_ID": str(domain_id),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "CARGO_HOME": str(cargo),
            "CARGO_INSTALL_ROOT": str(self.home / ".cargo"),
            "CARGO_NET_OFFLINE": "true",
            "RUSTUP_HOME": os.environ.get("RUSTUP_HOME", str(user / ".rustup")),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        if "VIRTUAL_AXES_DOMAIN_IDS" in os.environ:
            self.environment["VIRTUAL_AXES_DOMAIN_IDS"] = os.environ["VIRTUAL_AXES_DOMAIN_IDS"]

    def install_command(self) -> None:
        """Puts `virtual_axes` on the PATH, as `cargo install` does on the page before."""
        folder = self.home / ".cargo" / "bin"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "virtual_axes").symlink_to(self._program.with_name("virtual_axes").resolve())

    def install_module(self) -> None:
        """Lets `python3` import `virtual_axes_py` and the packages of its extras, as `pip install` does."""
        python = self.home / ".cargo" / "bin" / "python3"
        python.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}/crates/py/python" exec "{sys.executable}" "$@"\n')
        python.chmod(0o755)
        self.standins.add("virtual_axes_py as cargo builds it")

    def install_workspace(self) -> None:
        """Makes ~/ws/install as `colcon build` leaves it, by links to programs, messages and launch files."""
        messages = self._messages()
        if messages is None:
            raise FileNotFoundError("no control_msgs in AMENT_PREFIX_PATH: source .build/env.sh")
        install = self.home / "ws" / "install"
        share, library = (install / "virtual_axes" / name for name in ("share", "lib"))
        programs = [self._program.with_name(name) for name in ("virtual_axes_node", "virtual_axes")]
        folders = [ROOT / name for name in ("config", "launch", "layouts", "rviz", "urdf")]
        for target, entries in {
            library: (messages / "lib").iterdir(),
            library / "virtual_axes": programs,
            share: (one for one in (messages / "share").iterdir() if one.name != "virtual_axes"),
            share / "virtual_axes": [*(messages / "share" / "virtual_axes").iterdir(), *folders],
        }.items():
            target.mkdir(parents=True)
            for entry in entries:
                (target / entry.name).symlink_to(entry.resolve())
        packages = next(library.glob("python3*/site-packages"))
        text = WORKSPACE.format(prefix=install / "virtual_axes", packages=packages, root=ROOT)
        (install / "setup.bash").write_text(text)
        self.standins.add("workspace as colcon builds it")

    def copy_checkout(self) -> Path:
        """Copies the files that git knows, as they are, with the compiled crates and the Python environment."""
        if self.checkout.exists():
            return self.checkout
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
        for name in filter(None, listed.stdout.split("\0")):
            if (ROOT / name).exists():
                (self.checkout / name).parent.mkdir(parents=True, exist_ok=True)
                # With its time of modification: cargo compiles nothing again.
                shutil.copy2(ROOT / name, self.checkout / name, follow_symlinks=False)
        self.standins.add("crates compiled before")
        (self.checkout / "target").symlink_to(self._copy_target())
        self._copy_python()
        return self.checkout

    def _copy_target(self) -> Path:
        """Copies cargo's output: the locks of a build elsewhere do not matter, and nothing there changes."""
        release = self._program.resolve().parent
        folder = release.parent / "documentation"
        for left in folder.glob("*"):
            # Of a run that was killed.
            if left.stat().st_mtime < time.time() - LEFT_SECONDS:
                shutil.rmtree(left, ignore_errors=True)
        self._target = folder / f"{self.directory.parent.name}-{self.directory.name}"
        shutil.rmtree(self._target, ignore_errors=True)
        (self._target / "release").mkdir(parents=True)
        for name in (".fingerprint", "build", "deps"):
            # Linked where files are replaced, not written.
            options = "-al" if name == "deps" else "-a"
            # Temporary files of a build that runs at the same time may vanish meanwhile.
            subprocess.run(
                ["cp", options, str(release / name), str(self._target / "release")],
                check=False,
                stderr=subprocess.DEVNULL,
            )
        # Object files of a build that runs at the same time: the compiler writes into them.
        for part in (self._target / "release" / "deps").glob("*.rcgu.o"):
            part.unlink()
        self.environment["CARGO_TARGET_DIR"] = str(self._target)
        return self._target

    def _copy_python(self) -> None:
        """Prepares .venv and .build as after `tools/setup.sh`, by links to those of this environment."""
        install = self._messages()
        if install is None:
            return
        self.standins.add("Python environment of tools/setup.sh prepared before")
        for source, target in ((Path(sys.prefix), self.checkout / ".venv"), (install.parent, self.checkout / ".build")):
            target.mkdir()
            for entry in source.iterdir():
                if entry.name in LINKED:
                    (target / entry.name).symlink_to(entry)
            (target / "COLCON_IGNORE").touch()
        shutil.copy(install.parent / "env.sh", self.checkout / ".build")
        subprocess.run(["bash", "-c", STAMPS], cwd=self.checkout, check=True)

    @staticmethod
    def _messages() -> Path | None:
        """Returns the prefix with the messages that tools/setup.sh built."""
        prefixes = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if prefix]
        return next((prefix for prefix in prefixes if (prefix / "share" / "control_msgs").is_dir()), None)

    def ros(self) -> Path:
        """Returns the directory that stands for /opt/ros/jazzy: itself where ROS is installed."""
        if ROS.is_dir():
            return ROS
        if self._ros is None:
            self._ros = self.directory / "opt" / "ros" / "jazzy"
            self._make_ros(self._ros)
            self.standins |= {"/opt/ros/jazzy: packages from PyPI", "ros2: test_py/ros2_standin.py"}
        return self._ros

    def _make_ros(self, ros: Path) -> None:
        messages = self._messages()
        if messages is None:
            raise FileNotFoundError("no control_msgs in AMENT_PREFIX_PATH: source .build/env.sh")
        # Without the messages of this package, which the page builds.
        for found in [*messages.glob("**/*control_msgs*")]:
            target = ros / found.relative_to(messages)
            if not target.exists() and not any(parent.is_symlink() for parent in target.parents):
                target.parent.mkdir(parents=True, exist_ok=True)
                target.symlink_to(found)
        (ros / "bin").mkdir()
        (ros / "bin" / "ros2").write_text(f'#!/bin/sh\nexec "{sys.executable}" "{STANDIN}" "$@"\n')
        (ros / "bin" / "ros2").chmod(0o755)
        # The environment with the files that colcon expects of a prefix.
        (ros / "pypi").mkdir()
        for entry in ("include", "lib", "share"):
            (ros / "pypi" / entry).symlink_to(Path(sys.prefix) / entry)
        for prefix in (ros, ros / "pypi"):
            (prefix / "local_setup.bash").touch()
        packages = next(ros.glob("lib/python3*/site-packages"))
        (ros / "setup.bash").write_text(SETUP.format(venv=sys.prefix, ros=ros, packages=packages))

    def command(self, text: str) -> str:
        """Returns a command of the page with the place of the stand-in."""
        return text.replace(str(ROS), str(self.ros())) if str(ROS) in text else text

    def shown(self, line: str) -> str:
        """Returns a line of output with the names that a reader sees."""
        return line.replace(str(self._ros), str(ROS)) if self._ros else line

    def remove(self) -> None:
        """Removes the copy of cargo's output."""
        if self._target:
            shutil.rmtree(self._target, ignore_errors=True)
