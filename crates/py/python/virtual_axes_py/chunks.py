"""Chunks of a sweep: simulation, conversion to tables, and execution in this process."""

from __future__ import annotations

import reprlib
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any

from . import _native
from .arguments import read_json
from .machine import Machine

if TYPE_CHECKING:
    import numpy as np
    import pyarrow
    from distributed import Client
    from numpy.typing import NDArray

Part = tuple[int, int]
"""Index of the first variant of a chunk, and the index after its last one."""
Outcome = tuple[str | None, str | None]
"""Figures as JSON, or the reason of a failure."""
Variants = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, repr=False)
class SweepResult:
    """Result of one variant."""

    changes: dict[str, Any]
    """Changed parameters."""
    figures: dict[str, Any] | None
    """Figures with the keys of `virtual_axes run --json`; none if the variant failed."""
    error: str | None
    """Reason of a failure, as an invalid parameter or an unstable loop."""

    @staticmethod
    def of(changes: Mapping[str, Any], outcome: Outcome) -> SweepResult:
        """Creates the result of an outcome."""
        text, error = outcome
        return SweepResult(dict(changes), None if text is None else read_json(text), error)

    def __repr__(self) -> str:
        """Returns the changes, and the error of a variant that failed."""
        parts = [self.changes] if self.error is None else [self.changes, self.error]
        return f"SweepResult({', '.join(map(reprlib.repr, parts))})"

    def row(self) -> dict[str, Any]:
        """Returns parameters, figures with joined keys as `axes.x.peak_current_a`, and `error`."""
        return {**self.changes, **flat(self.figures or {}), "error": self.error}


def flat(figures: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Returns nested figures with joined keys, without lists."""
    found: dict[str, Any] = {}
    for key, value in figures.items():
        if isinstance(value, Mapping):
            found.update(flat(value, f"{prefix}{key}."))
        elif not isinstance(value, list):
            found[f"{prefix}{key}"] = value
    return found


@dataclass(frozen=True)
class Setup:
    """Inputs that all chunks of a sweep share."""

    machine: Machine
    """Machine that the variants change."""
    psec: NDArray[np.float64] | _native.Scenario | _native.PartProgram
    """Setpoints; those of a scenario or part program are planned on the machine as it is."""
    figures: str
    """Choice of figures."""
    threads: int
    """Threads of a chunk."""


Produce = Callable[[Setup, int, Variants], Any]
"""Function that simulates the variants of a chunk; the number is the index of the first one."""


def simulate(setup: Setup, first: int, variants: Variants) -> list[Outcome]:
    """Simulates the variants of a chunk."""
    given = [dict(variant) for variant in variants]
    return setup.machine.native.sweep(given, setup.psec, setup.figures, setup.threads)


def simulate_to_parquet(setup: Setup, first: int, variants: Variants) -> bytes:
    """Simulates the variants of a chunk; returns the content of a Parquet file."""
    pa, parquet = load_pyarrow()
    given = [dict(variant) for variant in variants]
    results = (SweepResult.of(*one) for one in zip(given, simulate(setup, first, given)))
    rows = [{"row": first + index, **result.row()} for index, result in enumerate(results)]
    sink = pa.BufferOutputStream()
    parquet.write_table(table_of(pa, rows), sink, compression="zstd")
    content: bytes = sink.getvalue().to_pybytes()
    return content


def table_of(pa: Any, rows: list[dict[str, Any]]) -> pyarrow.Table:
    """Returns a table of rows, which may have different columns."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    names.sort(key="error".__eq__)
    columns = {name: pa.array([row.get(name) for row in rows]) for name in names}
    columns["error"] = columns["error"].cast(pa.string())
    return pa.table(columns)


def load_pyarrow() -> tuple[Any, Any]:
    """Returns the modules `pyarrow` and `pyarrow.parquet`."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise ImportError("Parquet files need pyarrow: pip install 'virtual_axes_py[parquet]'") from error
    return pyarrow, parquet


def run(
    produce: Produce, setup: Setup, variants: Variants, parts: Sequence[Part], executor: Client | None
) -> Iterator[tuple[Part, Any]]:
    """Yields the result of each chunk, as it is complete."""
    if executor is not None:
        from . import cluster

        yield from cluster.run(executor, produce, setup, variants, parts)
        return
    for first, end in parts:
        yield (first, end), produce(setup, first, variants[first:end])


class Progress:
    """Progress on stderr: variants done, of all, per second."""

    def __init__(self, total: int, is_shown: bool | None) -> None:
        """Starts at 0 of `total`; by default shown if stderr is a terminal."""
        self._total, self._done = total, 0
        self._is_shown = sys.stderr.isatty() if is_shown is None else is_shown
        self._start = self._last = time.monotonic()

    def __enter__(self) -> Progress:
        """Returns itself."""
        return self

    def add(self, count: int) -> None:
        """Adds variants that are done."""
        self._done += count
        now = time.monotonic()
        if self._is_shown and (now - self._last > 0.2 or self._done == self._total):
            self._last = now
            rate = self._done / max(now - self._start, 1e-9)
            print(f"\r{self._done} of {self._total} variants, {rate:.0f}/s ", end="", file=sys.stderr, flush=True)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Ends the line."""
        if self._is_shown and self._done:
            print(file=sys.stderr)
