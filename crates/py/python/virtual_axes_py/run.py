"""Results of a simulation."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .arguments import Named, to_path, unknown

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from . import _native
    from .machine import Machine


@dataclass(frozen=True, eq=False)
class Circle:
    """Circle at constant feed with its radial deviations, as for a circular test (ISO 230-4)."""

    plane: tuple[str, str]
    """Axes of its plane."""
    radius: float
    """Nominal radius, m."""
    counterclockwise: bool
    """True if it turns from the first axis of the plane towards the second."""
    angle: NDArray[np.float64]
    """Angles about the nominal center at the current cycles, rad, continuous over several turns."""
    deviation: NDArray[np.float64]
    """Radial deviations at these angles, m, positive outside."""

    def __repr__(self) -> str:
        """Returns plane, radius, direction and number of points."""
        way = "counterclockwise" if self.counterclockwise else "clockwise"
        return f"Circle({''.join(self.plane)}, radius {self.radius * 1e3:.6g} mm, {way}, {len(self.angle)} points)"


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """Signals and figures of a simulated motion.

    Arrays of signals of the axes have the shape (times, axes), with the axes in the order of `machine.axes`; those of
    the tool (times,) or (times, 3). A signal that is not recorded raises `AttributeError`.
    """

    machine: Machine
    """Simulated machine."""
    time: NDArray[np.float64]
    """Times from the first setpoint, s, one per position cycle or tick."""
    signals: dict[str, NDArray[np.float64]]
    """Recorded signals of the axes by name (`SIGNALS`)."""
    figures: dict[str, Any]
    """Errors, currents and saturation, with the keys and units of `virtual_axes run --json`."""
    setpoint_count: int
    """Number of setpoints; later rows are the settling time."""
    setpoints: NDArray[np.float64] | _native.Scenario | _native.PartProgram
    """Setpoints as given: array (setpoints, axes), m or rad, scenario or part program."""
    tool: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    """Recorded signals of the tool by name (`TOOL_SIGNALS`)."""
    loads: NDArray[np.float64] | None = None
    """External loads, N or N·m: a row of all axes per position cycle, of which the last one holds; or None."""

    @property
    def psec(self) -> NDArray[np.float64]:
        """Position setpoints PSEC at the entrance of the position controller, m or rad."""
        return self._signal("psec")

    @property
    def delayed_psec(self) -> NDArray[np.float64]:
        """Position setpoints at the input of the position controller, delayed by α, m or rad."""
        return self._signal("delayed_psec")

    @property
    def position(self) -> NDArray[np.float64]:
        """Positions, m or rad."""
        return self._signal("position")

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Velocities, m/s or rad/s."""
        return self._signal("velocity")

    @property
    def current(self) -> NDArray[np.float64]:
        """Motor currents, A."""
        return self._signal("current")

    @property
    def current_setpoint(self) -> NDArray[np.float64]:
        """Setpoints of the current loop, A."""
        return self._signal("current_setpoint")

    @property
    def voltage(self) -> NDArray[np.float64]:
        """Motor voltages, V."""
        return self._signal("voltage")

    @property
    def velocity_setpoint(self) -> NDArray[np.float64]:
        """Velocity setpoints Ω* with their feedforward, rad/s of the motor (m/s of a linear motor)."""
        return self._signal("velocity_setpoint")

    @property
    def velocity_feedforward(self) -> NDArray[np.float64]:
        """Velocity feedforward, rad/s of the motor (m/s of a linear motor)."""
        return self._signal("velocity_feedforward")

    @property
    def torque_feedforward(self) -> NDArray[np.float64]:
        """Torque feedforward, N·m of the motor (N of a linear motor)."""
        return self._signal("torque_feedforward")

    @property
    def friction_current(self) -> NDArray[np.float64]:
        """Component of the current from friction, A."""
        return self._signal("friction_current")

    @property
    def gravity_current(self) -> NDArray[np.float64]:
        """Component of the current from gravity, A."""
        return self._signal("gravity_current")

    @property
    def load_current(self) -> NDArray[np.float64]:
        """Component of the current from the external load, A."""
        return self._signal("load_current")

    @property
    def effort(self) -> NDArray[np.float64]:
        """Forces and torques of the drive on the axis, N or N·m."""
        return self._signal("effort")

    @property
    def wind_up(self) -> NDArray[np.float64]:
        """Deflections of the transmission, motor − load at the axis, m or rad; 0 for a rigid one."""
        return self._signal("wind_up")

    @property
    def contour_error(self) -> NDArray[np.float64]:
        """Contour errors, (times,), m: distance of the tool tip from the path; the largest of each position cycle."""
        return self._of_tool("contour_error")

    @property
    def orientation_error(self) -> NDArray[np.float64]:
        """Orientation errors, (times,), rad; the largest of each position cycle. Only with rotary axes."""
        return self._of_tool("orientation_error")

    @property
    def tool_path(self) -> NDArray[np.float64]:
        """Positions of the tool tip in the workpiece frame, (times, 3), m."""
        return self._of_tool("tool_path")

    @property
    def tool_setpoint(self) -> NDArray[np.float64]:
        """Positions of the tool tip at the setpoints PSEC in the workpiece frame, (times, 3), m."""
        return self._of_tool("tool_setpoint")

    @property
    def feed(self) -> NDArray[np.float64]:
        """Speeds of the tool tip in the workpiece frame, (times,), m/s."""
        return self._of_tool("feed")

    @property
    def following_error(self) -> NDArray[np.float64]:
        """Following error `PSEC − position`, which contains the delay α, m or rad."""
        return self._difference("psec")

    @property
    def delay_compensated_following_error(self) -> NDArray[np.float64]:
        """Following error with the setpoint at the input of the position controller, m or rad."""
        return self._difference("delayed_psec")

    def _difference(self, setpoint: str) -> NDArray[np.float64]:
        """Returns a setpoint less the position; raises `ValueError` unless both are recorded."""
        missing = [name for name in (setpoint, "position") if name not in self.signals]
        if missing:
            raise ValueError(f"signal {missing[0]!r} is not recorded; recorded are {', '.join(self.signals)}")
        return self.signals[setpoint] - self.signals["position"]

    def _signal(self, name: str) -> NDArray[np.float64]:
        """Returns a signal of the axes."""
        if name in self.signals:
            return self.signals[name]
        raise AttributeError(f"signal {name!r} is not recorded; recorded are {', '.join(self.signals) or 'none'}")

    def _of_tool(self, name: str) -> NDArray[np.float64]:
        """Returns a signal of the tool."""
        if name in self.tool:
            return self.tool[name]
        remedy = "figures='contour' and no selection of signals record it, unless the machine has no axes of this kind"
        raise AttributeError(f"signal {name!r} of the tool is not recorded; {remedy}")

    def axis(self, name: str) -> dict[str, NDArray[np.float64]]:
        """Returns the signals of one axis by name; raises `ValueError` for an unknown axis."""
        names = self.machine.axes
        if name not in names:
            raise ValueError(unknown("axis", name, names))
        column = names.index(name)
        return Named((signal, values[:, column]) for signal, values in self.signals.items())

    def circles(self) -> list[Circle]:
        """Returns the circles of a scenario, of which the first 8 have points. The motion is simulated again."""
        found = self.machine.native.circles(self.setpoints, self.loads)
        return [Circle(**{**one, "plane": tuple(one["plane"])}) for one in found]

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a table with `time` as index and the columns `<axis>.<signal>` (needs pandas).

        Signals of the tool have the columns `contour_error`, `orientation_error`, `feed`, `tool_path.x`, `.y`, `.z`.
        """
        import pandas

        columns = {
            f"{axis}.{signal}": values[:, index]
            for index, axis in enumerate(self.machine.axes)
            for signal, values in self.signals.items()
        }
        for name, values in self.tool.items():
            of_name = {name: values} if values.ndim == 1 else {f"{name}.{c}": values[:, i] for i, c in enumerate("xyz")}
            columns.update(of_name)
        return pandas.DataFrame(columns, index=pandas.Index(self.time, name="time"))

    def to_mcap(self, path: str | os.PathLike[str]) -> None:
        """Writes an MCAP recording with the messages of the node, one of each topic per position cycle.

        It has the bytes of `virtual_axes run --trace`; the motion is simulated again. Raises `ValueError` for another
        extension than `.mcap`, `OSError` if the file cannot be written; the file is replaced atomically.
        """
        name = to_path("path", path)
        if not name.lower().endswith(".mcap"):
            raise ValueError(f"{name}: the file extension must be .mcap")
        self.machine.native.write_trace(self.setpoints, self.loads, name)

    def plot(self, axes: Sequence[str] | None = None, *, ax: Iterable[Axes] | None = None) -> Figure:
        """Draws setpoint and position, following error and current over time; returns the figure (needs matplotlib).

        `axes` are the names of the machine's axes to draw; by default those that move. `ax` are the axes of matplotlib
        to draw in, one per panel: position and following error of linear axes (mm, µm), those of rotary axes (°, m°),
        as far as they are drawn, and current (A). Without them a figure of pyplot is created, which `plt.show()` shows.
        Raises `ValueError` for an unknown axis or another number of panels.
        """
        from . import plots

        return plots.plot(self, axes, ax)

    def plot_path(self, plane: str | None = None, *, ax: Axes | None = None) -> Figure:
        """Draws the path of the tool tip in the workpiece frame, mm, colored by the contour error (needs matplotlib).

        `plane` is `xy`, `yz` or `xz`, by default that of the longest extents. Of a part program, which is planned
        again, rapid traverse is dashed, and plane, limits and colors are those of the motions at feed. Returns the
        figure, that of `ax` if it is given. Raises `ValueError` for another plane, or if the signals of the tool are
        not recorded.
        """
        from . import plots

        return plots.plot_path(self, plane, ax)

    def plot_polar(self, *, ax: Axes | None = None) -> Figure:
        """Draws the radial deviations of the circles over their angle, µm, as for a circular test (needs matplotlib).

        Returns the figure, that of `ax` if it is given, which must be polar. Raises `ValueError` for a motion without
        circles at constant feed. The motion is simulated again.
        """
        from . import plots

        return plots.plot_polar(self, ax)

    def report(self) -> str:
        """Returns the page of `virtual_axes run --report` as HTML: figures, and plots of path, errors and currents.

        The motion is simulated again. A page is self-contained: it has its script and loads nothing.
        """
        title, description = _title(self.setpoints)
        return self.machine.native.report(self.setpoints, self.loads, title, description)

    def __repr__(self) -> str:
        """Returns machine, moving axes, duration and largest contour error in one line."""
        moving = [name for name, axis in self.figures["axes"].items() if axis["moves"]]
        parts = [self.machine.name, f"{', '.join(moving) or 'no axis'} moving", f"{self.figures['duration_s']:.6g} s"]
        if contour := self._contour_error():
            parts.append(f"contour error {contour['max']:.6g} µm")
        return f"Run({'; '.join(parts)})"

    def _contour_error(self) -> dict[str, float] | None:
        """Returns the contour error, µm: of a part program that of the motions at feed from the programmed path."""
        if part := self.figures.get("part_program"):
            errors = part["contour_error_um"]
            return errors["cuts"] or errors["rapids"]  # type: ignore[no-any-return]
        return self.figures["contour_error_um"]  # type: ignore[no-any-return]

    def _repr_html_(self) -> str:
        """Returns the report for a notebook; the table of the axes if there is none, as for a removed part program."""
        try:
            page = self.report()
        except (ValueError, OSError):
            return self._table()
        return embedded_page(page)

    def _table(self) -> str:
        """Returns the table of the axes as HTML."""
        head = "<tr><th>axis</th><th>following error, max</th><th>RMS</th><th>peak current, A</th></tr>"
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{error['max']:.1f} {axis['unit']}</td><td>{error['rms']:.1f}</td>"
            f"<td>{axis['peak_current_a']:.2f}</td></tr>"
            for name, axis in self.figures["axes"].items()
            for error in (axis["following_error"],)
        )
        contour = self._contour_error()
        note = f"<p>contour error: max {contour['max']:.2f} µm, RMS {contour['rms']:.2f} µm</p>" if contour else ""
        return f"<table>{head}{rows}</table>{note}"


def embedded_page(page: str) -> str:
    """Returns a page as an element of a notebook."""
    style = "width: 100%; height: 48em; border: 0"
    return f'<iframe srcdoc="{escape(page)}" style="{style}" sandbox="allow-scripts"></iframe>'


def _title(setpoints: Any) -> tuple[str, str]:
    """Returns title and description of setpoints."""
    name = getattr(setpoints, "name", None) or getattr(setpoints, "path", None)
    return (str(name), str(getattr(setpoints, "description", ""))) if name else (f"{len(setpoints)} setpoints", "")
