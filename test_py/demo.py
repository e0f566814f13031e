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
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter

from drive import Ballbar, Drive, Node, Recording, ballbar, circular_deviation, joint_trajectory

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


def measure(drive: Drive, path: Ballbar) -> Recording:
    """Runs the circle once from home, over the topic `psec`."""
    drive.reset()
    drive.forget()
    return drive.run(joint_trajectory(AXES, path.time, np.column_stack([path.x, path.y])), timeout=60)


def report(path: Ballbar, runs: dict[str, Recording]) -> str:
    """Returns the table of radial deviations and following errors, µm."""
    head = (
        "ballbar R 150 mm, 15 m/min",
        "mean",
        "min",
        "max",
        "G",
        "specified",
        "paper",
        "X, Y max |e| delay-compensated",
    )
    rows = [head]
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
    widths = [max(len(row[column]) for row in rows) for column in range(len(head))]
    lines = [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths))
        )
        for row in rows
    ]
    lines.insert(1, "  ".join("-" * width for width in widths))
    lines += [
        "",
        "Sampled every position cycle, as published; `virtual_axes run` takes every tick, so that its G is larger.",
    ]
    return "\n".join(["Radial deviation and following errors in µm:", "", *lines])


def draw(path: Ballbar, runs: dict[str, Recording], file: Path) -> None:
    """Draws polar plots of the radial deviation, magnified as on a ballbar chart."""
    figure, plots = plt.subplots(
        1, len(runs), figsize=(14.5, 6.2), subplot_kw={"projection": "polar"}, layout="constrained"
    )
    # Black and one strong color, solid and dashed: readable in grayscale print.
    for plot, (title, run) in zip(np.atleast_1d(plots), runs.items()):
        steady = run.within(path.steady)
        x, y = (run.joints["position", axis][steady] for axis in AXES)
        angle = np.unwrap(np.arctan2(y - path.center[1], x - path.center[0]))
        deviation = run.radial_deviation(path.center, path.radius)[steady] * 1e6
        turn = np.linspace(0, 2 * np.pi, 361)
        step = _round_step(np.abs(deviation).max() / 2)
        plot.plot(
            turn,
            np.zeros_like(turn),
            color="black",
            linewidth=1.2,
            linestyle="--",
            label="programmed circle, R = 150 mm",
        )
        plot.plot(angle, deviation, color="#b2182b", linewidth=1.6, label="simulated position")
        # The nominal circle has a radius of four grid steps, so that an inward deviation stays off the center.
        plot.set_rorigin(-6 * step)
        plot.set_rlim(-4 * step, 3 * step)
        plot.set_rticks([factor * step for factor in range(-3, 4)])
        plot.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:+g}" if value else "0"))
        # Vertical axis: most space for labels one above the other.
        plot.set_rlabel_position(80)
        for label in plot.get_yticklabels():
            label.set(fontsize=8, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5})
        plot.grid(color="0.8", linewidth=0.6)
        plot.set_title(
            f"{title}\nmean {deviation.mean():+.1f} µm, G = {circular_deviation(deviation):.1f} µm", fontsize=11
        )
    figure.legend(*plot.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=10, frameon=False)
    figure.suptitle(
        "Ballbar in X–Y at 15 m/min: radial deviation in µm over the polar angle, individual scales", fontsize=12
    )
    figure.savefig(file, dpi=150)
    plt.close(figure)


def _round_step(value: float) -> float:
    """Rounds up to 1, 2 or 5 times a power of ten."""
    power = 10 ** np.floor(np.log10(max(value, 1e-3)))
    return float(next(factor * power for factor in (1, 2, 5, 10) if factor * power >= value))


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
    with Node(["-p", f"time:={clock}"]) as process, Drive(process=process) as drive:
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
    draw(path, runs, arguments.out)
    print(f"\npicture: {arguments.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
