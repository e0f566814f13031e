"""Search for parameters in which trials learn from each other, in batches that run as a sweep (needs optuna)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import design
from .arguments import to_native, to_whole, unknown
from .chunks import Setup, SweepResult, flat
from .machine import Machine
from .shards import setup_identity
from .study import planned, sweep

if TYPE_CHECKING:
    import optuna
    from distributed import Client

    from .machine import Setpoints

Bounds = tuple[float, float] | tuple[float, float, str]
"""Lowest and highest value, and `log` for a logarithmic scale."""
MARGINS = ("modulus", "phase", "gain", "gain_reduction", "delay")


@dataclass(frozen=True)
class Optimum:
    """Best variant of a search that fulfills all constraints."""

    changes: dict[str, Any]
    """Changed parameters."""
    value: float
    """Value of the objective."""
    machine: Machine
    """Machine with these parameters."""
    study: optuna.Study
    """All trials, for the plots and analyses of Optuna."""


def optimize(
    machine: Machine,
    motion: Setpoints,
    parameters: Mapping[str, Bounds],
    objective: str | Callable[[dict[str, Any]], float],
    *,
    constraints: Mapping[str, tuple[float | None, float | None]] | None = None,
    trials: int = 320,
    batch: int = 32,
    storage: str | Path | None = None,
    name: str = "study",
    seed: int | None = None,
    figures: str = "contour",
    executor: Client | None = None,
    threads: int | None = None,
) -> Optimum:
    """Searches for the parameters with the smallest objective on a motion, by Optuna's TPE (extra `optuna`).

    `parameters` have bounds `(low, high)`, or `(low, high, "log")`; those of whole numbers are whole. `objective` is
    the key of a figure, as `contour_error_um.max`, or a function of the figures. `constraints` are bounds
    `(low, high)`, of which one may be None, of figures and of the stability margins `margin.modulus`, `margin.phase`
    (rad), `margin.gain`, `margin.gain_reduction` and `margin.delay` (s), the smallest of the axes in `parameters`.

    The first trial is the machine as it is, if within the bounds. Each `batch` is asked for at once and simulated by
    `sweep`, with `figures`, `executor` and `threads`. `storage` is a journal file: processes with the same file and
    `name` share a study, whose `trials` are counted together (up to one batch per process more), and a later call
    continues it: machine, motion, figures, parameters with bounds, constraints and the key of the objective must be
    equal. The result is the best trial so far; other processes may still be at work.

    Raises `ValueError` for an unknown parameter, figure or margin, for a `storage` with another study of this name,
    naming what differs, or if no trial fulfills the constraints.
    """
    if trials < 1 or batch < 1:
        raise ValueError(f"trials {trials}, batch {batch}: must be at least 1")
    limits = dict(constraints or {})
    wrong = [key for key in limits if key.startswith("margin.") and key[7:] not in MARGINS]
    if wrong:
        raise ValueError(f"constraint {wrong[0]}: margins are {', '.join(MARGINS)}")
    to_native(machine)
    study = _open(storage, name, seed)
    known = machine.parameters
    missing = [key for key in parameters if key not in known]
    if missing:
        raise ValueError(unknown("parameter", missing[0], known))
    start = {key: known[key] for key in parameters}
    distributions = {key: _distribution(key, bounds, start[key]) for key, bounds in parameters.items()}
    if storage is not None:
        inputs = setup_identity(Setup(machine, planned(machine, motion), figures, 1))
        inputs["parameters"] = repr(sorted((key, tuple(bounds)) for key, bounds in parameters.items()))
        inputs["constraints"] = repr(sorted((key, tuple(bounds)) for key, bounds in limits.items()))
        if isinstance(objective, str):
            inputs["objective"] = objective
        _compare(study, inputs, storage)
    if all(bounds[0] <= start[key] <= bounds[1] for key, bounds in parameters.items()):
        study.enqueue_trial(start, skip_if_exists=True)
    axes = [axis for axis in machine.axes if any(key.startswith(f"{axis}.") for key in parameters)]
    needs_margins = any(key.startswith("margin.") for key in limits)
    while (count := min(batch, trials - _taken(study))) > 0:
        asked = [study.ask(distributions) for _ in range(count)]
        variants = [dict(trial.params) for trial in asked]
        chunk = _chunk(count, executor)
        results = sweep(
            machine, variants, motion, figures=figures, executor=executor, threads=threads, chunk=chunk, progress=False
        )
        for trial, result in zip(asked, results):
            margins = _margins(machine.with_(result.changes), axes) if needs_margins and not result.error else {}
            _tell(study, trial, result, objective, limits, margins)
    best = _best(study)
    return Optimum(best.params, float(best.values[0]), machine.with_(best.params), study)


def _open(storage: str | Path | None, name: str, seed: int | None) -> optuna.Study:
    """Creates or opens a study."""
    try:
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend
    except ImportError as error:
        raise ImportError("optimize needs Optuna: pip install 'virtual_axes_py[optuna]'") from error
    journal = None if storage is None else JournalStorage(JournalFileBackend(str(storage)))
    # The liar keeps the trials of a batch and of other processes apart, whose values are not known yet.
    sampler = optuna.samplers.TPESampler(seed=seed, constant_liar=True, n_startup_trials=32)
    return optuna.create_study(storage=journal, sampler=sampler, study_name=name, load_if_exists=journal is not None)


def _compare(study: optuna.Study, inputs: dict[str, str], storage: str | Path) -> None:
    """Stores the inputs of a study; raises `ValueError` if those of its earlier calls differ."""
    stored = study.user_attrs
    differing = [key for key, value in inputs.items() if stored.get(key, value) != value]
    if differing:
        raise ValueError(
            f"{storage} has another study {study.study_name!r}: {', '.join(differing)} differ; use another name or file"
        )
    for key, value in inputs.items():
        if key not in stored:
            study.set_user_attr(key, value)


def _chunk(count: int, executor: Client | None) -> int:
    """Returns the number of variants in a chunk, one chunk per thread of a cluster."""
    if executor is None:
        return count
    from . import cluster

    return -(-count // max(cluster.thread_count(executor), 1))


def _distribution(key: str, bounds: Bounds, start: Any) -> optuna.distributions.BaseDistribution:
    """Returns Optuna's form of the bounds of a parameter with the value `start`."""
    from optuna.distributions import FloatDistribution, IntDistribution

    low, high, *scale = bounds
    if not (math.isfinite(low) and math.isfinite(high) and low <= high) or scale not in ([], ["log"]):
        raise ValueError(f'{key}: bounds {bounds} must be finite, the lower one first, and may end with "log"')
    if scale and low <= 0:
        raise ValueError(f"{key}: bounds {bounds} must be above 0 on a logarithmic scale")
    if isinstance(start, bool) or not isinstance(start, int | float):
        raise ValueError(f"{key} is {start!r}; a search needs numbers")
    if isinstance(start, int):
        rounded = [int(bound) if float(bound).is_integer() else bound for bound in (low, high)]
        first, last = (to_whole(f"{key}, bound", bound, -(2**63), 2**63 - 1) for bound in rounded)
        return IntDistribution(first, last, log=bool(scale))
    return FloatDistribution(float(low), float(high), log=bool(scale))


def _taken(study: optuna.Study) -> int:
    """Returns the number of trials that are done or at work in any process."""
    from optuna.trial import TrialState

    return sum(trial.state != TrialState.WAITING for trial in study.get_trials(deepcopy=False))


def _margins(machine: Machine, axes: list[str]) -> dict[str, float]:
    """Returns the smallest stability margins of the axes; of gain reduction the factor nearest to 1."""
    found: dict[str, float] = {}
    for axis in axes:
        try:
            one = design.margins(design.model(machine, axis), design.of_machine(machine, axis))
        except ValueError:
            # An unstable loop, which allow_unstable permits.
            return {f"margin.{margin}": math.inf if margin == "gain_reduction" else 0.0 for margin in MARGINS}
        for margin in MARGINS:
            value, key = getattr(one, margin), f"margin.{margin}"
            found[key] = (max if margin == "gain_reduction" else min)(value, found.get(key, value))
    return found


def _tell(
    study: optuna.Study,
    trial: optuna.Trial,
    result: SweepResult,
    objective: str | Callable[[dict[str, Any]], float],
    limits: Mapping[str, tuple[float | None, float | None]],
    margins: dict[str, float],
) -> None:
    """Stores value and violations of a trial; a variant that cannot be simulated has failed."""
    from optuna.trial import TrialState

    if result.figures is None:
        trial.set_user_attr("error", result.error)
        study.tell(trial, state=TrialState.FAIL)
        return
    values = {**flat(result.figures), **margins}
    for key, (low, high) in limits.items():
        value = _figure(values, key)
        below = -math.inf if low is None else low - value
        above = -math.inf if high is None else value - high
        trial.set_constraint(key, max(below, above, -1e300))
    value = _figure(values, objective) if isinstance(objective, str) else float(objective(result.figures))
    study.tell(trial, value)


def _figure(values: Mapping[str, Any], key: str) -> float:
    """Returns a figure by its key."""
    if not isinstance(values.get(key), int | float):
        known = ", ".join(name for name, value in values.items() if isinstance(value, float))
        raise ValueError(f"figure {key} is unknown; known are {known}")
    return float(values[key])


def _best(study: optuna.Study) -> optuna.trial.FrozenTrial:
    """Returns the best trial that fulfills all constraints."""
    try:
        return study.best_trial
    except ValueError:
        count = _taken(study)
        raise ValueError(f"none of {count} trials can be simulated and fulfills the constraints") from None
