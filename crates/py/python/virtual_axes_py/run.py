"""Results of a simulation."""

from __future__ import annotations

import os
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from . import _native
    from .machine import Machine


@dataclass(frozen=True, eq=False)
class Run:
    """Signals and figures of a simulated motion.

    Arrays of signals have the shape (times, axes), with the axes in the order of `machine.axes`.
    """

    machine: Machine
    """Simulated machine."""
    time: NDArray[np.float64]
    """Times from the first setpoint, s, one per position cycle or tick."""
    signals: dict[str, NDArray[np.float64]]
    """Recorded signals by name (`SIGNALS`)."""
    figures: dict[str, Any]
    """Errors, currents and saturation, with the keys and units of `virtual_axes run --json`."""
    setpoint_count: int
    """Number of setpoints; later rows are the settling time."""
    setpoints: NDArray[np.float64] | _native.Scenario | _native.PartProgram
    """Setpoints as given: array (setpoints, axes), m or rad, scenario or part program."""

    def __getattr__(self, name: str) -> NDArray[np.float64]:
        """Returns a recorded signal, as `run.position`."""
        # Without a dictionary, as while it is unpickled, nothing is recorded.
        signals: dict[str, NDArray[np.float64]] = self.__dict__.get("signals", {})
        if name in signals:
            return signals[name]
        raise AttributeError(f"{name!r} is neither an attribute nor a recorded signal: {', '.join(signals)}")

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

    def axis(self, name: str) -> dict[str, NDArray[np.float64]]:
        """Returns the signals of one axis by name; raises `ValueError` for an unknown axis."""
        names = self.machine.axes
        if name not in names:
            raise ValueError(f"axis {name!r} is unknown; known are {', '.join(names)}")
        column = names.index(name)
        return {signal: values[:, column] for signal, values in self.signals.items()}

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a table with `time` as index and the columns `<axis>.<signal>` (needs pandas)."""
        import pandas

        columns = {
            f"{axis}.{signal}": values[:, index]
            for index, axis in enumerate(self.machine.axes)
            for signal, values in self.signals.items()
        }
        return pandas.DataFrame(columns, index=pandas.Index(self.time, name="time"))

    def to_mcap(self, path: str | os.PathLike[str]) -> None:
        """Writes an MCAP recording with the messages of the node, one of each topic per position cycle.

        It has the bytes of `virtual_axes run --trace`; the motion is simulated again. Raises `ValueError` for another
        extension than `.mcap`, `OSError` if the file cannot be written; the file is replaced atomically.
        """
        name = os.fspath(path)
        if not name.lower().endswith(".mcap"):
            raise ValueError(f"{name}: the file extension must be .mcap")
        self.machine.native.write_trace(self.setpoints, name)

    def plot(self, axes: list[str] | None = None) -> Figure:
        """Draws setpoint and position, following error and current over time (needs matplotlib).

        `axes` are the names of the axes to draw; by default those that move.
        """
        from matplotlib.figure import Figure

        moving = [name for name in self.machine.axes if self.figures["axes"][name]["moves"]]
        figure = Figure(figsize=(9, 7), layout="constrained")
        rows = figure.subplots(3, 1, sharex=True)
        units = dict(zip(self.machine.axes, self.machine.units))
        for name in axes if axes is not None else moving:
            signals = self.axis(name)
            rows[0].plot(self.time, signals["position"], label=f"{name}, {units[name]}")
            error = signals["psec"] - signals["position"]
            unit = "µm" if units[name] == "m" else "mdeg"
            rows[1].plot(self.time, error * (1e6 if unit == "µm" else np.degrees(1e3)), label=f"{name}, {unit}")
            rows[2].plot(self.time, signals["current"], label=f"{name}, A")
        for row, title in zip(rows, ("position", "following error", "motor current")):
            row.set_title(title, loc="left", fontsize="medium")
            row.legend(loc="upper right", fontsize="small")
            row.grid(alpha=0.3)
        rows[2].set_xlabel("time, s")
        return figure

    def report(self) -> str:
        """Returns the page of `virtual_axes run --report` as HTML: figures, and plots of path, errors and currents.

        The motion is simulated again. A page is self-contained: it has its script and loads nothing.
        """
        title, description = _title(self.setpoints)
        return self.machine.native.report(self.setpoints, title, description)

    def _repr_html_(self) -> str:
        """Returns the report for a notebook; the table of the axes if there is none, as for a removed part program."""
        try:
            page = self.report()
        except (ValueError, OSError):
            return self._table()
        style = "width: 100%; height: 48em; border: 0"
        return f'<iframe srcdoc="{escape(page)}" style="{style}" sandbox="allow-scripts"></iframe>'

    def _table(self) -> str:
        """Returns the table of the axes as HTML."""
        head = "<tr><th>axis</th><th>following error, max</th><th>RMS</th><th>peak current, A</th></tr>"
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{error['max']:.1f} {axis['unit']}</td><td>{error['rms']:.1f}</td>"
            f"<td>{axis['peak_current_a']:.2f}</td></tr>"
            for name, axis in self.figures["axes"].items()
            for error in (axis["following_error"],)
        )
        contour = self.figures["contour_error_um"]
        note = f"<p>contour error: max {contour['max']:.2f} µm, RMS {contour['rms']:.2f} µm</p>" if contour else ""
        return f"<table>{head}{rows}</table>{note}"


def _title(setpoints: Any) -> tuple[str, str]:
    """Returns title and description of setpoints."""
    name = getattr(setpoints, "name", None) or getattr(setpoints, "path", None)
    return (str(name), str(getattr(setpoints, "description", ""))) if name else (f"{len(setpoints)} setpoints", "")
