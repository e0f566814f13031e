"""Ballbar of the paper's figure 10 over ROS 2: cascade with and without feedforward, predictive control.

./demo.sh [--fast] [--out FILE.png]
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import numpy as np

from node_process import Node
from polar_chart import Circle, draw

# The client without its package, which needs the compiled module.
sys.path.append(str(Path(__file__).resolve().parent.parent / "crates/py/python/virtual_axes_py"))
from ros import (  # noqa: E402  (the path to it is set above)
    AxesClient,
    Ballbar,
    Recording,
    ballbar,
    circular_deviation,
    joint_trajectory,
)

AXES = ("x", "y")
RUNS: dict[str, dict[str, object]] = {
    "cascade with feedforward": {},
    "cascade without feedforward": {
        f"{axis}.feedforward.{part}": 0.0 for axis in AXES for part in ("velocity", "torque_kg_m2")
    },
    "predictive control": {f"{axis}.position_loop.controller": "gpc" for axis in AXES},
}
"""Parameters of each run, in order. Feedforward belongs to the cascade."""

PAPER = {"cascade with feedforward": "50 (fig. 10, left)", "predictive control": "almost 0 (fig. 10, right)"}
MODEL_UM = {"cascade with feedforward": +49.0, "cascade without feedforward": -283.1, "predictive control": -0.4}
"""Specified mean radial deviation of this package's model, µm."""


def measure(drive: AxesClient, path: Ballbar) -> Recording:
    """Runs the circle once from home, over the topic `psec`."""
    drive.reset()
    drive.drop_samples()
    return drive.run(joint_trajectory(AXES, path.time, np.column_stack([path.x, path.y])), timeout=60)


def report(path: Ballbar, runs: dict[str, Recording]) -> str:
    """Returns the table of radial deviations and following errors, µm."""
    head = ["ballbar R 150 mm, 15 m/min", "mean", "min", "max", "G", "specified", "paper"]
    rows = [(*head, "X, Y max |e| delay-compensated")]
    for title, run in runs.items():
        deviation = run.radial_deviation(path.center, path.radius)[run.within(path.steady)] * 1e6
        error = [np.abs(run.states["synchronized_tracking_error", axis]).max() * 1e6 for axis in AXES]
        rows.append(
            (
                title,
                f"{deviation.mean():+.1f}",
                f"{deviation.min():+.1f}",
                f"{deviation.max():+.1f}",
                f"{circular_deviation(deviation):.1f}",
                f"{MODEL_UM[title]:+.1f}",
                PAPER.get(title, "-"),
                f"{error[0]:.0f}, {error[1]:.0f}",
            )
        )
    first, *widths = [max(map(len, column)) for column in zip(*rows)]
    rows.insert(1, tuple("-" * width for width in (first, *widths)))
    lines = ["  ".join([row[0].ljust(first), *map(str.rjust, row[1:], widths)]) for row in rows]
    lines += [
        "",
        "Sampled every position cycle, as published; `virtual_axes run` takes every tick, so that its G is larger.",
    ]
    return "\n".join(["Radial deviation and following errors in µm:", "", *lines])


def circle(path: Ballbar, run: Recording) -> Circle:
    """Returns the radial deviation over the polar angle, in µm."""
    steady = run.within(path.steady)
    x, y = (run.joints["position", axis][steady] for axis in AXES)
    angle = np.unwrap(np.arctan2(y - path.center[1], x - path.center[0]))
    deviation = run.radial_deviation(path.center, path.radius)[steady] * 1e6
    return Circle(angle, deviation, deviation.mean(), circular_deviation(deviation))


def main() -> int:
    """Runs the circles, prints the table and draws the plots."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fast", action="store_true", help="run as fast as possible, not in real time")
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent.parent / ".build" / "ballbar.png")
    arguments = parser.parse_args()
    if arguments.out.suffix.lower() not in (".png", ".pdf", ".svg"):
        parser.error(f"--out: '{arguments.out}': the file extension must be .png, .pdf or .svg")
    try:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"--out: {error}")
    # SIGTERM and a closed terminal also raise, so that the node is stopped.
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: sys.exit(1))

    path = ballbar()
    clock = "fast" if arguments.fast else "real"
    runs: dict[str, Recording] = {}
    with Node(["-p", f"time:={clock}"]) as process, AxesClient(process=process) as drive:
        print(f"node {process.name}, process {process.pid}, domain {process.domain_id}, time: {clock}")
        for title, values in RUNS.items():
            drive.set_parameters(values)
            print(f"ballbar {title}: {path.time[-1]:.1f} s of motion ...", end=" ", flush=True)
            began = time.monotonic()
            runs[title] = measure(drive, path)
            print(f"{time.monotonic() - began:.1f} s, {len(runs[title].joints)} samples")
        status = process.stop()
    print(f"node ended with status {status}\n")
    print(report(path, runs))
    draw({title: circle(path, run) for title, run in runs.items()}).savefig(arguments.out, dpi=150)
    print(f"\npicture: {arguments.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
