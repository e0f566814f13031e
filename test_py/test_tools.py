"""Options of the tools: what makes no sense is refused before anything is done."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize(
    ("tool", "options", "words"),
    [
        ("soak", ["--minutes", "nan"], ["--minutes", "'nan'", "above 0"]),
        ("soak", ["--speed", "0"], ["--speed", "'0'", "above 0"]),
        ("soak", ["--speed=-1"], ["--speed", "'-1'", "above 0"]),
        ("soak", ["--only", "visitor,rain"], ["no such traffic: rain", "visitor"]),
        ("measure_node", ["--minutes=-1"], ["--minutes", "'-1'", "from 0 on"]),
        ("measure_rate", ["--seconds", "inf"], ["--seconds", "'inf'"]),
        ("measure_latency", ["--messages", "0"], ["--messages", "'0'", "from 1 on"]),
        ("measure_length", ["--rounds", "1.5"], ["--rounds", "'1.5'", "from 1 on"]),
        ("measure_publish_once", ["--load=-1"], ["--load", "'-1'"]),
        ("run_graph", ["--seconds", "long"], ["--seconds", "'long'"]),
        ("figure11", ["--fast"], ["unrecognized arguments: --fast"]),
    ],
)
def test_what_makes_no_sense_is_refused(tool: str, options: list[str], words: list[str]):
    command = [sys.executable, ROOT / "tools" / f"{tool}.py", *options]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 2 and not ended.stdout
    for word in words:
        assert word in ended.stderr
