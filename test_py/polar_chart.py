"""Polar plots of the radial deviation, magnified as on a ballbar chart; needs no ROS."""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import FuncFormatter


@dataclass
class Circle:
    """Radial deviation of a circle over its polar angle, with mean and circular deviation G, in rad and µm."""

    angle: np.ndarray
    deviation: np.ndarray
    mean: float
    circular_deviation: float


def draw(circles: dict[str, Circle]) -> Figure:
    """Returns a figure with one plot per title."""
    figure, plots = plt.subplots(
        1, len(circles), figsize=(14.5, 6.2), subplot_kw={"projection": "polar"}, layout="constrained"
    )
    for plot, (title, circle) in zip(np.atleast_1d(plots), circles.items()):
        _draw(plot, title, circle)
    figure.legend(*plot.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=10, frameon=False)
    figure.suptitle(
        "Ballbar in X–Y at 15 m/min: radial deviation in µm over the polar angle, individual scales", fontsize=12
    )
    return figure


def _draw(plot: PolarAxes, title: str, circle: Circle) -> None:
    """Draws one circle."""
    turn = np.linspace(0, 2 * np.pi, 361)
    step = _round_step(np.abs(circle.deviation).max() / 2)
    # All lines are within the limits; clip paths and a background per plot would add a quarter to an SVG file.
    plot.patch.set_visible(False)
    # Black and one strong color, solid and dashed: readable in grayscale print.
    nominal = {"color": "black", "linewidth": 1.2, "linestyle": "--", "label": "programmed circle, R = 150 mm"}
    plot.plot(turn, np.zeros_like(turn), clip_on=False, **nominal)
    simulated = {"color": "#b2182b", "linewidth": 1.6, "label": "simulated position", "gid": title.replace(" ", "-")}
    plot.plot(circle.angle, circle.deviation, clip_on=False, **simulated)
    # The nominal circle has a radius of four grid steps, so that an inward deviation stays off the center.
    plot.set_rorigin(-6 * step)
    plot.set_rlim(-4 * step, 3 * step)
    plot.set_rticks([factor * step for factor in range(-3, 4)])
    plot.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:+g}" if value else "0"))
    # Vertical axis: most space for labels one above the other.
    plot.set_rlabel_position(80)
    for label in plot.get_yticklabels():
        label.set(fontsize=8, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5})
    plot.grid(color="0.8", linewidth=0.6, clip_on=False)
    plot.set_title(f"{title}\nmean {circle.mean:+.1f} µm, G = {circle.circular_deviation:.1f} µm", fontsize=11)


def _round_step(value: float) -> float:
    """Rounds up to 1, 2 or 5 times a power of ten."""
    power = 10 ** np.floor(np.log10(max(value, 1e-3)))
    return float(next(factor * power for factor in (1, 2, 5, 10) if factor * power >= value))
