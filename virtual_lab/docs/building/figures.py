"""The figures of the gallery: their look, and how the gallery finds them."""

import ast
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
    """Save the figures among a script's names; its docstring is their alternative text.

    The alternative text is the docstring without its first paragraph. The gallery's own scraper
    knows only figures of pyplot, and the package makes none. Raises `ValueError` for a script
    without a figure, and `IndexError` for a docstring of one paragraph.
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
    """Set the look of the site, silence the lines of progress, and close the last figures."""
    progress.PIPE_STEP = TIMEOUT_MAX
    plt.close("all")
    mpl.rc_file(STYLE)
