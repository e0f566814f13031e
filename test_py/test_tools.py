"""The tools: invalid options are rejected before any work; the soak test detects growth."""

from __future__ import annotations

import math
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent
LOOKS = 60
"""Duration of the synthetic looks: one hour."""


@pytest.mark.parametrize(
    ("tool", "options", "words"),
    [
        ("soak", ["--minutes", "nan"], ["--minutes", "'nan'", "above 0"]),
        ("soak", ["--speed=-1"], ["--speed", "'-1'", "above 0"]),
        ("measure", ["node", "--minutes=-1"], ["--minutes", "'-1'", "from 0 on"]),
        ("measure", ["latency", "--messages", "1.5"], ["--messages", "'1.5'", "from 1 on"]),
        ("keystore", ["--domain", "233", "store", "/one"], ["--domain", "'233'", "from 0 to 232"]),
        ("pictures", ["--fast"], ["unrecognized arguments: --fast"]),
    ],
)
def test_invalid_options_are_rejected(tool: str, options: list[str], words: list[str]):
    command = [sys.executable, ROOT / "tools" / f"{tool}.py", *options]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 2 and not ended.stdout
    for word in words:
        assert word in ended.stderr


@pytest.fixture(scope="module")
def soak() -> ModuleType:
    """Loads the tool as a module."""
    tools = str(ROOT / "tools")
    sys.path.insert(0, tools)
    try:
        spec = spec_from_file_location("soak", ROOT / "tools" / "soak.py")
        assert spec is not None and spec.loader is not None
        module = sys.modules["soak"] = module_from_spec(spec)
        spec.loader.exec_module(module)
        return module
    finally:
        sys.path.remove(tools)


def an_hour(soak: ModuleType, **growth: float) -> list:
    """Returns looks at a process with fluctuating figures that grow by these amounts in the second half."""
    looks = []
    for k in range(LOOKS):
        passed = max(2 * k / (LOOKS - 1) - 1, 0.0)
        wave = math.sin(1.7 * k)
        figures = {"memory_mb": 46 + 3 * wave, "files": 175 + round(wave), "threads": 14}
        figures = {name: value + passed * growth.get(name, 0.0) for name, value in figures.items()}
        looks.append(soak.Look(k, endpoints=33 * k, **figures))
    return looks


def test_the_soak_test_accepts_fluctuating_figures(soak: ModuleType, capsys: pytest.CaptureFixture[str]):
    assert not soak.has_grown(an_hour(soak))
    out = capsys.readouterr().out
    assert out.count(": flat") == len(soak.MAY_GROW) and "GROWS" not in out


@pytest.mark.parametrize("growth", [{"memory_mb": 6.0}, {"files": 4.0}, {"threads": 3.0}])
def test_the_soak_test_detects_growth(soak: ModuleType, capsys: pytest.CaptureFixture[str], growth: dict[str, float]):
    assert soak.has_grown(an_hour(soak, **growth))
    assert capsys.readouterr().out.count("GROWS") == 1


def test_the_soak_test_fails_with_too_few_looks(soak: ModuleType):
    assert soak.has_grown(an_hour(soak)[:4])
