"""Command line of the runner."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from node_process import DomainId, node_binary

from .page import Page
from .place import Place


def main() -> int:
    """Executes pages and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m documentation", description="Executes the commands of pages.")
    parser.add_argument("page", type=Path, nargs="+")
    parser.add_argument("--update", action="store_true", help="write differing output into the page")
    parser.add_argument("--marked-only", action="store_true", help="execute only blocks after a comment")
    arguments = parser.parse_args()
    status = 0
    for file in arguments.page:
        domain = DomainId()
        with tempfile.TemporaryDirectory(prefix="documentation-") as directory:
            place = Place(Path(directory).resolve(), node_binary(), domain.value)
            page = Page(file, place, marked_only=arguments.marked_only)
            faults = page.run(keep_going=arguments.update)
        domain.release()
        if arguments.update and page.outputs:
            print(page.update())
            faults = [fault for fault in faults if fault not in page.output_faults]
        print(
            "\n".join(faults) or f"{file}: as shown",
            *(f"stand-in: {name}" for name in sorted(place.standins)),
            sep="\n",
        )
        status |= bool(faults)
    return status


if __name__ == "__main__":
    sys.exit(main())
