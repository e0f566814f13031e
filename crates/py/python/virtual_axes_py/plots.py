"""Plots of runs and of frequency responses (needs matplotlib)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._native import PartProgram

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from .design import FrequencyResponse
    from .run import Run

UNITS = {"m": ("mm", 1e3, "µm", 1e6), "rad": ("°", np.degrees(1), "m°", np.degrees(1e3))}
"""Unit and factor of positions and of errors, by the unit of an axis."""
MOST_LAG = 112
"""Position cycles that the tool tip may lag behind its setpoint."""


def _panels(titles: Sequence[str], given: Iterable[Axes] | None, shared: bool = True) -> list[Axes]:
    """Returns the axes of matplotlib for panels below each other: those given, or those of a new figure."""
    if given is None:
        figure = _figure((9, 1 + 2.2 * len(titles)))
        return [*np.atleast_1d(figure.subplots(len(titles), 1, sharex=shared))]
    panels = [_axes(one) for one in np.ravel(np.array([*given] if isinstance(given, Iterable) else [given], object))]
    if len(panels) != len(titles):
        raise ValueError(f"ax has {len(panels)} axes of matplotlib; {len(titles)} are drawn: {'; '.join(titles)}")
    return panels


def _axes(ax: Any) -> Axes:
    """Returns axes of matplotlib; raises `TypeError` for anything else."""
    from matplotlib.axes import Axes

    if not isinstance(ax, Axes):
        raise TypeError(f"ax is of type {type(ax).__name__}; it must be axes of matplotlib, as of plt.subplots()")
    return ax


def _figure(size: tuple[float, float]) -> Figure:
    """Creates a figure of pyplot; in a notebook one that is shown once, as the value of its cell."""
    try:
        import matplotlib
        from matplotlib import pyplot
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError("plots need matplotlib: pip install 'virtual_axes_py[plot]'") from error
    if "inline" in str(matplotlib.get_backend()).lower():
        return Figure(figsize=size, layout="constrained")
    return pyplot.figure(figsize=size, layout="constrained")


def _figure_of(ax: Axes) -> Figure:
    """Returns the figure of axes of matplotlib."""
    figure: Any = ax.get_figure()
    return figure  # type: ignore[no-any-return]


def plot(run: Run, axes: Sequence[str] | None, ax: Iterable[Axes] | None) -> Figure:
    """Draws a run over time, as `Run.plot` documents."""
    units = dict(zip(run.machine.axes, run.machine.units))
    moving = [name for name in run.machine.axes if run.figures["axes"][name]["moves"]]
    if axes is not None and not isinstance(axes, Iterable):
        raise TypeError(f"axes is {axes!r}; it must be a list of names")
    names = moving if axes is None else [axes] if isinstance(axes, str) else list(axes)
    if axes is not None and not names:
        raise ValueError(f"axes is empty; it needs one or more of {', '.join(run.machine.axes)}")
    signals = {name: run.axis(name) for name in names}
    missing = [name for name in ("psec", "position", "current") if name not in run.signals]
    if missing:
        raise ValueError(f"signal {missing[0]!r} is not recorded; recorded are {', '.join(run.signals)}")
    kinds = [unit for unit in UNITS if unit in {units[name] for name in names}]
    titles = [
        f"{what}, {UNITS[unit][place]}"
        for unit in kinds
        for what, place in (("setpoint and position", 0), ("following error", 2))
    ]
    panels = _panels([*titles, "motor current, A"], ax)
    for index, name in enumerate(names):
        place, (_, length, _, small) = 2 * kinds.index(units[name]), UNITS[units[name]]
        one = signals[name]
        color = f"C{index}"
        panels[place].plot(run.time, one["position"] * length, color=color, label=f"{name} position")
        panels[place].plot(run.time, one["psec"] * length, "--", color=color, label=f"{name} setpoint")
        panels[place + 1].plot(run.time, (one["psec"] - one["position"]) * small, color=color, label=name)
        panels[-1].plot(run.time, one["current"], color=color, label=name)
    for panel, title in zip(panels, [*titles, "motor current, A"]):
        panel.set_ylabel(title)
        panel.grid(alpha=0.3)
        if names:
            panel.legend(loc="upper right", fontsize="small")
    panels[-1].set_xlabel("time, s")
    return _figure_of(panels[0])


def _is_rapid(run: Run) -> NDArray[np.bool_]:
    """Returns True for each row with the tool tip at rapid traverse; False for all of a motion without feed."""
    if not isinstance(run.setpoints, PartProgram):
        return np.zeros(len(run.time), bool)
    is_rapid = run.setpoints.is_rapid(run.machine)
    cycles = np.floor(run.time / run.machine.position_period + 1e-6).astype(int)
    rows = np.searchsorted(cycles, np.arange(min(MOST_LAG, cycles[-1] + 1)))

    def deviation(lag: int) -> float:
        late, early = run.tool_path[rows[lag] :], run.tool_setpoint[: len(run.time) - rows[lag]]
        return float(np.mean((late - early) ** 2))

    lag = min(range(len(rows)), key=deviation)
    delayed = is_rapid[np.clip(cycles - lag, 0, len(is_rapid) - 1)]
    return np.zeros_like(delayed) if delayed.all() else delayed


def plot_path(run: Run, plane: str | None, ax: Axes | None) -> Figure:
    """Draws the path of the tool tip, as `Run.plot_path` documents."""
    missing = [name for name in ("tool_path", "tool_setpoint", "contour_error") if name not in run.tool]
    if missing:
        raise ValueError(
            f"signal {missing[0]!r} of the tool is not recorded; it needs figures 'all' or 'contour', and all signals"
        )
    is_cut = ~_is_rapid(run)
    # A segment per cycle with the kind of motion and the error at its end.
    is_drawn = is_cut | np.append(is_cut[1:], False)
    setpoint, path = (
        np.where(is_drawn[:, np.newaxis], one * 1e3, np.nan) for one in (run.tool_setpoint, run.tool_path)
    )
    if plane is None:
        extents = np.nanmax(setpoint, axis=0) - np.nanmin(setpoint, axis=0)
        longest = sorted(range(3), key=lambda index: (-round(float(extents[index]), 9), index))[:2]
        plane = "".join("xyz"[index] for index in sorted(longest))
    if plane not in ("xy", "yz", "xz"):
        raise ValueError(f"plane {plane!r}: must be xy, yz or xz")
    columns = ["xyz".index(axis) for axis in plane]
    panel = _figure((7, 6)).add_subplot() if ax is None else _axes(ax)
    from matplotlib.collections import LineCollection

    panel.plot(*setpoint[:, columns].T, "--", color="0.6", linewidth=1, label="setpoint")
    points = path[:, columns]
    segments = np.stack([points[:-1], points[1:]], axis=1)[is_cut[1:]]
    lines = LineCollection(list(segments), cmap="viridis", linewidth=2, label="tool tip")
    lines.set_array(run.contour_error[1:][is_cut[1:]] * 1e6)
    panel.add_collection(lines)
    panel.autoscale_view()
    if not is_cut.all():
        rapids = np.where(is_cut[:, np.newaxis], np.nan, run.tool_path * 1e3)[:, columns]
        panel.plot(*rapids.T, "--", color="0.4", linewidth=1, label="rapid traverse", scalex=False, scaley=False)
    panel.set_aspect("equal", adjustable="datalim")
    panel.set_xlabel(f"{plane[0].upper()}, mm")
    panel.set_ylabel(f"{plane[1].upper()}, mm")
    panel.grid(alpha=0.3)
    figure = _figure_of(panel)
    reference = " from the polyline of setpoints" if isinstance(run.setpoints, PartProgram) else ""
    figure.colorbar(lines, ax=panel, label=f"contour error{reference}, µm")
    return figure


def plot_polar(run: Run, ax: Axes | None) -> Figure:
    """Draws the circles of a run, as `Run.plot_polar` documents."""
    circles = [circle for circle in run.circles() if len(circle.angle)]
    if not circles:
        raise ValueError("the motion is no scenario with a circle at constant feed, as scenario('ballbar') is")
    if ax is not None and _axes(ax).name != "polar":
        raise ValueError(f"ax has the projection {ax.name!r}; it must be polar: plt.subplot(projection='polar')")
    panel: Any = _figure((7, 7)).add_subplot(projection="polar") if ax is None else ax
    from matplotlib.ticker import MaxNLocator

    low, high = 0.0, 0.0
    for circle in circles:
        way = "counterclockwise" if circle.counterclockwise else "clockwise"
        label = f"{''.join(circle.plane).upper()} {circle.radius * 1e3:.6g} mm, {way}"
        panel.plot(circle.angle, circle.deviation * 1e6, linewidth=1, label=label)
        low, high = min(low, float(circle.deviation.min()) * 1e6), max(high, float(circle.deviation.max()) * 1e6)
    span = max(high - low, 1e-3)
    panel.plot(np.linspace(0, 2 * np.pi, 361), np.zeros(361), "--", color="0.6", linewidth=1, label="nominal")
    panel.set_rlim(low - 0.1 * span, high + 0.1 * span)
    panel.set_rorigin(low - 2 * span)
    # The ring is narrow: the numbers of more circles would overlap.
    panel.set_rticks([tick for tick in MaxNLocator(4).tick_values(low, high) if low <= tick <= high])
    panel.set_title("radial deviation, µm")
    panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), fontsize="small")
    return _figure_of(panel)


def plot_bode(responses: Mapping[str, FrequencyResponse], ax: Iterable[Axes] | None) -> Figure:
    """Draws frequency responses by their labels: magnitude and phase of the open and the closed loops."""
    magnitude, phase = _panels(["magnitude, dB", "phase, °"], ax)
    for label, one in responses.items():
        (line,) = magnitude.semilogx(one.frequency_hz, one.closed_db, label=f"{label} closed")
        color = line.get_color()
        magnitude.semilogx(one.frequency_hz, one.open_db, "--", color=color, label=f"{label} open")
        phase.semilogx(one.frequency_hz, one.closed_deg, color=color, label=f"{label} closed")
        phase.semilogx(one.frequency_hz, one.open_deg, "--", color=color, label=f"{label} open")
    for panel, title in ((magnitude, "magnitude, dB"), (phase, "phase, °")):
        panel.set_ylabel(title)
        panel.grid(alpha=0.3, which="both")
    magnitude.legend(loc="lower left", fontsize="small")
    phase.set_xlabel("frequency, Hz")
    return _figure_of(magnitude)
