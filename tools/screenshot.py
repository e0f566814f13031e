#!/usr/bin/env python3
"""Saves a screenshot of a page, if Chromium is installed: tools/screenshot.py PAGE.html PICTURE.png"""

import sys
import tempfile
from pathlib import Path

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
from browser import Browser, find_browser  # noqa: E402  (the path to it is set above)


def main() -> int:
    """Takes the screenshot, or reports why that is impossible."""
    parser = options.parser(__doc__)
    parser.add_argument("page", type=Path)
    parser.add_argument("picture", type=Path)
    arguments = parser.parse_args()
    page, picture = arguments.page.resolve(), arguments.picture.resolve()
    program = find_browser()
    if program is None:
        print("no Chromium found: no screenshot")
        return 0
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, Browser(program, Path(folder)) as browser:
        browser.show_as()
        browser.open(page.as_uri())
        browser.screenshot(picture)
    print(f"screenshot: {picture}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
