"""Protocol of a Python contender: a line `run N` in, a line of JSON with seconds per run and figures out."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from axis import Axis, padded, read_axis
from cases import read_setpoints

Figures = dict[str, float]
"""Figures of the single axis, by the names of the C loop."""


class RunInput(NamedTuple):
    """Input of a run of a single axis."""

    joint: str
    axis: Axis
    psec: list[float]
    """Setpoints, one per position cycle."""
    values: list[float]
    """Setpoints with a lead-in of the length of the delay."""
    start: int
    """Index of the first setpoint in `values`."""


def read_input() -> RunInput:
    """Returns the input named on the command line: the machine table and the setpoints."""
    table, setpoints = map(Path, sys.argv[1:3])
    (joint,), (psec,) = read_setpoints(setpoints)
    axis = read_axis(table, joint)
    return RunInput(joint, axis, psec, *padded(psec, axis))


def figures(max_delay_compensated: float, peak_current: float, **more: float) -> Figures:
    """Returns the figures common to all contenders, and additional ones."""
    return {
        "max_delay_compensated_following_error": float(max_delay_compensated),
        "peak_current": float(peak_current),
        **{name: float(value) for name, value in more.items()},
    }


def serve(run: Callable[[], Figures], joint: str = "x") -> None:
    """Responds until the end of input. The first run, which may compile or build, is not timed."""
    run()
    for line in sys.stdin:
        runs = int(line.split()[1])
        began = time.perf_counter()
        for _ in range(runs):
            found = run()
        seconds = (time.perf_counter() - began) / runs
        print(json.dumps({"seconds": seconds, "machines": [{"axes": {joint: found}}]}), flush=True)
