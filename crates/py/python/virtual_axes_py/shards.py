"""Directories of a sweep: a Parquet file per chunk, the identity of the study, and the merge."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from .arguments import to_path
from .chunks import Setup, Variants, load_pyarrow

if TYPE_CHECKING:
    import pandas
    import pyarrow

STUDY = "study.json"
"""Name of the file with the identity of the study."""
CHUNK = re.compile(r"rows-(\d{9})-(\d{9})\.parquet")
REMOVE = "remove the file, and complete the study with resume=True"
"""What to do with a damaged file."""
COMPARED = ("machine", "motion", "variants", "rows", "figures", "version")


def identity(setup: Setup, variants: Variants, chunk: int) -> dict[str, Any]:
    """Returns what tells a study from others: digests of its inputs, its rows and the size of its chunks."""
    # Of a random design that is its definition, which does not grow with the number of variants.
    rows: Iterable[str] = [repr(variants)] if not isinstance(variants, list) else map(_json, variants)
    try:
        package = version("virtual_axes_py")
    except PackageNotFoundError:
        package = ""
    return {
        **setup_identity(setup),
        "variants": _digest(rows),
        "version": package,
        "rows": len(variants),
        "chunk": chunk,
    }


def setup_identity(setup: Setup) -> dict[str, str]:
    """Returns digests of machine and motion, and the choice of figures."""
    return {"machine": _digest([setup.machine.to_yaml()]), "motion": _motion(setup), "figures": setup.figures}


def _json(variant: Any) -> str:
    """Returns the changed parameters as JSON."""
    return json.dumps(variant, default=lambda value: np.asarray(value).tolist())


def _digest(texts: Iterable[str | bytes]) -> str:
    """Returns the SHA-256 of texts and their boundaries."""
    found = hashlib.sha256()
    for text in texts:
        data = text.encode() if isinstance(text, str) else text
        found.update(len(data).to_bytes(8, "little") + data)
    return found.hexdigest()


def _motion(setup: Setup) -> str:
    """Returns the digest of the setpoints and of the kind of their source, which selects the figures."""
    given = setup.psec
    source = "setpoints" if isinstance(given, np.ndarray) else repr(given)
    rows = given if isinstance(given, np.ndarray) else given.psec(setup.machine)
    return _digest([source, str(rows.shape), np.ascontiguousarray(rows).tobytes()])


class Store:
    """Directory of a study. Files appear complete or not at all."""

    def __init__(self, directory: Path) -> None:
        """Names the directory, which `open` creates."""
        load_pyarrow()
        self.directory = directory
        self._present: set[tuple[int, int]] = set()

    def chunk(self) -> int | None:
        """Returns the size of the chunks of the study in the directory, none without a study."""
        file = self.directory / STUDY
        return int(_read(file)["chunk"]) if file.exists() else None

    def open(self, study: dict[str, Any], is_chunk_given: bool, resume: bool, shard: tuple[int, int]) -> int:
        """Creates the directory, or checks that its study is this one; returns the size of the chunks.

        Another size of the chunks is a difference if it is given; otherwise that of the directory applies.
        """
        self.directory.mkdir(parents=True, exist_ok=True)
        file = self.directory / STUDY
        self._create(file, json.dumps(study, indent=1).encode())
        found = _read(file)
        compared = [*COMPARED, "chunk"] if is_chunk_given else COMPARED
        differing = [key for key in compared if found.get(key) != study[key]]
        if differing:
            raise ValueError(f"{file} is of another study: {', '.join(differing)} differ; use another directory")
        self._present = set(_chunks(self.directory))
        size, (index, count) = int(found["chunk"]), shard
        own = [first for first, _ in self._present if first // size % count == index]
        if own and not resume:
            raise ValueError(f"{self.directory} has results of this study; use resume=True to complete it")
        return size

    def has(self, first: int, end: int) -> bool:
        """Returns true if the chunk was there when the study was opened."""
        return (first, end) in self._present

    def write(self, first: int, end: int, content: bytes) -> None:
        """Adds a chunk."""
        name = f"rows-{first:09}-{end:09}.parquet"
        temporary = self.directory / f".{name}.tmp"
        temporary.write_bytes(content)
        temporary.replace(self.directory / name)

    def _create(self, file: Path, content: bytes) -> None:
        """Creates a file unless it exists; of several processes one creates it."""
        temporary = file.with_name(f".{file.name}.{os.getpid()}.tmp")
        temporary.write_bytes(content)
        try:
            os.link(temporary, file)
        except FileExistsError:
            pass
        finally:
            temporary.unlink()


def _read(file: Path) -> dict[str, Any]:
    """Returns the identity of the study in a file."""
    if not file.exists():
        raise ValueError(f"{file.parent} has no study; it needs the file {file.name}, which sweep writes")
    try:
        found = json.loads(file.read_text())
        int(found["chunk"]), int(found["rows"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{file} is no description of a study: {error}") from error
    return dict(found)


def _chunks(directory: Path) -> list[tuple[int, int]]:
    """Returns the chunks in a directory, in order."""
    names = (CHUNK.fullmatch(entry.name) for entry in directory.iterdir())
    return sorted((int(name[1]), int(name[2])) for name in names if name)


@overload
def merge(directory: str | Path, out: None = ...) -> pandas.DataFrame: ...


@overload
def merge(directory: str | Path, out: str | Path) -> Path: ...


def merge(directory: str | Path, out: str | Path | None = None) -> pandas.DataFrame | Path:
    """Returns the results of all chunks in the directory of a sweep, in the order of the variants (needs pandas).

    The columns are `row`, the changed parameters, the figures and `error`. With `out` the table is written to that
    Parquet file instead. Raises `ValueError` with the missing rows, with the names of overlapping files, or with the
    name of a damaged file.
    """
    folder = Path(to_path("directory", directory))
    rows, position, last = int(_read(folder / STUDY)["rows"]), 0, ""
    tables = []
    for first, end in [*_chunks(folder), (rows, rows)]:
        name = f"rows-{first:09}-{end:09}.parquet"
        if first > position:
            raise ValueError(f"{folder}: rows {position} to {first - 1} are missing; complete it with resume=True")
        if first < position:
            raise ValueError(f"{folder}: {last} and {name} overlap")
        if end > first:
            tables.append(_table(folder / name, first, end))
        position, last = end, name
    pa, parquet = load_pyarrow()
    merged = pa.concat_tables(tables, promote_options="permissive") if tables else pa.table({})
    if out is None:
        found: pandas.DataFrame = merged.to_pandas()
        return found
    target = Path(out)
    temporary = target.with_name(f".{target.name}.tmp")
    parquet.write_table(merged, temporary, compression="zstd")
    temporary.replace(target)
    return target


def _table(file: Path, first: int, end: int) -> pyarrow.Table:
    """Reads a chunk and checks its rows."""
    pa, parquet = load_pyarrow()
    try:
        table = parquet.read_table(file)
    except pa.ArrowException as error:
        raise ValueError(f"{file} is damaged: {error}; {REMOVE}") from error
    if "row" not in table.column_names or table["row"].to_pylist() != list(range(first, end)):
        raise ValueError(f"{file} is damaged: its rows are not {first} to {end - 1}; {REMOVE}")
    return table
