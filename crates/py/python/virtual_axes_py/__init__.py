"""Virtual machine-tool axes: feed drives of machine tools, simulated from Python.

    import virtual_axes_py as va

    machine = va.Machine.load()
    run = machine.simulate(va.scenario("ballbar"))
    print(run.figures["contour_error_um"]["max"])

Lengths are in m, angles in rad, times in s, currents in A. Figures have the keys and units of
`virtual_axes run --json`. The module needs NumPy only; pandas and matplotlib are imported where they are used.

The ROS messages of the node are in the module `virtual_axes`, which ROS generates; both can be imported together.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence

from . import design
from ._native import PartProgram, Rst, Scenario, __version__, machine_names, nc_program_names, scenario_names
from .arguments import named_errors, to_list, to_path, to_real
from .chunks import SweepResult
from .design import frequency_response as bode
from .design import plot_bode
from .export import CheckResult, check, fmu
from .identification import Identification, identify
from .machine import SIGNALS, TOOL_SIGNALS, Machine
from .optimization import Optimum, optimize
from .run import Circle, Run
from .shards import merge
from .stepper import Stepper
from .study import SweepResults, random_variants, sweep
from .tuning import LearningResult, RobustnessResult, TuningResult, learn, robustness, tune

__all__ = [
    "SIGNALS",
    "TOOL_SIGNALS",
    "CheckResult",
    "Circle",
    "Identification",
    "LearningResult",
    "Machine",
    "Optimum",
    "PartProgram",
    "RobustnessResult",
    "Rst",
    "Run",
    "Scenario",
    "Stepper",
    "SweepResult",
    "SweepResults",
    "TuningResult",
    "__version__",
    "bode",
    "check",
    "design",
    "fmu",
    "identify",
    "learn",
    "machine_names",
    "merge",
    "nc_program",
    "nc_program_names",
    "optimize",
    "plot_bode",
    "random_variants",
    "robustness",
    "scenario",
    "scenario_names",
    "sweep",
    "tune",
]


def scenario(name_or_path: str | os.PathLike[str], feed: float | None = None) -> Scenario:
    """Loads a built-in scenario (`scenario_names()`) or a scenario file.

    `feed` replaces the feed of the scenario, m/min (rpm for a scenario of rotary moves). Raises `ValueError` with file,
    line, key and value for an invalid scenario.
    """
    return Scenario.load(to_path("name_or_path", name_or_path), None if feed is None else to_real("feed", feed))


def nc_program(
    name_or_path: str | os.PathLike[str],
    feed_override: float = 1.0,
    *,
    ignore: int | str | Iterable[int | str] = (),
    chord_error: float | None = None,
    centripetal_acceleration: float | None = None,
    dialect: str | None = None,
    work_offset: Mapping[str, Sequence[float]] | str | Iterable[str] = (),
    tools: str | os.PathLike[str] | Mapping[int, tuple[float, float]] | None = None,
    tool_change_s: float | None = None,
    spindle_s: float | None = None,
) -> PartProgram:
    """Names a part program in G code: a built-in one (`nc_program_names()`) or a file.

    It is read and planned when it is simulated. Words that have no effect then give a `UserWarning` with file and line.
    The figures of a run have its times and energy by tool and operation and its lines with the largest contour errors,
    `figures["part_program"]`, unless only those of the axes are computed.

    `feed_override` is above 0 and at most 2, 1 for the programmed feed. `ignore` contains M codes without effect, as
    `[7, "M110"]`. `chord_error` bounds the chord error of the setpoints as a polyline, m, and
    `centripetal_acceleration` that of the tool tip, m/s².

    What is not given is that of the machine file (`part_program`). `dialect` is linuxcnc, fanuc, haas, sinumerik, grbl,
    mach3, okuma or marlin. `work_offset` has X, Y and Z in m, then A, B and C in rad, as in `{"G54": (0.12, 0.08,
    -0.35)}`, or texts in mm and degrees, as the command: `"G54=120,80,-350"`. `tools` is the path of a tool table
    (tool.tbl of LinuxCNC, or CSV, both in mm), or length and radius in m by number, as in `{1: (0.05, 0.005)}`.
    `tool_change_s` is the duration of a tool change, and `spindle_s` that of a change of the spindle speed, s.

    Raises `ValueError` for other values.
    """
    if isinstance(name_or_path, str) and "\n" in name_or_path:
        text = "it must be a name or a path: pathlib.Path('part.nc').write_text(text) writes it to a file"
        raise ValueError(f"name_or_path is the text of a program; {text}")
    arguments = {
        "feed_override": to_real("feed_override", feed_override),
        "ignore": [str(code) for code in ([ignore] if isinstance(ignore, int | str) else ignore)],
        "chord_error": chord_error,
        "centripetal_acceleration": centripetal_acceleration,
        "dialect": dialect,
        "work_offset": _work_offsets(work_offset),
        "tool_table": None if tools is None or isinstance(tools, Mapping) else to_path("tools", tools),
        "tools": [_tool(number, size) for number, size in tools.items()] if isinstance(tools, Mapping) else [],
        "tool_change_s": tool_change_s,
        "spindle_s": spindle_s,
    }
    with named_errors(arguments):
        return PartProgram.load(to_path("name_or_path", name_or_path), arguments)


def _work_offsets(offsets: Mapping[str, Sequence[float]] | str | Iterable[str]) -> list[str]:
    """Returns work offsets in the notation of the command, mm and degrees."""
    if not isinstance(offsets, Mapping):
        return [offsets] if isinstance(offsets, str) else list(offsets)
    texts = []
    for name, given in offsets.items():
        values = to_list(f"work_offset of {name}", given)
        if not 3 <= len(values) <= 6:
            expected = "X, Y and Z in m, then at most A, B and C in rad"
            raise ValueError(f"work_offset of {name} has {len(values)} values; it must have {expected}")
        units = [1e3] * 3 + [math.degrees(1.0)] * 3
        texts.append(f"{name}={','.join(repr(value * unit) for value, unit in zip(values, units, strict=False))}")
    return texts


def _tool(number: int, size: Sequence[float]) -> str:
    """Returns a tool in the notation of LinuxCNC, mm."""
    values = to_list(f"tools: tool {number}", size)
    if len(values) != 2:
        raise ValueError(f"tools: tool {number} has {len(values)} values; it must have length and radius in m")
    length, radius = values
    return f"T{number} Z{length * 1e3!r} D{radius * 2e3!r}"


def __dir__() -> list[str]:
    """Returns the public names, without those of imported modules."""
    return sorted({*__all__, "__doc__", "__file__", "__name__", "__path__"})
