"""Sweeps: one motion on many variants of a machine."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .machine import Machine

if TYPE_CHECKING:
    import pandas

    from .machine import Parameter, Setpoints


@dataclass(frozen=True)
class SweepResult:
    """Result of one variant."""

    changes: dict[str, Any]
    """Changed parameters."""
    figures: dict[str, Any] | None
    """Figures with the keys of `virtual_axes run --json`; none if the variant failed."""
    error: str | None
    """Reason of a failure, as an invalid parameter or an unstable loop."""


class SweepResults(Sequence[SweepResult]):
    """Results of a sweep, in the order of its variants."""

    def __init__(self, results: list[SweepResult]) -> None:
        """Stores the results."""
        self._results = results

    def __len__(self) -> int:
        """Returns the number of variants."""
        return len(self._results)

    def __getitem__(self, index: Any) -> Any:
        """Returns one result or a list of a slice."""
        return self._results[index]

    def __iter__(self) -> Iterator[SweepResult]:
        """Iterates over the results."""
        return iter(self._results)

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a row per variant: parameters, figures as `axes.x.peak_current_a`, `error` (needs pandas)."""
        import pandas

        rows = [{**one.changes, **_flat(one.figures or {}), "error": one.error} for one in self._results]
        return pandas.DataFrame(rows)


def _flat(figures: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Returns nested figures with joined keys, without lists."""
    found: dict[str, Any] = {}
    for key, value in figures.items():
        if isinstance(value, Mapping):
            found.update(_flat(value, f"{prefix}{key}."))
        elif not isinstance(value, list):
            found[f"{prefix}{key}"] = value
    return found


def sweep(
    machine: Machine,
    variants: Sequence[Mapping[str, Parameter]],
    psec: Setpoints,
    *,
    figures: str = "axes",
    threads: int | None = None,
) -> SweepResults:
    """Simulates the same setpoints on each variant of a machine and returns their figures, in order.

    `variants` are dictionaries of changed parameters, as for `Machine.with_`. `psec` and `figures` are those of
    `Machine.simulate`. Variants with equal delays run side by side as vector lanes, on all processors or `threads` of
    them; the result does not depend on either. A variant that cannot be simulated has an `error` in place of figures.

    Raises `TypeError` for a parameter of another kind, `ValueError` for invalid setpoints.
    """
    if threads is not None and threads < 1:
        raise ValueError(f"threads {threads}: must be at least 1")
    # Setpoints are planned on the machine as it is, once.
    count = threads or len(os.sched_getaffinity(0))
    given = [dict(variant) for variant in variants]
    rows = machine.native.sweep(given, machine._setpoints(psec), figures, count)
    results = [
        SweepResult(changes, None if text is None else json.loads(text), error)
        for changes, (text, error) in zip(given, rows)
    ]
    return SweepResults(results)
