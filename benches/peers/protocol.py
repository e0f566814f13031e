"""How a contender in Python is run: a line `run N` in, a line of JSON with seconds per run and figures out."""

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
"""Figures of the one axis, by the names of the C loop."""


class Asked(NamedTuple):
    """The one axis that is to be run."""

    joint: str
    axis: Axis
    psec: list[float]
    """Setpoints, one a position period."""
    values: list[float]
    """The same with what the delay reaches behind the first."""
    start: int
    """Where the first stands in `values`."""


def asked() -> Asked:
    """What the command line names: the table of the machine and the setpoints."""
    table, setpoints = map(Path, sys.argv[1:3])
    (joint,), (psec,) = read_setpoints(setpoints)
    axis = read_axis(table, joint)
    return Asked(joint, axis, psec, *padded(psec, axis))


def figures(max_synchronized: float, peak_current: float, **more: float) -> Figures:
    """The figures that every contender has, and those that it has beside them."""
    return {
        "max_delay_compensated_following_error": float(max_synchronized),
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
