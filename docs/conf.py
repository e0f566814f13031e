"""Configuration of Sphinx: the documentation as a site, built by tools/build_docs.sh or rosdoc2."""

from __future__ import annotations

import os
import re
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util import logging

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
ROOT_PAGES = {
    "internals/architecture": "ARCHITECTURE.md",
    "internals/contributing": "CONTRIBUTING.md",
    "changelog": "CHANGELOG.md",
    "readme": "README.md",
}
"""Pages whose text is a file of the top level; on a Git host the page itself links to the file."""
LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")

project = "virtual_axes"
author = "virtual_axes maintainers"
version = release = re.search(r"<version>(.*)</version>", (ROOT / "package.xml").read_text(encoding="utf-8"))[1]
extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
nitpicky = True
myst_heading_anchors = 4
highlight_language = "none"
html_theme = "furo"
html_title = "virtual_axes"
html_show_copyright = False
html_show_sphinx = False
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["site.css"]


def read_page(app: Sphinx, name: str, source: list[str]) -> None:
    """Takes the text of a page from the top level where it is there, and rewrites links that leave docs/."""
    page = DOCS / f"{name}.md"
    if name in ROOT_PAGES:
        page = ROOT / ROOT_PAGES[name]
        source[0] = page.read_text(encoding="utf-8")
        app.env.note_dependency(str(page))
    if name == "index" and not (DOCS / "reproduction.md").exists():
        # tools/reproduction.py writes that page by running the program, which Read the Docs lacks.
        source[0] = re.sub(r"```\{toctree\}\n:glob:.*?```\n", "", source[0], flags=re.DOTALL)
    pages = {ROOT / file: DOCS / f"{one}.md" for one, file in ROOT_PAGES.items()}

    def rewritten(link: re.Match[str]) -> str:
        text, target, anchor = link[1], link[2], link[3] or ""
        if re.match(r"[a-z]+:", target):
            return link[0]
        file = Path(os.path.normpath(page.parent / target))
        file = pages.get(file, file)
        if file.is_relative_to(DOCS):
            # Sphinx checks that the page exists.
            return f"[{text}]({os.path.relpath(file, (DOCS / name).parent)}{anchor})"
        if not file.exists():
            logging.getLogger(__name__).warning(f"{target}: file not found", location=name)
        # The site has no copy of the other files of the package.
        path = f"`{file.relative_to(ROOT)}`"
        return path if text in (path, path.strip("`")) else f"{text} ({path})"

    source[0] = LINK.sub(rewritten, source[0])


def setup(app: Sphinx) -> None:
    """Connects the rewriting of links."""
    app.connect("source-read", read_page)
