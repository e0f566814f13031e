"""docs/reproduction.md equals the output of its commands."""

import subprocess
import sys
from pathlib import Path


def test_the_page_equals_the_output_of_its_commands():
    """All figures of the page are recomputed by its commands."""
    script = Path(__file__).resolve().parent.parent / "tools" / "reproduction.py"
    result = subprocess.run([sys.executable, script, "--check"], timeout=600, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr or "docs/reproduction.md differs: run tools/reproduction.py"
