"""Limit audit of setpoints, and a machine as an FMU."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _native
from .arguments import read_json, to_native, to_path
from .tuning import named_path

if TYPE_CHECKING:
    from .machine import Machine, Setpoints


@dataclass(frozen=True, eq=False)
class CheckResult:
    """Largest positions, velocities, accelerations and jerks of setpoints, beside the limits of the axes."""

    summary: dict[str, Any]
    """All results with the keys and units of `virtual_axes check --json`."""
    reason: str | None
    """Sentence on the largest excess; `None` if all limits are kept."""

    @property
    def is_within_limits(self) -> bool:
        """True if no setpoint is beyond a limit."""
        return bool(self.summary["within_limits"])

    @property
    def axes(self) -> dict[str, Any]:
        """Largest values and limits by axis and quantity, of the axes that move."""
        return self.summary["axes"]  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        """Returns the verdict and its reason."""
        return f"CheckResult({'within limits' if self.reason is None else self.reason})"


def check(machine: Machine, psec: Setpoints) -> CheckResult:
    """Compares setpoints with the limits of the axes, as `virtual_axes check` does, without a simulation.

    `psec` is the path, as for `Machine.simulate`: values beyond limits are results, not errors. The axes rest before
    the first and after the last setpoint. Raises `ValueError` for a part program or scenario that cannot be planned.
    Releases the global interpreter lock.
    """
    text, reason = _native.check(to_native(machine), named_path(machine, psec, "setpoints"))
    return CheckResult(read_json(text), reason)


def fmu(
    machine: Machine, path: str | os.PathLike[str], library: str | os.PathLike[str] | Iterable[str | os.PathLike[str]]
) -> None:
    """Writes a machine as an FMU for importers of FMI 2.0 co-simulation, as `virtual_axes fmu` does.

    `library` is the shared library that `cargo build --release -p virtual_axes_fmu` builds, or one for each platform.
    Raises `ValueError` for a library of another kind or a second one of a platform, and `OSError` if `path` cannot be
    written.
    """
    libraries = list(library) if isinstance(library, Iterable) and not isinstance(library, str) else [library]
    if not libraries:
        raise ValueError("library: names no file; an FMU needs the library of at least one platform")
    files = [Path(to_path("library", one)) for one in libraries]
    out = Path(to_path("path", path))
    if any(out.resolve() == file.resolve() for file in files):
        raise ValueError(f"path {str(out)!r}: is a library of the FMU; choose another file")
    _native.fmu(to_native(machine), out, files)
