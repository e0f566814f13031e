"""Tables of reference values for the tests of `crates/core`."""

from collections.abc import Iterable
from pathlib import Path

GOLDEN = Path(__file__).resolve().parents[1] / "crates/core/tests/golden"


def write(name: str, columns: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Writes a table of texts."""
    lines = [",".join(columns), *map(",".join, rows)]
    (GOLDEN / f"{name}.csv").write_text("\n".join(lines) + "\n")
