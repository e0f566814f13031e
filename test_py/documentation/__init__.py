"""Execution of the documentation: runs the commands of a page and compares their output with the page.

    python -m documentation PAGE.md            # reports differences
    python -m documentation PAGE.md --update   # writes the actual output into the page

Each ```console block of a page is executed. A line that begins with "$ " is a command ("> " continues it); the other
lines are its expected output. A comment directly before a block sets options:

    <!-- run: in=checkout -->            runs in the checkout, with its .venv and .build, not in an empty directory
    <!-- run: in=copy -->                runs in a copy of the checkout without build folders
    <!-- run: terminal=NAME -->          runs in another shell; each shell keeps its directory and environment
    <!-- run: background -->             leaves the last command running until the page ends
    <!-- run: covered-by=./test.sh -->   is not executed here: ./test.sh executes it
    <!-- file: NAME -->                  writes the block, of any language, to NAME in the directory of the shell

Output is compared line by line. `...` alone in a line stands for any lines, `...` within a line for any text, blanks
for any number of blanks. A number matches if it differs by at most one unit of the last decimal shown; an integer must
be equal.
"""

from .blocks import Block, PageError, blocks
from .compare import mismatch
from .page import Difference, run_page

__all__ = ["Block", "Difference", "PageError", "blocks", "mismatch", "run_page"]
