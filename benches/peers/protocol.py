"""How a contender in Python is run: a line `run N` in, a line of JSON with seconds per run and figures out."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

Figures = dict[str, float]
"""Figures of the one axis, by the names of the C loop."""


def figures(max_synchronized: float, peak_current: float, **more: float) -> Figures:
    """The figures that every contender has, and those that it has beside them."""
    return {
        "max_synchronized_tracking_error": float(max_synchronized),
        "peak_current": float(peak_current),
        **{name: float(value) for name, value in more.items()},
    }


def serve(run: Callable[[], Figures], joint: str = "x") -> None:
    """Answers until there is no more input. What compiles or is built at the first run is not in the time."""
    run()
    for line in sys.stdin:
        runs = int(line.split()[1])
        began = time.perf_counter()
        for _ in range(runs):
            found = run()
        seconds = (time.perf_counter() - began) / runs
        print(json.dumps({"seconds": seconds, "machines": [{"axes": {joint: found}}]}), flush=True)
