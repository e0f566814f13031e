#!/usr/bin/env python3
"""Interprets programs with rs274 of LinuxCNC, the independent interpreter of the tests.

The programs are those in crates/nc/tests/rs274, and two of config/programs.

    apt-get install linuxcnc-uspace       # Debian 12: LinuxCNC 2.9.0~pre1
    tools/golden_rs274.py --write         writes NAME.canon, the canonical commands, of each program
    tools/golden_rs274.py                 fails if a file differs from the output of rs274

`--rs274` is the program, if it is not in PATH. It starts in an empty directory, without a file of parameters: all
offsets are 0, the unit is the millimeter, and tools.tbl is its tool table, with lengths in inches. Tests compare the
commands with the steps of our interpreter: `cargo test -p virtual_axes_nc --test interpret rs274`.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

import options

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "crates" / "nc" / "tests" / "rs274"
SHIPPED = ["circle-diamond-square", "pocket"]
TIMEOUT_S = 20.0


def canonical_commands(interpreter: str, program: Path) -> str:
    """Returns the output of rs274 for a program: one command in each line."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        command = [interpreter, "-g", "-t", FOLDER / "tools.tbl", program, out]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S)
        if done.returncode:
            raise SystemExit(f"golden_rs274: {program.name}: {done.stderr.strip()}")
        return re.sub(r"^ *\d+ N.{5} ", "", out.read_text(), flags=re.MULTILINE)


def main() -> int:
    """Writes or compares all files."""
    parser = options.parser(__doc__)
    parser.add_argument("--write", action="store_true", help="writes the files")
    parser.add_argument("--rs274", default="rs274", help="interpreter of LinuxCNC")
    args = parser.parse_args()
    differing = 0
    for program in [*sorted(FOLDER.glob("*.ngc")), *(ROOT / "config" / "programs" / f"{name}.nc" for name in SHIPPED)]:
        canon = FOLDER / f"{program.stem}.canon"
        text = canonical_commands(args.rs274, program)
        if args.write:
            canon.write_text(text)
        elif not canon.exists() or canon.read_text() != text:
            print(f"golden_rs274: {canon.name} differs", file=sys.stderr)
            differing += 1
    return bool(differing)


if __name__ == "__main__":
    sys.exit(main())
