"""Cells with commands. A page shows the command without the line that starts a shell."""

from docutils import nodes
from sphinx.application import Sphinx

SHELL = "%%bash\n"


def _show_as_shell(_app: Sphinx, doctree: nodes.document) -> None:
    for block in doctree.findall(nodes.literal_block):
        text = block.astext()
        if text.startswith(SHELL):
            block["language"] = "bash"
            block.rawsource = text.removeprefix(SHELL)
            block[:] = [nodes.Text(block.rawsource)]


def setup(app: Sphinx) -> dict[str, bool]:
    """Let Sphinx remove the line ``%%bash`` from the commands shown on a page.

    The result states that Sphinx may process pages in parallel.
    """
    app.connect("doctree-read", _show_as_shell)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
