"""The kernels that execute the pages: the output of a command as one text, and no notice.

A notebook kernel sends the output in pieces of a hundred characters. Without this change, a page
would break the line between two pieces. A kernel whose messages are not encrypted prints a notice.
"""

from functools import partial

from jupyter_cache.executors import utils
from nbclient import execute
from sphinx.application import Sphinx
from traitlets.config import Config

PRIVATE = Config(KernelManager={"transport_encryption": "auto"})


def setup(_app: Sphinx) -> dict[str, bool]:
    """Make Sphinx join the pieces of a command's output, and encrypt the messages of its kernel.

    The result states that Sphinx may process pages in parallel.
    """
    utils.executenb = partial(execute, coalesce_streams=True, config=PRIVATE)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
