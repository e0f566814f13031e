"""Sweeps: one motion on many variants of a machine, on all processors, on a Dask cluster or as a job array."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from . import _native, chunks, shards
from .arguments import to_native, to_path, to_whole
from .chunks import Setup, SweepResult
from .machine import Machine

if TYPE_CHECKING:
    import pandas
    from distributed import Client

    from .cluster import Overhead
    from .machine import Parameter, Setpoints

BATCH = 32
"""Variants that run side by side as vector lanes."""
MOST_THREADS = 1024
"""Largest number of threads."""
MOST_VARIANTS = 1_000_000_000
"""Largest number of variants in a chunk, and of jobs."""
CHUNK = 4096
"""Most variants in a chunk."""
SHARE = 0.02
"""Largest overhead of a chunk as a part of its duration."""
SCHEDULER_SHARE = 0.5
"""Largest overhead of the chunks of all workers as a part of their duration."""


LARGEST_BOUND = 1e18
"""Largest amount of a bound of drawn parameters."""


def draw(random: np.random.Generator, low: float, high: float) -> float:
    """Draws a number uniformly; between two integers, an integer."""
    if isinstance(low, int | np.integer) and isinstance(high, int | np.integer):
        return int(random.integers(low, high, endpoint=True))
    return float(random.uniform(low, high))


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

    def __repr__(self) -> str:
        """Returns the numbers of variants and of failures."""
        failed = sum(one.error is not None for one in self._results)
        return f"SweepResults({len(self)} variants, {failed} failed)"

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a row per variant: parameters, figures as `axes.x.peak_current_a`, `error` (needs pandas)."""
        import pandas

        return pandas.DataFrame([one.row() for one in self._results])


@dataclass(frozen=True, repr=False)
class RandomVariants(Sequence[Mapping[str, "Parameter"]]):
    """Uniformly drawn variants that are computed when they are read."""

    seed: int
    """Seed of the draws."""
    bounds: dict[str, tuple[float, float]]
    """Lowest and highest value of each parameter."""
    first: int
    """Index of the first variant."""
    end: int
    """Index after the last variant."""

    def __len__(self) -> int:
        """Returns the number of variants."""
        return self.end - self.first

    def __repr__(self) -> str:
        """Returns the numbers of variants and of parameters, and the seed."""
        return f"RandomVariants({len(self)} variants of {len(self.bounds)} parameters, seed {self.seed})"

    def __getitem__(self, index: Any) -> Any:
        """Returns the changed parameters of one variant, or the variants of a slice."""
        if isinstance(index, slice):
            first, end, step = index.indices(len(self))
            if step != 1:
                return [self[one] for one in range(first, end, step)]
            return RandomVariants(self.seed, self.bounds, self.first + first, self.first + max(first, end))
        position = range(self.first, self.end)[index]
        random = np.random.default_rng([self.seed, position])

        return {name: draw(random, *bounds) for name, bounds in self.bounds.items()}


def random_variants(seed: int, n: int, bounds: Mapping[str, tuple[float, float]]) -> RandomVariants:
    """Returns n variants with uniformly drawn parameters.

    `bounds` are the lowest and highest value of each parameter; two integers draw integers. Variant i depends on
    `seed`, `bounds` and i only. Raises `ValueError` for a negative seed or number, or bounds in the wrong order.
    """
    seed, n = to_whole("seed", seed, 0, 2**64 - 1), to_whole("n", n, 0, MOST_VARIANTS)
    for name, pair in bounds.items():
        if np.shape(pair) != (2,) or not all(
            isinstance(value, int | float | np.integer | np.floating) for value in pair
        ):
            raise TypeError(f"{name}: bounds {pair!r} must be two numbers, the lower one first")
        low, high = pair
        if not (abs(low) <= LARGEST_BOUND and abs(high) <= LARGEST_BOUND and low <= high):
            most = f"at most {LARGEST_BOUND:g} in amount"
            raise ValueError(f"{name}: bounds ({low}, {high}) must be finite, {most}, the lower one first")
    return RandomVariants(seed, {name: (low, high) for name, (low, high) in bounds.items()}, 0, n)


@overload
def sweep(
    machine: Machine,
    variants: Sequence[Mapping[str, Parameter]],
    psec: Setpoints,
    *,
    figures: str = ...,
    threads: int | None = ...,
    executor: Client | None = ...,
    chunk: int | None = ...,
    out: None = ...,
    resume: bool = ...,
    shard: tuple[int, int] | None = ...,
    progress: bool | None = ...,
) -> SweepResults: ...


@overload
def sweep(
    machine: Machine,
    variants: Sequence[Mapping[str, Parameter]],
    psec: Setpoints,
    *,
    out: str | Path,
    figures: str = ...,
    threads: int | None = ...,
    executor: Client | None = ...,
    chunk: int | None = ...,
    resume: bool = ...,
    shard: tuple[int, int] | None = ...,
    progress: bool | None = ...,
) -> Path: ...


def sweep(
    machine: Machine,
    variants: Sequence[Mapping[str, Parameter]],
    psec: Setpoints,
    *,
    figures: str = "axes",
    threads: int | None = None,
    executor: Client | None = None,
    chunk: int | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    shard: tuple[int, int] | None = None,
    progress: bool | None = None,
) -> SweepResults | Path:
    """Simulates the same setpoints on each variant of a machine and returns their figures, in order.

    `variants` are dictionaries of changed parameters, as for `Machine.with_`, or `random_variants`. `psec` and
    `figures` are those of `Machine.simulate`. Variants with equal delays run side by side, on all processors or
    `threads` of them. A variant that cannot be simulated has an `error` in place of figures.

    `executor` is a Dask `Client` (extra `dask`): its workers simulate chunks of variants, each with 1 thread or
    `threads`. A chunk of a lost worker is simulated again. `chunk` is the number of variants in a chunk; by default the
    overhead of a chunk is measured and kept below 2 % of its duration. The results depend on none of these.

    `out` is a directory (extra `parquet`): each chunk becomes a Parquet file there, and the directory is returned, for
    `merge`. With `resume` the chunks in the directory are kept, if machine, motion, variants and figures are equal.
    `shard=(i, n)` simulates the chunks with an index of i modulo n only, for job i of an array of n jobs with one
    directory. `progress` shows the progress on stderr, by default if that is a terminal.

    Raises `TypeError` for a parameter of another kind, `ValueError` for invalid setpoints and options, and for a
    directory with another study, naming what differs; for an unknown parameter of `random_variants`, too.
    """
    to_native(machine)
    if threads is not None:
        threads = to_whole("threads", threads, 1, MOST_THREADS)
    if chunk is not None:
        chunk = to_whole("chunk", chunk, 1, MOST_VARIANTS)
    if out is None and (resume or shard is not None):
        raise ValueError("resume and shard need a directory as out")
    index, count = (0, 1) if shard is None else _shard(shard)
    rows = variants if isinstance(variants, RandomVariants) else _dictionaries(variants)
    if isinstance(rows, RandomVariants) and len(rows):
        _check_names(machine, rows[0])
    setup = Setup(machine, planned(machine, psec), figures, _threads(threads, executor))
    store = None if out is None else shards.Store(Path(to_path("out", out)))
    size = chunk or (store.chunk() if store else None) or _chunk_size(setup, rows, executor, count)
    if store:
        size = store.open(shards.identity(setup, rows, size), chunk is not None, resume, (index, count))
    parts = [(first, min(first + size, len(rows))) for first in range(0, len(rows), size)]
    mine = [part for number, part in enumerate(parts) if number % count == index]
    todo = [part for part in mine if not (store and store.has(*part))]
    produce = chunks.simulate if store is None else chunks.simulate_to_parquet
    found: dict[int, Any] = {}
    with chunks.Progress(sum(end - first for first, end in todo), progress) as shown:
        for (first, end), result in chunks.run(produce, setup, rows, todo, executor):
            if store:
                store.write(first, end, result)
            else:
                found[first] = result
            shown.add(end - first)
    if store:
        return store.directory
    results = (SweepResult.of(*one) for first, end in parts for one in zip(rows[first:end], found.pop(first)))
    return SweepResults(list(results))


def _shard(shard: tuple[int, int]) -> tuple[int, int]:
    """Returns a checked shard."""
    if len(shard) != 2:
        raise ValueError(f"shard {shard}: must be two numbers, the job and the number of jobs")
    count = to_whole("shard, number of jobs", shard[1], 1, MOST_VARIANTS)
    return to_whole("shard, job", shard[0], 0, count - 1), count


def _check_names(machine: Machine, changes: Mapping[str, Parameter]) -> None:
    """Raises `ValueError` for a parameter that the machine does not know; a wrong value is an error of its variant."""
    for name, value in changes.items():
        try:
            machine.with_({name: value})
        except ValueError as error:
            if "unknown parameter" in str(error):
                raise


def _dictionaries(variants: Sequence[Mapping[str, Parameter]]) -> list[Mapping[str, Parameter]]:
    """Returns the variants as a list; raises `TypeError` for anything but dictionaries."""
    if isinstance(variants, Mapping):
        raise TypeError("variants is a dictionary; it must be a sequence of dictionaries of changed parameters")
    if hasattr(variants, "columns"):
        remedy = "table.to_dict('records') of pandas or table.to_dicts() of polars"
        raise TypeError(f"variants is a {type(variants).__name__}; it must be a sequence of dictionaries: {remedy}")
    rows = list(variants)
    for index, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise TypeError(f"variant {index} is of type {type(row).__name__}; it must be a dictionary")
    return rows


def planned(machine: Machine, psec: Setpoints) -> NDArray[np.float64] | _native.Scenario | _native.PartProgram:
    """Returns setpoints; those of a part program planned once, so that workers need no file."""
    given = machine.setpoints(psec)
    if isinstance(given, _native.PartProgram):
        rows = given.psec(machine)
        return rows if rows.shape[1] == len(machine.axes) else given
    return given


def _threads(threads: int | None, executor: Client | None) -> int:
    """Returns the threads of a chunk."""
    if threads is not None:
        return threads
    return len(os.sched_getaffinity(0)) if executor is None else 1


def _chunk_size(setup: Setup, rows: Sequence[Mapping[str, Parameter]], executor: Client | None, shards: int) -> int:
    """Returns the number of variants in a chunk."""
    if executor is None or not len(rows):
        return chunk_size(None, len(rows), shards)
    from . import cluster

    threads = max(cluster.thread_count(executor), 1)
    return chunk_size(cluster.measure(executor, setup, rows[:BATCH]), len(rows), shards * threads)


def chunk_size(overhead: Overhead | None, rows: int, workers: int) -> int:
    """Returns the number of variants in a chunk: a multiple of the lanes, and at least 4 chunks per worker."""
    size = CHUNK
    if overhead:
        # One scheduler serves all workers.
        share = min(SHARE, SCHEDULER_SHARE / workers)
        size = min(size, int(np.ceil(overhead.per_chunk / (share * overhead.per_variant))))
    if workers > 1:
        size = min(size, -(-rows // (4 * workers)))
    return max(-(-size // BATCH) * BATCH, BATCH)
