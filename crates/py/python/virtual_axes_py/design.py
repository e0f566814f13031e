"""Controller design on the prediction model of an axis: GPC, PID, pole placement, poles and stability margins.

model = design.model(machine, "x")
rst = design.gpc(model, n2=12, lambda_rel=0.1)
print(design.margins(model, rst).modulus)
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Complex
from typing import TYPE_CHECKING, Any, Literal

from ._native import PredictionModel, Rst
from .arguments import to_list, to_native, to_real, to_text, to_whole
from .machine import Machine

if TYPE_CHECKING:
    import control
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    ControlLoop = Literal["current", "velocity", "position", "contour"]

__all__ = [
    "FrequencyResponse",
    "Margins",
    "PredictionModel",
    "Rst",
    "frequency_response",
    "from_control",
    "gpc",
    "loop_transfer",
    "margins",
    "model",
    "of_machine",
    "pid",
    "place_poles",
    "plot_bode",
    "poles",
    "rst",
    "to_control",
]


@dataclass(frozen=True, repr=False)
class Margins:
    """Stability margins of a stable loop L = B R / (A S)."""

    modulus: float
    """Modulus margin min |1 + L|."""
    phase: float
    """Phase margin, rad; infinite without crossover."""
    gain: float
    """Gain margin upwards, a factor; infinite if there is none."""
    gain_reduction: float
    """Gain margin downwards, a factor below 1; 0 if there is none."""
    delay: float
    """Delay margin, s; infinite without crossover."""

    def __repr__(self) -> str:
        """Returns all margins with 6 digits."""
        return f"Margins({', '.join(f'{name}={value:.6g}' for name, value in vars(self).items())})"


@dataclass(frozen=True, repr=False, eq=False)
class FrequencyResponse:
    """Frequency response of a control loop, open and closed, as `virtual_axes bode --csv` writes it."""

    frequency_hz: NDArray[np.float64]
    """Frequencies up to the Nyquist frequency of the loop, Hz."""
    open_db: NDArray[np.float64]
    """Magnitude of the open loop, dB."""
    open_deg: NDArray[np.float64]
    """Phase of the open loop without jumps, °."""
    closed_db: NDArray[np.float64]
    """Magnitude of the closed loop from setpoint to actual value, dB."""
    closed_deg: NDArray[np.float64]
    """Phase of the closed loop without jumps, °."""

    def __repr__(self) -> str:
        """Returns the number and range of the frequencies."""
        low, high = self.frequency_hz[0], self.frequency_hz[-1]
        return f"FrequencyResponse({len(self.frequency_hz)} frequencies, {low:.6g} … {high:.6g} Hz)"

    def plot(self, *, ax: Iterable[Axes] | None = None) -> Figure:
        """Draws magnitude (dB) and phase (°) of both loops over the frequency (Hz); see `plot_bode`."""
        from . import plots

        return plots.plot_bode({"loop": self}, ax)


def frequency_response(machine: Machine, axis: str, control_loop: ControlLoop = "position") -> FrequencyResponse:
    """Computes the frequency response of a control loop of an axis, as `virtual_axes bode` does.

    The plant has its deviation; friction, limits, feedforward and delays are left out. Raises `ValueError` for an
    unknown axis or loop, and for the position loop over unstable inner loops.
    """
    return FrequencyResponse(
        **to_native(machine).frequency_response(to_text("axis", axis), to_text("control_loop", control_loop))
    )


def plot_bode(
    machine: Machine,
    axes: str | Sequence[str] | None = None,
    control_loop: ControlLoop = "position",
    *,
    ax: Iterable[Axes] | None = None,
) -> Figure:
    """Draws magnitude (dB) and phase (°) of an open and closed control loop over the frequency (needs matplotlib).

    `axes` are the axes of the machine, by default all. `ax` are two axes of matplotlib to draw in; without them a
    figure of pyplot is created, which `plt.show()` shows. Returns the figure. Raises `ValueError` as
    `frequency_response`.
    """
    from . import plots

    names = machine.axes if axes is None else [axes] if isinstance(axes, str) else list(axes)
    if not names:
        raise ValueError(f"axes is empty; it needs one or more of {', '.join(machine.axes)}")
    return plots.plot_bode({name: frequency_response(machine, name, control_loop) for name in names}, ax)


def model(machine: Machine, axis: str) -> PredictionModel:
    """Computes the transfer function from Ω* to θ of an axis over one position cycle, `A(q⁻¹) θ = B(q⁻¹) Ω*`.

    Raises `ValueError` for an unknown axis or inner loops that are unstable.
    """
    return to_native(machine).prediction_model(to_text("axis", axis))


def of_machine(machine: Machine, axis: str) -> Rst:
    """Returns the position controller of an axis as the machine file has it, in RST form."""
    return to_native(machine).controller(to_text("axis", axis))


def rst(r: Sequence[float], s: Sequence[float], t: Sequence[float], t_first: int = 0) -> Rst:
    """Creates a controller `S Ω* = T θ* − R θ` from coefficients; `t_first` is the exponent of q of `t[0]`.

    Raises `ValueError` if T(1) ≠ R(1), R(1) = 0 or S(0) = 0.
    """
    r, s, t = (to_list(name, values) for name, values in (("r", r), ("s", s), ("t", t)))
    return Rst(r, s, t, to_whole("t_first", t_first, -(10**9), 10**9))


def gpc(
    model: PredictionModel,
    n2: int,
    *,
    n1: int = 1,
    nu: int = 1,
    lambda_rel: float | None = None,
    lambda_: float | None = None,
) -> Rst:
    """Designs a generalized predictive controller (Prévost, section 5, eq. 9).

    `n1` and `n2` bound the prediction horizon and `nu` is the control horizon, position cycles. Exactly one weight of
    the control increments is given: `lambda_rel`, relative to trace(GᵀG), or `lambda_`, s². Raises `ValueError` with
    the name of a parameter out of range.
    """
    if (lambda_ is None) == (lambda_rel is None):
        raise ValueError("give either lambda_rel or lambda_")
    weight = to_real("lambda_", lambda_) if lambda_rel is None else to_real("lambda_rel", lambda_rel)
    n1, n2, nu = (to_whole(name, value, 0, 10**9) for name, value in (("n1", n1), ("n2", n2), ("nu", nu)))
    return _model(model).gpc(n1, n2, nu, weight, lambda_rel is not None)


def pid(
    model: PredictionModel,
    gain: float,
    *,
    integral_time: float = math.inf,
    derivative_time: float = 0.0,
    filter_time: float = 0.0,
    velocity_feedforward: float = 0.0,
) -> Rst:
    """Designs a P, PI or PID position controller: gain in s⁻¹, times in s.

    Without integral and derivative time it is proportional. Raises `ValueError` with the name of a parameter out of
    range.
    """
    values = {
        "gain": gain,
        "integral_time": integral_time,
        "derivative_time": derivative_time,
        "filter_time": filter_time,
        "velocity_feedforward": velocity_feedforward,
    }
    return _model(model).pid(*(to_real(name, value) for name, value in values.items()))


def place_poles(
    model: PredictionModel,
    poles: Sequence[complex],
    *,
    integrator: bool = True,
    velocity_feedforward: float = 0.0,
) -> Rst:
    """Designs the controller of lowest degree with these poles in z; the remaining poles are at 0.

    Complex poles come with their conjugates. Raises `ValueError` for too many or unstable poles.
    """
    if not isinstance(poles, Iterable) or any(not isinstance(one, Complex) for one in poles):
        raise TypeError(f"poles is {poles!r}; it must be a list of numbers, as [0.5, 0.3]")
    if not isinstance(integrator, bool):
        raise TypeError(f"integrator is {integrator!r}; it must be True or False")
    feedforward = to_real("velocity_feedforward", velocity_feedforward)
    return _model(model).place_poles(list(poles), integrator, feedforward)


def margins(model: PredictionModel, rst: Rst) -> Margins:
    """Computes the stability margins; raises `ValueError` with the outermost pole if the loop is unstable."""
    return Margins(**_model(model).margins(_rst(rst)))


def poles(model: PredictionModel, rst: Rst) -> list[complex]:
    """Computes the poles of the closed loop in z."""
    return _model(model).poles(_rst(rst))


def to_control(model: PredictionModel) -> control.TransferFunction:
    """Converts a prediction model to python-control: B / A in z with the period Tsp (needs `control`)."""
    import control

    numerator, denominator = _in_z(_model(model).b, model.a)
    return control.TransferFunction(numerator, denominator, model.period)


def loop_transfer(model: PredictionModel, rst: Rst) -> control.TransferFunction:
    """Returns the open loop L = B R / (A S) for python-control (needs `control`)."""
    import control

    numerator, denominator = _in_z(_rst(rst).r, rst.s)
    return to_control(model) * control.TransferFunction(numerator, denominator, model.period)


def from_control(
    system: control.TransferFunction | control.StateSpace, *, period: float | None = None
) -> PredictionModel:
    """Converts a discrete system with one input and one output from python-control: `tf`, `zpk` or `ss`.

    `period` is the position cycle, s: that of a discrete system without a period of its own (`dt=True`), and otherwise
    compared with it. Raises `ValueError` for a continuous system, another period, several inputs or outputs, or more
    zeros than poles; `TypeError` for anything else.
    """
    import control

    if not isinstance(system, control.TransferFunction | control.StateSpace):
        text = "a TransferFunction or a StateSpace of python-control, as control.tf(numerator, denominator, period)"
        raise TypeError(f"system is of type {type(system).__name__}; it must be {text}")
    if (system.ninputs, system.noutputs) != (1, 1):
        found = f"{system.ninputs} inputs and {system.noutputs} outputs"
        raise ValueError(f"the system has {found}; it must have one of each: select them, as system[0, 0]")
    if isinstance(system, control.StateSpace):
        numerator, denominator = _of_states(system)
    else:
        numerator, denominator = ([float(x) for x in rows[0][0]] for rows in (system.num, system.den))
    found_period = _period(system.dt, period)
    numerator = _trimmed(numerator)
    delay = len(denominator) - len(numerator)
    if delay < 0:
        raise ValueError(f"the system has {len(numerator) - 1} zeros and {len(denominator) - 1} poles; at most as many")
    if delay == 0:
        raise ValueError(
            "the output follows the input at once; an axis has a delay of a cycle or more: multiply by 1/z"
        )
    leading = denominator[0]
    b = [0.0] * delay + [value / leading for value in numerator]
    return PredictionModel([value / leading for value in denominator], b, found_period)


def _model(model: Any) -> PredictionModel:
    """Returns a prediction model; raises `TypeError` for anything else."""
    if not isinstance(model, PredictionModel):
        found = type(model).__name__
        raise TypeError(f"model is of type {found}; it must be a PredictionModel, as design.model(machine, axis) is")
    return model


def _rst(rst: Any) -> Rst:
    """Returns a controller; raises `TypeError` for anything else."""
    if not isinstance(rst, Rst):
        raise TypeError(f"rst is of type {type(rst).__name__}; it must be an Rst, as design.rst(r, s, t) is")
    return rst


def _period(dt: float | bool | None, wanted: float | None) -> float:
    """Returns the period of a discrete system, s."""
    wanted = None if wanted is None else to_real("period", wanted)
    if wanted is not None and not (wanted > 0 and math.isfinite(wanted)):
        raise ValueError(f"period {wanted}: must be above 0 s and finite")
    if dt is True and wanted is not None:
        return wanted
    if isinstance(dt, bool) or dt is None or dt <= 0:
        remedy = "give period" if dt is True else "control.sample_system(system, period, 'zoh') samples it"
        raise ValueError(f"the period of the system is {dt}; it must be discrete with a period above 0 s: {remedy}")
    if wanted is not None and not math.isclose(dt, wanted, rel_tol=1e-9):
        raise ValueError(f"the period of the system is {dt:.6g} s; it must be {wanted:.6g} s, as of the machine")
    return float(dt)


def _of_states(system: control.StateSpace) -> tuple[list[float], list[float]]:
    """Returns numerator and denominator of a state space with one input and output, highest power first."""
    import numpy as np

    a, b, c, d = (np.asarray(matrix, dtype=np.float64) for matrix in (system.A, system.B, system.C, system.D))
    denominator = np.real(np.poly(a)) if len(a) else np.ones(1)
    # Impulse response D, CB, CAB, …: its product with the denominator is the numerator.
    impulse, state = [float(d[0, 0])], b
    for _ in range(len(a)):
        impulse.append(float((c @ state)[0, 0]))
        state = a @ state
    numerator = np.convolve(denominator, impulse)[: len(denominator)]
    return [float(x) for x in numerator], [float(x) for x in denominator]


def _trimmed(polynomial: list[float]) -> list[float]:
    """Returns a polynomial, highest power first, without leading zeros."""
    first = next((index for index, value in enumerate(polynomial) if value != 0), len(polynomial) - 1)
    return polynomial[first:]


def _in_z(numerator: list[float], denominator: list[float]) -> tuple[list[float], list[float]]:
    """Returns polynomials in q⁻¹ as polynomials in z of equal degree, highest power first."""
    degree = max(len(numerator), len(denominator))
    padded = [list(p) + [0.0] * (degree - len(p)) for p in (numerator, denominator)]
    return padded[0], padded[1]


def __dir__() -> list[str]:
    """Returns the public names, without those of imported modules."""
    return sorted({*__all__, "__doc__", "__file__", "__name__"})
