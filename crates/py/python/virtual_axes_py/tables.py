"""Tables of pandas, polars, PyArrow, xarray and NumPy, and dictionaries, as arrays by column name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .arguments import to_array, to_floats, unknown

if TYPE_CHECKING:
    from .machine import Machine

TIME = "time"
"""Name of the column of times, s."""


class Table(Protocol):
    """Table with named columns: a DataFrame of pandas or polars, or a dataset of xarray."""

    def __getitem__(self, key: Any, /) -> Any:
        """Returns a column."""

    def __len__(self) -> int:
        """Returns the number of rows or columns."""


class LazyTable(Protocol):
    """Table that is computed when it is read: a LazyFrame of polars."""

    def collect(self) -> Any:
        """Returns the table."""

    def collect_schema(self) -> Any:
        """Returns names and types of the columns."""


def columns_of(name: str, given: Any, *, skip_texts: bool = False) -> dict[str, NDArray[np.float64]] | None:
    """Returns the columns of a table by name; None for anything without names, as an array.

    The columns are those of a DataFrame of pandas or polars or of a LazyFrame, of a table of PyArrow, of a structured
    array of NumPy, of a dictionary, or the variables of a dataset of xarray. A DataArray with two dimensions has a
    column for each label of the one with texts. A named index or coordinate is a column too. Durations and dates
    become seconds, dates from the first one, with or without a time zone. Columns of anything but numbers are left out
    with `skip_texts`.

    Raises `ValueError` for columns of different lengths or with one name, and for an index of numbers without a name;
    `TypeError` for anything but numbers.
    """
    pairs = _pairs(name, given)
    if pairs is None:
        return None
    found: dict[str, NDArray[np.float64]] = {}
    for label, values in pairs:
        title = str(label)
        if title in found:
            raise ValueError(f"{name} has two columns {title!r}; names must differ")
        try:
            found[title] = numbers(f"{name} of {title}", values)
        except TypeError:
            if not skip_texts:
                raise
    single = next((title for title, column in found.items() if column.ndim == 0), None)
    if single is not None:
        raise ValueError(f"{name} of {single} is one number; it must have a value for each row, as [{found[single]}]")
    shapes = {column.shape for column in found.values()}
    if found and (len(shapes) != 1 or len(next(iter(shapes))) != 1):
        listed = ", ".join(f"{title} {column.shape}" for title, column in found.items())
        raise ValueError(f"the columns of {name} have the shapes {listed}; they need one common length")
    return found


def _pairs(name: str, given: Any) -> Iterable[tuple[Any, Any]] | None:
    """Returns labels and values of the columns of a table, None for anything else."""
    if hasattr(given, "collect_schema") and hasattr(given, "collect"):
        given = given.collect()
    if isinstance(given, np.ndarray):
        return None if given.dtype.names is None else [(label, given[label]) for label in given.dtype.names]
    if hasattr(given, "data_vars"):
        shared = [(label, values) for label, values in given.coords.items() if values.ndim == 1]
        return [*shared, *given.data_vars.items()]
    if hasattr(given, "to_dataset") and hasattr(given, "dims"):
        texts = [dim for dim in given.dims if dim in given.coords and given.coords[dim].dtype.kind in "UOT"]
        if not given.coords and not texts:
            return None
        if len(texts) != 1:
            coordinates = ", ".join(map(str, given.coords))
            raise ValueError(
                f"{name} has the coordinates {coordinates}; one of them must name the columns, as ['x', 'y']"
            )
        return _pairs(name, given.to_dataset(dim=texts[0]).reset_coords(drop=True))
    if isinstance(given, Mapping):
        return [*_shared_index(name, given), *given.items()]
    if hasattr(given, "iloc") and hasattr(given, "columns"):
        return _of_pandas(name, given)
    if hasattr(given, "get_columns") and hasattr(given, "columns"):
        return [(column.name, column) for column in given.get_columns()]
    if hasattr(given, "column_names") and hasattr(given, "columns"):
        return list(zip(given.column_names, given.columns))
    return None


def _shared_index(name: str, given: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    """Returns the index of the Series of a dictionary as columns; raises `ValueError` unless it is one for all."""
    series = [one for one in given.values() if hasattr(one, "iloc") and hasattr(one, "to_frame")]
    if any(not one.index.equals(series[0].index) for one in series):
        raise ValueError(f"the Series of {name} have different indices; align them in a DataFrame, or give arrays")
    return (_of_pandas(name, series[0].to_frame("values")) or [])[:-1] if series else []


def _of_pandas(name: str, table: Any) -> list[tuple[Any, Any]] | None:
    """Returns the columns of a DataFrame; None for one without names, whose labels are 0, 1, …"""
    index, levels = table.index, table.columns.nlevels
    if levels > 1:
        first = table.columns[0]
        raise ValueError(f"{name} has columns of {levels} levels, as {first}; it needs one: use table.xs, or join them")
    named = [(name, index.get_level_values(level)) for level, name in enumerate(index.names) if name is not None]
    if not named and index.dtype.kind in "mM":
        named = [(TIME, index)]
    if not named and (index.nlevels > 1 or index.inferred_type in ("floating", "period")):
        remedy = "name it time (s) by rename_axis('time'), or drop it by reset_index(drop=True)"
        raise ValueError(f"{name} has an index of type {index.dtype} without a name: {remedy}")
    if not named and list(table.columns) == list(range(table.shape[1])):
        return None
    return named + [(label, table.iloc[:, position]) for position, label in enumerate(table.columns)]


def named_table(given: Any) -> Any:
    """Returns a Series or a DataArray of one dimension as a table, if it has a name; anything else as it is."""
    if not isinstance(getattr(given, "name", None), str) or len(getattr(given, "shape", ())) != 1:
        return given
    return given.to_dataset() if hasattr(given, "to_dataset") else given.to_frame()


def numbers(name: str, values: Any) -> NDArray[np.float64]:
    """Returns the values of a column; durations and dates in s, missing values as NaN."""
    if hasattr(values, "iloc") and not isinstance(values.dtype, np.dtype) and values.dtype.kind in tuple("biuf"):
        # A column of pandas that may have missing values.
        values = values.to_numpy(dtype=np.float64, na_value=np.nan)
    if getattr(getattr(values, "dtype", None), "tz", None) is not None:
        values = values.to_numpy(dtype="datetime64[ns]")
    array = to_array(name, values)
    first = array[0] if array.dtype.kind == "O" and array.ndim and len(array) else None
    if isinstance(first, datetime):
        # The difference of two local times of one time zone would be that of their clock.
        array = np.array([one.astimezone(UTC) if one.tzinfo else one for one in array], object)
        array = array - array[0]
    if isinstance(first, datetime | timedelta):
        array = array.astype("timedelta64[ns]")
    if array.dtype.kind == "M":
        array = array - array[:1]
    if array.dtype.kind == "m":
        return np.asarray(array / np.timedelta64(1, "ns") * 1e-9, dtype=np.float64)
    return to_floats(name, array)


def axis_columns(machine: Machine, name: str, given: Any) -> dict[str, NDArray[np.float64]] | None:
    """Returns the columns of a table by axis, and of the time if it has one; None for anything without names.

    Raises `ValueError` for a column that is neither, naming it.
    """
    found = columns_of(name, given)
    if found is None:
        return None
    axes = machine.axes
    for title, values in given.items() if hasattr(given, "data_vars") else ():
        units = str(values.attrs.get("units", ""))
        if title in axes and units not in ("", "m", "rad"):
            raise ValueError(f"{name} of {title} has the units {units!r}; positions are in m or rad: convert them")
    wrong = [title for title in found if title not in axes and title != TIME]
    if wrong:
        raise ValueError(f"{name}: {unknown('axis', wrong[0], axes)} (m or rad), and {TIME} (s)")
    if not any(title in axes for title in found):
        raise ValueError(f"{name} has no column of an axis; it needs one or more of {', '.join(axes)}")
    return found


def _by_label(name: str, given: Any) -> Any:
    """Returns the values of a DataArray with one dimension by their labels; as they are without labels."""
    if given.ndim != 1 or given.dims[0] not in given.coords:
        if given.coords:
            raise ValueError(f"{name} has the dimensions {', '.join(map(str, given.dims))}; it needs one, with labels")
        return given.values
    return dict(zip(given.coords[given.dims[0]].values, given.values))


def axis_values(axes: list[str], name: str, given: Any, missing: float | None = None) -> NDArray[np.float64]:
    """Returns values of the axes as an array: of one machine (axes,), of several (machines, axes).

    A dictionary, Series or DataArray has one value for each axis by name, or one for each machine; `missing` is the
    value of those that it does not have, which are an error if that is None.
    """
    if isinstance(given, np.ndarray):
        return to_floats(name, given)
    if hasattr(given, "coords") and hasattr(given, "dims"):
        given = _by_label(name, given)
    is_series = hasattr(given, "index") and hasattr(given, "items")
    if not (isinstance(given, Mapping) or is_series):
        return to_floats(name, given)
    values = {str(label): value for label, value in given.items()}
    if is_series and list(given.index) == list(range(len(given.index))):
        return np.asarray(given, dtype=np.float64)
    wrong = [label for label in values if label not in axes]
    if wrong:
        raise ValueError(f"{name}: {unknown('axis', wrong[0], axes)}")
    absent = [axis for axis in axes if axis not in values]
    if absent and missing is None:
        raise ValueError(f"{name} has no value for {absent[0]}; it needs one for each of {', '.join(axes)}")
    columns = [to_floats(f"{name} of {axis}", values.get(axis, missing)) for axis in axes]
    lengths = {len(column) for column in columns if column.ndim}
    if len(lengths) > 1:
        raise ValueError(
            f"{name} has columns of {' and '.join(map(str, sorted(lengths)))} values; they need one length"
        )
    return np.stack(np.broadcast_arrays(*columns), axis=-1)
