"""Runner of the documentation: executes the commands of a Markdown page and compares their output.

    cd test_py && python -m documentation ../README.md            # what the test does
    cd test_py && python -m documentation ../README.md --update   # writes the output of this run into the page

`blocks` reads a page, `compare` compares output, `terminal` is a shell, `place` prepares home directory, checkout and
stand-ins, `page` executes a page. The format of the blocks is described in CONTRIBUTING.md.
"""

from .blocks import Block, Command, FileBlock, PageError, read
from .compare import difference
from .page import Page

__all__ = ["Block", "Command", "FileBlock", "Page", "PageError", "difference", "read"]
