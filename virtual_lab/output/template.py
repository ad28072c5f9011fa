"""Loading of page templates."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Template


@cache
def page_template(package: str, name: str) -> Template:
    """Return the Jinja template `name` of a Python package. Later calls return the same object.

    Raises `jinja2.TemplateNotFound` if the package has no such template. When the template is
    filled in, the special characters of HTML in each value are escaped. A missing value then raises
    `jinja2.UndefinedError`.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(package),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)
