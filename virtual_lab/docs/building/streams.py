"""The output of a command as one text.

A notebook kernel sends the output in pieces of a hundred characters. Without this change, a page
would break the line between two pieces.
"""

from functools import partial

from jupyter_cache.executors import utils
from nbclient import execute
from sphinx.application import Sphinx


def setup(_app: Sphinx) -> dict[str, bool]:
    """Make Sphinx join the pieces of a command's output when Sphinx executes a page.

    The result states that Sphinx may process pages in parallel.
    """
    utils.executenb = partial(execute, coalesce_streams=True)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
