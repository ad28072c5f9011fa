"""Loading of page templates."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Template


@cache
def page_template(package: str, name: str, shared: str = "") -> Template:
    """Return the Jinja template `name` of a Python package. Later calls return the same object.

    It may include templates of its package, and of the package `shared` if there is one. Raises
    `jinja2.TemplateNotFound` if neither has such a template. When the template is filled in, the
    special characters of HTML in each value are escaped. A missing value then raises
    `jinja2.UndefinedError`.
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(each) for each in (package, shared) if each]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)
