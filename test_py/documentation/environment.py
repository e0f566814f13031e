"""Environment of the shells of a page: what a user has before the first command."""

from __future__ import annotations

import os
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
ROOT = TESTS.parent
STAND_IN = TESTS / "ros2_standin"
VENV = ROOT / ".venv"
REAL_SETUP = "/opt/ros/jazzy/setup.bash"


def environment(home: Path, directory: Path, domain: int) -> dict[str, str]:
    """Returns the variables of a shell with this home directory; cargo builds into its usual folder.

    `/opt/ros/jazzy/setup.bash` stands for ros2_standin/setup.bash: a bash function redirects `source`.
    """
    user = Path(os.path.expanduser("~"))
    own = {str(VENV / "bin"), str(ROOT / ".build")}
    path = [entry for entry in os.environ["PATH"].split(":") if not any(entry.startswith(one) for one in own)]
    setup = write_setup(directory)
    return {
        "HOME": str(home),
        "PATH": ":".join(path),
        "LANG": "C.UTF-8",
        "TERM": "dumb",
        "CARGO_HOME": os.environ.get("CARGO_HOME", str(user / ".cargo")),
        "RUSTUP_HOME": os.environ.get("RUSTUP_HOME", str(user / ".rustup")),
        "CARGO_TARGET_DIR": os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target")),
        "CARGO_TERM_COLOR": "never",
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "BASH_FUNC_source%%": (
            f'() {{ if [ "$1" = {REAL_SETUP} ]; then builtin source "{setup}"; else builtin source "$@"; fi; }}'
        ),
    }


def write_setup(directory: Path) -> Path:
    """Writes the stand-in for /opt/ros/jazzy/setup.bash: PyPI's ROS packages and the stand-in for `ros2`."""
    defaults = directory / "colcon_defaults.yaml"
    site = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    defaults.write_text(
        "build:\n"
        "  cmake-args: [-G, Ninja, -DPython3_EXECUTABLE=" + str(VENV / "bin" / "python") + "]\n"
        "  event-handlers: [console_stderr-]\n"
    )
    setup = directory / "setup.bash"
    setup.write_text(
        f'export PATH="{STAND_IN}:{VENV}/bin:$PATH" VIRTUAL_ENV="{VENV}"\n'
        f'export AMENT_PREFIX_PATH="{VENV}" CMAKE_PREFIX_PATH="{VENV}" COLCON_DEFAULTS_FILE="{defaults}"\n'
        f'export LD_LIBRARY_PATH="{VENV}/lib" PYTHONPATH="{VENV}/lib/{site}/site-packages" ROS_DISTRO=jazzy\n'
    )
    return setup
