"""Types and defaults of parameters, which the docstrings leave to the signature."""

import inspect
import re
import typing
from importlib import import_module
from typing import Any

from sphinx.application import Sphinx

from virtual_lab.api.describing import TYPES

LONGEST = 70  # longest signature that is shown in full [characters]
NAMES = {name: kind for module in TYPES for name, kind in vars(import_module(module)).items()}


def type_and_default(parameter: inspect.Parameter) -> str:
    """Return type and default of a parameter, such as ``int, default: 0``.

    A name such as ``Seed`` is replaced by its type, without the rule. A parameter whose
    default is None or a function is called *optional*.
    """

    def plain(match: re.Match[str]) -> str:
        meant = NAMES.get(match[0])
        if typing.get_origin(meant) in (typing.Annotated, typing.Literal):
            meant = typing.get_args(meant)[0] if hasattr(meant, "__metadata__") else meant
            text = meant.__name__ if isinstance(meant, type) else str(meant)
            return re.sub(r"\b(?:[a-z_]+\.)+(?=[A-Z])", "", text).replace("Literal[", "one of [")
        return match[0]

    parts = re.sub(r"\b\w+\b", plain, str(parameter.annotation)).split(" | ")
    kind = " | ".join(part for part in dict.fromkeys(parts) if part != "None")
    if parameter.default is parameter.empty:
        return kind
    if parameter.default is None or kind.startswith(("Progress", "Callable")):
        return f"{kind}, optional"
    return f"{kind}, default: {parameter.default!r}"


def _add_kinds(
    _app: Sphinx, what: str, _name: str, thing: Any, _options: object, lines: list[str]
) -> None:
    """Add a type to each parameter of a docstring before it is read."""
    function = thing.__init__ if what == "class" else thing
    if what not in ("function", "method") or "Parameters" not in lines:
        return
    parameters = inspect.signature(function).parameters
    first = lines.index("Parameters") + 2
    for number, line in enumerate(lines[first:], first):
        if number > first and lines[number + 1 : number + 2] and set(lines[number + 1]) == {"-"}:
            return
        named = [name.strip(" *") for name in line.split(",")]
        if line[:1].strip() and named[0] in parameters:
            kinds = dict.fromkeys(type_and_default(parameters[each]) for each in named)
            lines[number] = f"{line} : {'; '.join(kinds)}"


def _shorten(
    _app: Sphinx, what: str, _name: str, thing: Any, _options: object, signature: str, _: str
) -> tuple[str, str] | None:
    """Return a long signature without its keywords, which the list of parameters has."""
    if what not in ("function", "method") or len(signature or "") <= LONGEST:
        return None
    parameters = inspect.signature(thing).parameters.values()
    names = [each.name for each in parameters if each.kind is each.POSITIONAL_OR_KEYWORD]
    return f"({', '.join([*names, '…'])})", ""


def setup(app: Sphinx) -> dict[str, bool]:
    """Let Sphinx add types to parameters, before numpydoc reads the docstring.

    The result states that Sphinx may process pages in parallel.
    """
    app.connect("autodoc-process-docstring", _add_kinds, priority=400)
    app.connect("autodoc-process-signature", _shorten)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
