"""Configuration of Sphinx: the documentation as a site, built by tools/build_docs.sh or rosdoc2."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
ROOT_PAGES = {
    "internals/architecture": "ARCHITECTURE.md",
    "internals/contributing": "CONTRIBUTING.md",
    "changelog": "CHANGELOG.md",
    "readme": "README.md",
}
"""Pages whose text is a file of the top level; on a Git host the page itself links to the file."""
OFFLINE = """
if (location.protocol === "file:") {
    document.write('<script src="_static/pages.js"></scr' + 'ipt>');
    window.fetch = url => Promise.resolve(new Response(PAGES[url.replace("./", "")]));
}
"""
"""Script of the search page: opened as a file, it takes pages from a script, as a browser reads no other files."""
LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")

project = "virtual_axes"
author = "virtual_axes maintainers"
version = release = re.search(r"<version>(.*)</version>", (ROOT / "package.xml").read_text(encoding="utf-8"))[1]
extensions = ["myst_nb", "sphinx_copybutton"]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
exclude_patterns = ["_build"]
nitpicky = True
myst_heading_anchors = 4
# Equations as a Git host shows them, too: blocks of math, and $ in the text.
myst_fence_as_directive = {"math"}
myst_enable_extensions = ["dollarmath"]
myst_dmath_double_inline = False
# MathML, which browsers typeset without a script and without network.
html_math_renderer = "mathml"
# Only tools/build_docs.sh executes notebooks: Read the Docs has no compiled module, and shows them without outputs.
nb_execution_mode = "off"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
# Of a block of console, commands without prompts are copied.
copybutton_prompt_text = r"\$ |> "
copybutton_prompt_is_regexp = True
copybutton_copy_empty_lines = False
highlight_language = "none"
html_theme = "furo"
html_title = "virtual_axes"
html_show_copyright = False
html_show_sphinx = False
html_copy_source = True
html_show_sourcelink = False
html_show_search_summary = True
html_static_path = ["_static"]
html_css_files = ["site.css"]


def read_page(app: Sphinx, name: str, source: list[str]) -> None:
    """Takes the text of a page from the top level where it is there, and rewrites links that leave docs/."""
    page = Path(app.env.doc2path(name))
    if name in ROOT_PAGES:
        page = ROOT / ROOT_PAGES[name]
        source[0] = page.read_text(encoding="utf-8")
        app.env.note_dependency(str(page))
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

    # The source of a notebook is JSON: only its text has links.
    if page.suffix == ".md":
        source[0] = LINK.sub(rewritten, source[0])


def visit_math(translator: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Writes an equation as MathML."""
    is_block = isinstance(node, nodes.math_block)
    try:
        formula = tex2mathml(node.astext(), as_block=is_block)
    except MathError as error:
        logging.getLogger(__name__).warning(f"{node.astext()}: {error}", location=node)
        raise nodes.SkipNode from error
    translator.body.append(f'<div class="math">{formula}</div>' if is_block else formula)
    raise nodes.SkipNode


def write_pages_for_search(app: Sphinx, exception: Exception | None) -> None:
    """Writes the text of all pages into a script: a browser reads no files for the excerpts of the search."""
    if exception or app.builder.name != "html":
        return
    pages = {}
    for name in sorted(app.env.found_docs):
        page = Path(app.outdir, f"{name}.html").read_text(encoding="utf-8")
        pages[f"{name}.html"] = page[page.index("<article") : page.index("</article>")]
    text = json.dumps(pages, ensure_ascii=False).replace("</", "<\\/")
    Path(app.outdir, "_static", "pages.js").write_text(f"const PAGES = {text};\n", encoding="utf-8")


def add_pages_to_search(app: Sphinx, name: str, template: str, context: dict, doctree: nodes.document | None) -> None:
    """Adds the script with all pages to the search page where it is opened as a file."""
    if name == "search":
        app.add_js_file(None, body=OFFLINE, priority=100)


def setup(app: Sphinx) -> None:
    """Connects the rewriting of links, the equations and the search."""
    app.connect("source-read", read_page)
    app.connect("html-page-context", add_pages_to_search)
    app.connect("build-finished", write_pages_for_search)
    app.add_html_math_renderer("mathml", inline_renderers=(visit_math, None), block_renderers=(visit_math, None))
