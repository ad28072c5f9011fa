"""The figures of the gallery: their style, and the function with which the gallery saves them."""

import ast
import gc
from pathlib import Path
from threading import TIMEOUT_MAX
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

from virtual_lab.output import progress

STYLE = Path(__file__).parents[1] / "matplotlibrc"


def scrape(_block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save all figures that a gallery script made; return the reStructuredText that shows them.

    The alternative text of the figures is the script's docstring without its first paragraph. The
    gallery's standard function is not used because it finds only figures of pyplot, and this
    package makes none. Raises `ValueError` for a script without a figure, and `IndexError` for a
    docstring of one paragraph.
    """
    names = block_vars["example_globals"]
    words = ast.get_docstring(ast.parse(Path(block_vars["src_file"]).read_text("utf-8"))) or ""
    caption = " ".join(words.split("\n\n", 1)[1].split())
    paths = []
    for figure in {id(each): each for each in names.values() if isinstance(each, Figure)}.values():
        paths.append(next(block_vars["image_path_iterator"]))
        figure.savefig(paths[-1])
    if not paths:
        raise ValueError(f"{block_vars['src_file']} has no figure")
    return str(figure_rst(paths, gallery_conf["src_dir"], caption))


def reset(_gallery_conf: dict[str, Any], _script: str) -> None:
    """Set the style of the site's figures, switch off progress messages, and close all figures.

    The gallery calls this function before each script. Both arguments are ignored.
    """
    gc.freeze()  # the gallery collects garbage before each script, among all objects of Sphinx
    progress.PIPE_STEP = TIMEOUT_MAX
    plt.close("all")
    mpl.rc_file(STYLE)
