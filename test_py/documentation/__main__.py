"""Command line: `python -m documentation PAGE.md… [--update]`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from drive import DomainId

from .page import run_page, update


def main() -> int:
    """Runs pages and reports differences."""
    parser = argparse.ArgumentParser(description="Runs the commands of pages and compares their output.")
    parser.add_argument("pages", nargs="+", type=Path, metavar="PAGE.md")
    parser.add_argument("--update", action="store_true", help="write the actual output into the pages")
    options = parser.parse_args()
    status = 0
    for page in options.pages:
        with tempfile.TemporaryDirectory() as folder:
            found = []
            for difference in run_page(page, Path(folder), DomainId().value):
                found.append(difference)
                print(f"{page}:{difference.command.line}: $ {difference.command.text}\n  {difference.text}")
                print("".join(f"  | {line}\n" for line in difference.actual))
        if options.update:
            update(page, found)
        status = status or bool(found)
    return status


if __name__ == "__main__":
    sys.exit(main())
