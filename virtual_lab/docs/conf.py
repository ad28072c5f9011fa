"""Settings of the documentation site.

One command builds it, from the root of the repository:

uv run --group docs python -m sphinx -W virtual_lab/docs out/site
"""

import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # for the modules in building/
os.environ["MATPLOTLIBRC"] = str(HERE / "matplotlibrc")  # style of pages and gallery
# commands of pages run in the same environment
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
os.environ["VIRTUAL_LAB_CLONE"] = str(HERE.parents[1])  # where executed pages find tests/ and data/

from virtual_lab.errors import VERSION  # noqa: E402

project = "Virtual lab"
author = "The authors of Virtual lab"
release = version = VERSION
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "building.commands",
    "building.formulas",
    "building.generated",
    "building.kinds",
    "building.offline",
    "building.processes",
    "building.streams",
]
exclude_patterns = [
    "building",
    "scripts",
    *(f"generated/gallery/**.{end}" for end in ("ipynb", "py", "zip")),
]
default_role = "literal"
highlight_language = "text"

html_theme = "pydata_sphinx_theme"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_title = f"Virtual lab {VERSION}"
html_logo = html_favicon = str(HERE.parent / "web" / "templates" / "icon.svg")
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": html_title, "alt_text": "Virtual lab, first page"},
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_context = {"default_mode": "auto"}

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
myst_update_mathjax = False
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 280  # s
nb_output_stderr = "remove"  # lines of progress

autodoc_typehints = "none"  # the Parameters sections have the types
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

sphinx_gallery_conf = {
    "examples_dirs": "scripts",
    "gallery_dirs": "generated/gallery",
    "filename_pattern": "",
    "image_scrapers": ("building.figures.scrape",),
    "reset_modules": ("building.figures.reset",),
    "capture_repr": (),
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "write_computation_times": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "remove_config_comments": True,
    "abort_on_example_error": True,
}
