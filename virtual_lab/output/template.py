"""Loading of page templates."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Template


@cache
def page_template(package: str, name: str) -> Template:
    """Return the Jinja template `name` of a Python package. It is loaded only once.

    Values are escaped when the template is rendered, and a missing value raises
    `jinja2.UndefinedError`. Raises `jinja2.TemplateNotFound` if the package has no such template.
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
