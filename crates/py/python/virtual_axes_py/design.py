"""Controller design on the prediction model of an axis: GPC, PID, pole placement, poles and stability margins.

model = design.model(machine, "x")
rst = design.gpc(model, n2=12, lambda_rel=0.1)
print(design.margins(model, rst).modulus)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ._native import PredictionModel, Rst
from .arguments import to_native, to_whole
from .machine import Machine

if TYPE_CHECKING:
    import control
    import numpy as np
    from numpy.typing import NDArray

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
    "poles",
    "rst",
    "to_control",
]


@dataclass(frozen=True)
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


@dataclass(frozen=True)
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


def frequency_response(
    machine: Machine, axis: str, control_loop: Literal["current", "velocity", "position", "contour"] = "position"
) -> FrequencyResponse:
    """Computes the frequency response of a control loop of an axis, as `virtual_axes bode` does.

    The plant has its deviation; friction, limits, feedforward and delays are left out. Raises `ValueError` for an
    unknown axis or loop, and for the position loop over unstable inner loops.
    """
    return FrequencyResponse(**to_native(machine).frequency_response(axis, control_loop))


def model(machine: Machine, axis: str) -> PredictionModel:
    """Computes the transfer function from Ω* to θ of an axis over one position cycle, `A(q⁻¹) θ = B(q⁻¹) Ω*`.

    Raises `ValueError` for an unknown axis or inner loops that are unstable.
    """
    return to_native(machine).prediction_model(axis)


def of_machine(machine: Machine, axis: str) -> Rst:
    """Returns the position controller of an axis as the machine file has it, in RST form."""
    return to_native(machine).controller(axis)


def rst(r: Sequence[float], s: Sequence[float], t: Sequence[float], t_first: int = 0) -> Rst:
    """Creates a controller `S Ω* = T θ* − R θ` from coefficients; `t_first` is the exponent of q of `t[0]`.

    Raises `ValueError` if T(1) ≠ R(1), R(1) = 0 or S(0) = 0.
    """
    return Rst(list(r), list(s), list(t), t_first)


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
    weight = lambda_rel if lambda_rel is not None else lambda_
    assert weight is not None
    n1, n2, nu = (to_whole(name, value, 0, 10**9) for name, value in (("n1", n1), ("n2", n2), ("nu", nu)))
    return model.gpc(n1, n2, nu, weight, lambda_rel is not None)


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
    return model.pid(gain, integral_time, derivative_time, filter_time, velocity_feedforward)


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
    return model.place_poles(list(poles), integrator, velocity_feedforward)


def margins(model: PredictionModel, rst: Rst) -> Margins:
    """Computes the stability margins; raises `ValueError` with the outermost pole if the loop is unstable."""
    return Margins(**model.margins(rst))


def poles(model: PredictionModel, rst: Rst) -> list[complex]:
    """Computes the poles of the closed loop in z."""
    return model.poles(rst)


def to_control(model: PredictionModel) -> control.TransferFunction:
    """Converts a prediction model to python-control: B / A in z with the period Tsp (needs `control`)."""
    import control

    numerator, denominator = _in_z(model.b, model.a)
    return control.TransferFunction(numerator, denominator, model.period)


def loop_transfer(model: PredictionModel, rst: Rst) -> control.TransferFunction:
    """Returns the open loop L = B R / (A S) for python-control (needs `control`)."""
    import control

    numerator, denominator = _in_z(rst.r, rst.s)
    return to_control(model) * control.TransferFunction(numerator, denominator, model.period)


def from_control(system: control.TransferFunction) -> PredictionModel:
    """Converts a discrete transfer function with one input and output from python-control.

    Raises `ValueError` for a continuous or an improper system.
    """
    if not (isinstance(system.dt, float | int) and not isinstance(system.dt, bool) and system.dt > 0):
        raise ValueError(f"the period of the system is {system.dt}; it must be discrete with a period above 0 s")
    numerator, denominator = [float(x) for x in system.num[0][0]], [float(x) for x in system.den[0][0]]
    delay = len(denominator) - len(numerator)
    if delay < 0:
        raise ValueError("the system has more zeros than poles")
    leading = denominator[0]
    b = [0.0] * delay + [value / leading for value in numerator]
    return PredictionModel([value / leading for value in denominator], b, float(system.dt))


def _in_z(numerator: list[float], denominator: list[float]) -> tuple[list[float], list[float]]:
    """Returns polynomials in q⁻¹ as polynomials in z of equal degree, highest power first."""
    degree = max(len(numerator), len(denominator))
    padded = [list(p) + [0.0] * (degree - len(p)) for p in (numerator, denominator)]
    return padded[0], padded[1]
