"""Chunks of a sweep on the workers of a Dask cluster (needs distributed)."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from .chunks import Part, Produce, Setup, Variants, simulate

try:
    import distributed
except ImportError as error:
    raise ImportError("a sweep on a cluster needs Dask: pip install 'virtual_axes_py[dask]'") from error

# Half of its functions have types only.
Client = Any
as_completed: Any = distributed.as_completed

AHEAD = 3
"""Chunks in flight per thread of a worker: one computed, one waiting at the worker, one on the way."""


@dataclass(frozen=True)
class Overhead:
    """Durations that determine the size of chunks."""

    per_chunk: float
    """Time to send a chunk of some variants to a worker and their results back, s."""
    per_variant: float
    """Time of the simulation of one variant by a worker, s."""


def run(
    client: Client, produce: Produce, setup: Setup, variants: Variants, parts: Sequence[Part]
) -> Iterator[tuple[Part, Any]]:
    """Yields the result of each chunk once, in the order of completion.

    Dask computes the chunks of a lost worker again. The number of chunks in flight follows the number of workers, so
    that neither scheduler nor driver hold all of them.
    """
    study = uuid.uuid4().hex
    # A task of its own: workers exchange its result, and compute it again if all its copies are lost.
    shared = client.submit(_identity, setup, key=f"setup-{study}")
    waiting = iter(parts)
    part_of: dict[str, Part] = {}
    pending = as_completed()

    def submit_more() -> None:
        while len(part_of) < AHEAD * max(thread_count(client), 1):
            part = next(waiting, None)
            if part is None:
                return
            first, end = part
            future = client.submit(produce, shared, first, variants[first:end], key=f"chunk-{study}-{first}")
            part_of[future.key] = part
            pending.add(future)

    try:
        submit_more()
        while part_of:
            future = next(pending)
            result = future.result()
            part = part_of.pop(future.key)
            future.release()
            submit_more()
            yield part, result
    finally:
        client.cancel(list(pending.futures))


def thread_count(client: Client) -> int:
    """Returns the number of threads of all workers; raises `TypeError` for anything but a client of Dask."""
    if not isinstance(client, distributed.Client):
        raise TypeError(f"executor is of type {type(client).__name__}; it must be a distributed.Client")
    threads: dict[str, int] = client.nthreads()  # type: ignore[no-untyped-call]
    return sum(threads.values())


def measure(client: Client, setup: Setup, variants: Variants, repetitions: int = 3) -> Overhead:
    """Measures the overhead of a chunk and the time of a variant, with all workers idle.

    `per_chunk` is the median round trip of a chunk that is not simulated.
    """
    study = uuid.uuid4().hex
    shared = client.submit(_identity, setup, key=f"setup-{study}")
    rows = list(variants)
    seconds, outcomes = client.submit(_timed, shared, rows, pure=False).result()
    trips = []
    for index in range(repetitions):
        start = time.perf_counter()
        client.submit(_returned, shared, outcomes, index, pure=False).result()
        trips.append(time.perf_counter() - start)
    return Overhead(median(trips), seconds / max(len(rows), 1))


def _identity(setup: Setup) -> Setup:
    """Returns its argument."""
    return setup


def _timed(setup: Setup, variants: Variants) -> tuple[float, Any]:
    """Returns the duration of a simulation, s, and its outcomes."""
    start = time.perf_counter()
    outcomes = simulate(setup, 0, variants)
    return time.perf_counter() - start, outcomes


def _returned(setup: Setup, outcomes: Any, repetition: int) -> Any:
    """Returns outcomes without a simulation."""
    return outcomes
