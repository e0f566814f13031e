"""Polar plot of radial deviations, magnified as on a ballbar chart; needs no ROS."""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

COLORS = ("#2166ac", "#d95f02", "#1b7837")
"""Colors of the circles: distinct for color-blind readers and in grayscale print."""


@dataclass
class Circle:
    """Radial deviation of a circle over its polar angle, with mean and circular deviation G, in rad and µm."""

    angle: np.ndarray
    deviation: np.ndarray
    mean: float
    circular_deviation: float


def draw(circles: dict[str, Circle]) -> Figure:
    """Returns a figure with the circles by their titles, all on one scale."""
    figure = plt.figure(figsize=(9.5, 6.6), layout="constrained")
    plot = figure.add_subplot(projection="polar")
    turn = np.linspace(0, 2 * np.pi, 361)
    step = _round_step(max(np.abs(circle.deviation).max() for circle in circles.values()) / 3)
    # All lines are within the limits; a clip path and a background would add to an SVG file.
    plot.patch.set_visible(False)
    nominal = {"color": "black", "linewidth": 1.2, "linestyle": "--", "label": "programmed circle, R = 150 mm"}
    plot.plot(turn, np.zeros_like(turn), clip_on=False, zorder=3, **nominal)
    for color, (title, circle) in zip(COLORS, circles.items()):
        label = f"{title}\nmean {circle.mean:+.1f} µm, G = {circle.circular_deviation:.1f} µm".replace("-", "−")
        simulated = {"color": color, "linewidth": 1.6, "label": label, "gid": title.replace(" ", "-")}
        plot.plot(circle.angle, circle.deviation, clip_on=False, **simulated)
    # An inward deviation stays off the center.
    plot.set_rorigin(-6 * step)
    plot.set_rlim(-4 * step, 2 * step)
    plot.set_rticks([factor * step for factor in range(-3, 3)])
    plot.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:+g}".replace("-", "−") if value else "0"))
    # Between two grid lines of the angle, where the labels cover no reversal.
    plot.set_rlabel_position(67.5)
    for label in plot.get_yticklabels():
        label.set(fontsize=9, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5})
    plot.grid(color="0.8", linewidth=0.6, clip_on=False)
    figure.legend(*plot.get_legend_handles_labels(), loc="outside right center", fontsize=10, frameon=False)
    figure.suptitle("Ballbar in X–Y at 15 m/min: radial deviation in µm over the polar angle", fontsize=12)
    return figure


def _round_step(value: float) -> float:
    """Rounds up to 1, 2 or 5 times a power of ten."""
    power = 10 ** np.floor(np.log10(max(value, 1e-3)))
    return float(next(factor * power for factor in (1, 2, 5, 10) if factor * power >= value))
