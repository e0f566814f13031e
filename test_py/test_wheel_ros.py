"""Module `virtual_axes_py.ros`: its example runs in any directory, and its absence of rclpy is explained."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import virtual_axes_py.ros
from node_process import Node

PAGE = Path(__file__).resolve().parent.parent / "docs/how-to/python.md"


def test_the_example_of_the_client_runs_in_any_directory(tmp_path: Path) -> None:
    lines = [line[4:] for line in (virtual_axes_py.ros.__doc__ or "").splitlines() if line.startswith("    ")]
    with Node(["-p", "time:=fast"]) as node:
        environment = os.environ | {"ROS_DOMAIN_ID": str(node.domain_id)}
        command = [sys.executable, "-c", "\n".join(lines)]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    # The paper's radial deviation of the cascade with feedforward: some 50 µm.
    assert 48 < float(done.stdout.removesuffix(" µm\n")) < 50, done.stdout


def test_the_client_of_the_page_prints_its_output(tmp_path: Path) -> None:
    page = PAGE.read_text(encoding="utf-8").split("<!-- file: client.py -->\n```python\n")[1]
    program, rest = page.split("```", 1)
    expected = rest.split("```text\n")[1].split("```")[0]
    with Node(["-p", "time:=fast"]) as node:
        environment = os.environ | {"ROS_DOMAIN_ID": str(node.domain_id)}
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.returncode) == (expected, 0), done.stderr


def test_without_rclpy_the_module_says_where_it_comes_from() -> None:
    program = (
        "import sys; sys.modules['rclpy'] = None\n"
        "import virtual_axes_py\n"
        "assert 'virtual_axes_py.ros' not in sys.modules\n"
        "import virtual_axes_py.ros\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "ImportError: virtual_axes_py.ros needs rclpy and the messages" in done.stderr
    assert "source the setup file" in done.stderr
