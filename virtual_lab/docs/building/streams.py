"""The output of a command as one text.

A kernel sends it in pieces of a hundred characters, between which a page would break the line.
"""

from functools import partial

from jupyter_cache.executors import utils
from nbclient import execute
from sphinx.application import Sphinx


def setup(_app: Sphinx) -> dict[str, bool]:
    """Join the pieces where a page is executed."""
    utils.executenb = partial(execute, coalesce_streams=True)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
