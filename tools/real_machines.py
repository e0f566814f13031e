#!/usr/bin/env python3
"""Identifies public recordings of real machines and prints one table.

    tools/real_machines.py DIR                    all sources whose files are in DIR/<folder>
    tools/real_machines.py DIR --source emps      one source; can be repeated
    tools/real_machines.py --list                 the sources: folder, license, where to get them

Each source is identified from its first recording, without knowledge of its machine (`--new-machine`), and validated on
the next one. A source with one recording is split. Sources without files are skipped with one line. The command is
target/release/virtual_axes; --program names another.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import options

ROOT = Path(__file__).resolve().parent.parent
TIMEOUT = 900
"""Longest identification, s."""
SHORTEST = 500
"""Fewest rows of a capture."""
RECORDINGS = ("*.csv", "*.json", "*.mcap", "*.txt", "*.xml")


@dataclass(frozen=True)
class Source:
    """Public recordings of a machine."""

    folder: str
    title: str
    license: str
    where: str
    axes: tuple[str, ...] = ()
    """Options that name the axes; without them the next command of the list of columns."""
    columns: tuple[str, ...] = field(default=())


SOURCES = (
    Source(
        "capture_data_parser",
        "five-axis machine, Sinumerik 840D sl with Edge logger, 500 Hz",
        "MIT",
        "https://github.com/max-scw/CaptureDataParser, example/*.json",
        ("--axis", "x,y,c", "--joint", "1,2,6"),
    ),
    Source(
        "kit_840d",
        "DMC 60 H and CMX 600 V, Sinumerik 840D, recordings of KIT wbk (Ströbel et al.)",
        "CC BY 4.0",
        "https://publikationen.bibliothek.kit.edu, search for 'milling dataset Ströbel'; the CSV files of the control",
    ),
    Source(
        "emps",
        "EMPS, ball-screw axis, 1 kHz (Janot, Gautier, Brunot)",
        "none stated: for trials only",
        "https://www.nonlinearbenchmark.org/benchmarks/emps; time s, position m, velocity m/s, current V as CSV",
        ("--axis", "x"),
        ("--column", "current=[35.15065 N]"),
    ),
    Source(
        "pro2future",
        "machine tool recordings of Pro2Future",
        "see the record of the data set",
        "https://zenodo.org, search for 'Pro2Future machine tool'; the CSV files of the control",
    ),
)

COLUMNS = (
    "source",
    "axis",
    "rate Hz",
    "data",
    "model RMS",
    "max",
    "lag RMS",
    "max",
    "R2 current",
    "J",
    "weight",
    "alpha ms",
    "beta ms",
    "result",
)


def captures(path: Path, folder: Path) -> list[Path]:
    """Returns the parts of a recording without gap: those of Sinumerik Edge, or two halves of a CSV file."""
    if path.suffix == ".json":
        document = json.loads(path.read_text(encoding="utf-8"))
        rows = [row for item in document["Payload"] for row in item.get("HFData", [])]
        starts = [0] + [k for k in range(1, len(rows)) if rows[k][0] != rows[k - 1][0] + 1] + [len(rows)]
        parts = [rows[a:b] for a, b in zip(starts, starts[1:], strict=False) if b - a >= SHORTEST]
        texts = [json.dumps({"Header": document["Header"], "Payload": [{"HFData": part}]}) for part in parts]
    else:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
        half = len(lines) // 2
        texts = ["".join(lines[:half]), lines[0] + "".join(lines[half:])]
    files = [folder / f"{path.stem}_{number}{path.suffix}" for number in range(1, len(texts) + 1)]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text, encoding="utf-8")
    return files


def reading(program: Path, source: Source, recording: Path) -> list[str]:
    """Returns axes and options of reading: those of the source, otherwise those of the next command of the list."""
    listing = subprocess.run(
        [program, "identify", recording, *source.columns],
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    line = next((line for line in listing.stdout.splitlines() if line.startswith("next: ")), "")
    words = shlex.split(line)[3:]
    kept: list[str] = []
    for option, value in zip(words, words[1:], strict=False):
        is_other = option in ("--machine", "--out", "--report", "--set", "--transmission")
        is_axis = option in ("--axis", "--joint") and source.axes
        if option.startswith("--") and not is_other and not is_axis and [option, value] != list(source.columns):
            kept += [option, value]
    if not kept and not source.axes:
        raise ValueError(listing.stderr.strip() or "the list of columns has no next command")
    return [*source.axes, *source.columns, *kept]


def identified(program: Path, source: Source, first: Path, second: Path | None) -> list[dict]:
    """Returns the figures of each axis."""
    command = [program, "identify", first, "--new-machine", source.folder, "--json"]
    command += reading(program, source, first)
    if second:
        command += ["--validate", second]
    result = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    if not result.stdout.startswith(("{", "[")):
        raise ValueError(result.stderr.strip().splitlines()[-1] if result.stderr.strip() else "no output")
    found = json.loads(result.stdout)
    return found if isinstance(found, list) else [found]


def number(value: float | None, digits: int = 3) -> str:
    """Formats a number; a dash without one."""
    return "–" if value is None else f"{value:.{digits}g}"


def row(source: Source, found: dict) -> list[str]:
    """Returns a row of the table: residuals on unseen data if there are any, otherwise on the own data."""
    unseen = found["validation"][:1]
    residuals = (unseen or found["agreement"] or [{}])[0]
    baseline = residuals.get("baseline") or {}
    inverse = residuals.get("inverse_dynamics") or {}

    def value(*keys: str) -> str:
        for entry in found["values"]:
            if entry["key"].split(".", 1)[-1] in keys:
                error = entry.get("standard_error")
                spread = f" ± {error:.1g}" if error else ""
                return f"{entry['value']:.4g}{spread}"
        return "–"

    invalid = [finding["code"] for finding in found["findings"] if finding["severity"] == "invalid"]
    return [
        source.folder,
        found["axis"],
        number(1e3 / found["recordings"][0]["period_ms"], 4),
        "unseen" if unseen else "own",
        f"{number(baseline.get('model'))} {found['position_unit']}",
        number(baseline.get("model_max")),
        number(baseline.get("delayed")),
        number(baseline.get("delayed_max")),
        number(inverse.get("current_r_squared")),
        value("motor.inertia_kg_m2", "motor.mass_kg"),
        value("gravity.weight_n"),
        value("delays.alpha_ms"),
        value("delays.beta_ms"),
        ", ".join(invalid) or "valid",
    ]


def table(rows: list[list[str]]) -> str:
    """Returns aligned rows in Markdown."""
    lines = [list(COLUMNS), ["---"] * len(COLUMNS), *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(COLUMNS))]
    padded = [[cell.ljust(width) for cell, width in zip(line, widths, strict=True)] for line in lines]
    return "".join(f"| {' | '.join(line)} |\n" for line in padded)


def run(program: Path, source: Source, folder: Path) -> list[list[str]]:
    """Returns the rows of a source; none if its files are missing."""
    files = sorted({path for pattern in RECORDINGS for path in folder.glob(pattern)})
    if not files:
        print(f"skipped: {source.folder}: no recording in {folder}; {source.where}", file=sys.stderr)
        return []
    with TemporaryDirectory() as converted:
        parts = files if len(files) > 1 and files[0].suffix != ".json" else captures(files[0], Path(converted))
        try:
            all_found = identified(program, source, parts[0], parts[1] if len(parts) > 1 else None)
        except (ValueError, subprocess.TimeoutExpired, OSError) as error:
            reason = str(error).splitlines()[0]
            return [[source.folder, *["–"] * (len(COLUMNS) - 2), f"no result: {reason}"]]
    rows = [row(source, found) for found in all_found]
    named = source.axes[1].split(",") if source.axes else []
    missing = [axis for axis in named if axis not in {found["axis"] for found in all_found}]
    return rows + [[source.folder, axis, *["–"] * (len(COLUMNS) - 3), "no valid result"] for axis in missing]


def main() -> int:
    """Prints the table, or the list of sources."""
    parser = options.parser(__doc__)
    parser.add_argument("folder", type=Path, nargs="?", metavar="DIR", help="folder with a folder for each source")
    parser.add_argument("--list", action="store_true", help="prints the sources")
    names = [source.folder for source in SOURCES]
    parser.add_argument("--source", action="append", choices=names, help="one source; can be repeated")
    parser.add_argument("--program", type=Path, default=ROOT / "target" / "release" / "virtual_axes")
    args = parser.parse_args()
    if args.list:
        for source in SOURCES:
            print(f"{source.folder}: {source.title}; license: {source.license}; {source.where}")
        return 0
    if args.folder is None:
        parser.error("DIR is required, or --list")
    if not args.program.is_file():
        parser.error(f"{args.program}: no such program; cargo build --release --bin virtual_axes, or --program")
    rows = []
    for source in SOURCES:
        if not args.source or source.folder in args.source:
            rows += run(args.program, source, args.folder / source.folder)
    print(table(rows), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
