"""Comparison of tools/freeze.py: differences, renames, key paths."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

TOOL = Path(__file__).resolve().parent.parent / "tools" / "freeze.py"


@pytest.fixture(scope="module")
def freeze() -> ModuleType:
    """Loads the tool as a module."""
    spec = spec_from_file_location("freeze", TOOL)
    assert spec is not None and spec.loader is not None
    module = sys.modules["freeze"] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_equal_recordings_have_no_differences(freeze: ModuleType):
    recording = {"runs": {"a": {"status": 0, "figures": [1.5, None, {"k": "v"}]}}, "help": ["one", "two"]}
    assert list(freeze.differences(recording, json.loads(json.dumps(recording)))) == []


@pytest.mark.parametrize(
    ("a", "b", "lines"),
    [
        ({"k": 1.0}, {"k": 1.0000000000000002}, ["k: 1.0 → 1.0000000000000002"]),
        ({"k": 0.0}, {"k": -0.0}, ["k: 0.0 → -0.0"]),
        ({"k": 0}, {"k": 0.0}, ["k: 0 → 0.0"]),
        ({"k": float("nan")}, {"k": float("nan")}, []),
        ({"k": {"old": 1}}, {"k": {"new": 1}}, ["k › new: only in B: 1", "k › old: only in A: 1"]),
        ({"k": [1, 2]}, {"k": [1]}, ["k: 2 → 1 elements"]),
        ({"k": ["a", "b", "c"]}, {"k": ["a", "c", "d"]}, ['k: only in A: "b"', 'k: only in B: "d"']),
        ({"k": ["a", "b"]}, {"k": ["a", "x"]}, ['k: "b" → "x"']),
        ({"k": ["a     b"]}, {"k": ["a  b"]}, []),
    ],
)
def test_each_difference_is_one_line(freeze: ModuleType, a: dict, b: dict, lines: list[str]):
    assert list(freeze.differences(a, b)) == lines


def test_renames_replace_whole_words_at_once(freeze: ModuleType):
    renames = freeze.read_renames("psec\tsetpoint\nsetpoint\tposition\nx stress\tx_stress\n\n")
    before = {"x.psec": ["psec, psec_stream, --psec", 1], "setpoint": "run x stress --count"}
    after = {"x.setpoint": ["setpoint, psec_stream, --setpoint", 1], "position": "run x_stress --count"}
    assert freeze.renamed(before, renames) == after
    with pytest.raises(ValueError, match="line 1"):
        freeze.read_renames("psec setpoint\n")


def test_key_paths_have_the_kinds_of_all_their_values(freeze: ModuleType):
    values = [{"runs": [{"a": 1}, {"a": None}], "empty": []}, {"runs": [{"b": {"c": "text", "d": True}}]}]
    kinds = {"empty": "list", "runs[].a": "null|number", "runs[].b.c": "text", "runs[].b.d": "boolean"}
    assert freeze.merged_keys(values) == kinds


def test_settings_of_nested_keys(freeze: ModuleType):
    lines = ["/**:", "  ros__parameters:", "    x:", "      loop:", "        r: [1.0, -2.0]", "    y:", "      gain: 3"]
    assert freeze.settings(lines) == ["x.loop.r=[1.0,-2.0]", "y.gain=3"]


def test_stress_is_a_program_where_there_is_one(freeze: ModuleType, tmp_path: Path):
    programs = freeze.Programs(tmp_path, tmp_path)
    assert programs.command(["stress", "--json"]) == [f"{tmp_path}/virtual_axes", "stress", "--json"]
    (tmp_path / "virtual_axes_stress").touch()
    assert programs.command(["stress", "--json"]) == [f"{tmp_path}/virtual_axes_stress", "--json"]


def test_the_exit_status_is_1_if_recordings_differ(tmp_path: Path):
    a, b, renames = (tmp_path / name for name in ("a.json", "b.json", "renames.tsv"))
    a.write_text('{"old": 1}')
    b.write_text('{"new": 1}')
    renames.write_text("old\tnew\n")

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, str(TOOL), *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=60)

    differing = run("--compare", a, b)
    assert (differing.returncode, len(differing.stdout.splitlines())) == (1, 2)
    assert run("--compare", a, b, "--renames", renames).returncode == 0
    assert run("--compare", a, tmp_path / "missing.json").returncode == 2
    assert run("--bin", tmp_path, "--out", tmp_path / "out.json").returncode == 2
    assert run().returncode == 2
