"""Tuning of controllers for a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from . import _native
from .arguments import named_errors, read_json, to_native, to_real, to_text, to_whole
from .machine import Machine

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from .machine import Setpoints


@dataclass(frozen=True, eq=False)
class TuningResult:
    """Best tuning of a search, and all tunings of its Pareto front."""

    machine: Machine
    """Machine with the best tuning."""
    summary: dict[str, Any]
    """All results with the keys and units of `virtual_axes tune --json`."""

    @property
    def cost(self) -> float:
        """Cost of the best tuning, in `summary["cost_unit"]`."""
        return float(self.summary["best"]["cost"])

    @property
    def initial_cost(self) -> float:
        """Cost of the initial tuning, in `summary["cost_unit"]`."""
        return float(self.summary["present"]["cost"])

    @property
    def pareto(self) -> list[dict[str, Any]]:
        """Tunings with the least cost for their modulus margin, with cost and margins; empty for a contrast."""
        return list(self.summary.get("pareto", []))

    def __repr__(self) -> str:
        """Returns initial and best cost."""
        return f"TuningResult(cost {self.initial_cost:.6g} → {self.cost:.6g} {self.summary['cost_unit']})"


def tune(
    machine: Machine,
    psec: Setpoints,
    *,
    controller: Literal["gpc", "cascade", "contour"] | None = None,
    cost: str = "contour",
    modulus_margin: float | None = None,
    delay_margin_ms: float | None = None,
    seed: int | None = None,
    designs: int | None = None,
    also: Setpoints | Sequence[Setpoints] = (),
    contrast: bool = False,
) -> TuningResult:
    """Searches the tuning of the position controllers with the least cost on a path, as `virtual_axes tune` does.

    `psec` is the path, as for `Machine.simulate`; its axes that move are tuned. `controller` is `gpc` (N1, N2, Nu, λ)
    or `cascade` (Kp and feedforward weights), by default that of the machine, or `contour` (the gain of cross-coupled
    control, with the position controllers as they are). `cost` is a weighted sum such as
    `contour=1,activity=0.1` of `contour`, `contour-rms`, `following`, `rms`, `current`, `activity`. Tunings keep
    `modulus_margin` (default 0.5) and `delay_margin_ms` (default 5) on all axes and reach no limit. `seed` (default 1)
    is for the cascade, `designs` the least number of predictive controllers in the first grid. The best tuning is
    evaluated on the paths `also` as well; with `contrast`, the search is for predictive controllers that are better
    on `psec` and worse on the only path of `also`.

    Raises `ValueError` with the command's text if an option is out of range or no tuning is within the margins.
    Releases the global interpreter lock and uses all cores.
    """
    native = to_native(machine)
    chosen = controller if controller is not None else _controller(machine)
    also = also if isinstance(also, list | tuple) else [also]
    if contrast and (chosen != "gpc" or len(also) != 1):
        raise ValueError("contrast requires controller gpc and exactly one path in also")
    if designs is not None and (contrast or chosen != "gpc"):
        raise ValueError("designs requires controller gpc without contrast")
    if seed is not None and chosen != "cascade":
        raise ValueError("seed requires controller cascade; the other searches have no seed")
    options = {
        "controller": chosen,
        "contrast": contrast,
        "cost": to_text("cost", cost),
        "modulus_margin": modulus_margin,
        "delay_margin_ms": delay_margin_ms,
        "seed": 1 if seed is None else to_whole("seed", seed, 0, 2**64 - 1),
        "designs": None if designs is None else to_whole("designs", designs, 1, 1_000_000),
    }
    paths = [named_path(machine, psec, "path 1")]
    paths += [named_path(machine, one, f"path {index + 2}", "also") for index, one in enumerate(also)]
    with named_errors(options):
        text, tuned = _native.tune(native, paths[0], paths[1:], options)
    return TuningResult(Machine(tuned), read_json(text))


@dataclass(frozen=True, eq=False)
class RobustnessResult:
    """Cost and margins of a machine as it is, and on plants that deviate from it."""

    summary: dict[str, Any]
    """All results with the keys and units of `virtual_axes robustness --json`."""

    @property
    def nominal_cost(self) -> float:
        """Cost without deviation, in `summary["cost_unit"]`."""
        return float(self.summary["nominal"]["cost"])

    @property
    def worst_cost(self) -> float:
        """Cost of the worst combination of deviations, in `summary["cost_unit"]`."""
        return float(self.summary["worst_combination"]["cost"])

    def __repr__(self) -> str:
        """Returns the costs without deviation and at worst."""
        costs = f"{self.nominal_cost:.6g} nominal, {self.worst_cost:.6g} at worst"
        return f"RobustnessResult(cost {', '.join(filter(None, [costs, self.summary['cost_unit']]))})"


def robustness(machine: Machine, psec: Setpoints, *, by: float = 0.3, cost: str = "contour") -> RobustnessResult:
    """Simulates a path on plants with other inertia, friction and torque constant, as `virtual_axes robustness` does.

    `psec` is the path, as for `Machine.simulate`, `by` the relative deviation, 0 … 0.8, and `cost` that of `tune`.
    Raises `ValueError` with the command's text for an option out of range. Releases the global interpreter lock.
    """
    native, path = to_native(machine), named_path(machine, psec, "path 1")
    return RobustnessResult(read_json(_native.robustness(native, path, to_real("by", by), to_text("cost", cost))))


@dataclass(frozen=True, eq=False)
class LearningResult:
    """Setpoints that compensate the repeatable errors of a motion."""

    psec: NDArray[np.float64]
    """Setpoints of the best run, (setpoints, axes), m or rad."""
    summary: dict[str, Any]
    """All results with the keys and units of `virtual_axes learn --json`."""

    @property
    def iterations(self) -> list[dict[str, Any]]:
        """Runs in order, that of the programmed setpoints first: `figures`, and errors of the `learning_axes`."""
        return list(self.summary["iterations"])

    @property
    def best(self) -> int:
        """Index of the run with the smallest error."""
        return int(self.summary["best"])

    def __repr__(self) -> str:
        """Returns the numbers of the best iteration and of all."""
        return f"LearningResult(iteration {self.best} of {len(self.iterations) - 1} is the best)"


def learn(
    machine: Machine,
    psec: Setpoints,
    *,
    iterations: int = 8,
    bandwidth_hz: float | None = None,
    gain: float = 0.5,
    encoder_step_um: float = 1.0,
    acceleration_excess: float = 0.5,
) -> LearningResult:
    """Learns setpoints that compensate the repeatable errors of a path, as `virtual_axes learn` does.

    `psec` is the path, as for `Machine.simulate`. `iterations` runs follow that of the programmed setpoints. `gain` is
    the part of the error that an iteration compensates, above 0 and at most 2, `bandwidth_hz` that of the low-pass
    filter Q, by default the highest one that converges for all plants. `encoder_step_um` rounds the measured positions,
    µm or µrad, and `acceleration_excess` is the acceleration beyond the limit of an axis, relative to it.

    Raises `ValueError` with the command's text for an option out of range, or if no axis moves. Releases the global
    interpreter lock.
    """
    gain, encoder_step_um = to_real("gain", gain), to_real("encoder_step_um", encoder_step_um)
    acceleration_excess = to_real("acceleration_excess", acceleration_excess)
    if not 0 < gain <= 2:
        raise ValueError(f"gain {gain}: must be above 0 and at most 2")
    if not 0 <= encoder_step_um <= 1000:
        raise ValueError(f"encoder_step_um {encoder_step_um}: must be in 0 … 1000")
    if not 0 <= acceleration_excess <= 10:
        raise ValueError(f"acceleration_excess {acceleration_excess}: must be in 0 … 10")
    options = {
        "iterations": to_whole("iterations", iterations, 1, 1000),
        "bandwidth_hz": bandwidth_hz,
        "gain": gain,
        "encoder_step_um": encoder_step_um,
        "acceleration_excess": acceleration_excess,
    }
    native = to_native(machine)
    with named_errors(options):
        text, compensated = _native.learn(native, named_path(machine, psec, "path 1"), options)
    return LearningResult(compensated, read_json(text))


def named_path(machine: Machine, psec: Setpoints, name: str, argument: str = "psec") -> tuple[str, str, Any]:
    """Returns setpoints of an argument with their name and description."""
    if isinstance(psec, _native.Scenario):
        return psec.name, psec.description, psec
    if isinstance(psec, _native.PartProgram):
        return psec.path, "", psec
    return name, "", machine.named_setpoints(argument, psec)


def _controller(machine: Machine) -> str:
    """Returns the controller of all axes if it can be tuned."""
    parameters: Mapping[str, Any] = machine.parameters
    names = {str(parameters[f"{axis}.position_loop.controller"]) for axis in machine.axes}
    if len(names) == 1 and names <= {"gpc", "cascade"}:
        return names.pop()
    found = " and ".join(sorted(names))
    raise ValueError(f"controller: must be gpc or cascade; the machine has {found}, which cannot be tuned")
