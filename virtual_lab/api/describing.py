"""Descriptions of public functions, read from signature and docstring in the source.

No module of a function is imported, so that help and completion load nothing heavy.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from textwrap import dedent
from typing import Any, Literal

from virtual_lab.errors import nearest
from virtual_lab.parameters import (
    ANYTHING,
    PLAIN,
    ParameterRule,
    read_callable,
    rule_of,
    several,
)

# modules that define types of parameters, and load fast
TYPES = (
    "virtual_lab.parameters",
    "virtual_lab.files.folders",
    "virtual_lab.sheets",
    "virtual_lab.api.clip_statements",
)
CALLED = ParameterRule(read=read_callable, allowed="a function that is called with a sentence")
BY_NAME = {kind.__name__: rule for kind, rule in PLAIN.items()} | {"Progress": CALLED}


class Unread:
    """A default value that is not a literal, represented by its source text."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text


REQUIRED = inspect.Parameter.empty


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterDescription:
    """A parameter of a public function, as its signature and docstring describe it."""

    name: str
    annotation: str = "Path"
    rule: ParameterRule
    optional: bool = True  # whether None is allowed
    default: Any  # REQUIRED, a literal, or `Unread`
    keyword: bool
    words: str

    @property
    def unit(self) -> str:
        """The unit of the numbers: of the type, or in brackets in the description."""
        stated = re.search(r"\[([^\[\] ]+)\]", self.words)
        return self.rule.unit or (stated[1] if stated and self.rule.kind == "number" else "")

    @property
    def signature_parameter(self) -> inspect.Parameter:
        """The parameter of the signature."""
        kind = (
            inspect.Parameter.KEYWORD_ONLY
            if self.keyword
            else inspect.Parameter.POSITIONAL_OR_KEYWORD
        )
        return inspect.Parameter(self.name, kind, default=self.default, annotation=self.annotation)


@dataclass(frozen=True)
class Description:
    """A public function: its docstring and its parameters keyed by name."""

    doc: str
    parameters: Mapping[str, ParameterDescription]
    # parameter that takes further values of the last positional one, *more; empty: none
    more: str = ""

    @cached_property
    def signature(self) -> inspect.Signature:
        """The signature of the function."""
        signed = [each.signature_parameter for each in self.parameters.values()]
        if self.more:
            place = sum(not each.keyword for each in self.parameters.values())
            annotation = signed[place - 1].annotation
            more = inspect.Parameter(
                self.more, inspect.Parameter.VAR_POSITIONAL, annotation=annotation
            )
            signed.insert(place, more)
        return inspect.Signature(signed)

    @property
    def words(self) -> str:
        """The docstring before its first section."""
        return re.split(r"\n+\w[\w ]*\n-+\n", self.doc)[0].strip()


@cache
def describe(module: str, name: str) -> Description:
    """Return docstring and parameters of a function, read from its source without importing it.

    `name` is the name of a function in the module `module`, or ``Class.method``. Raises
    `FileNotFoundError` for an unknown module, and `ValueError` if there is no such function or no
    docstring.
    """
    (function,) = ast.parse(_header(module, name)).body
    assert isinstance(function, ast.FunctionDef)
    doc = inspect.cleandoc(ast.get_docstring(function) or "")
    words = dict(_sentences(doc))
    arguments = function.args
    by_place = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(by_place) - len(arguments.defaults)) + [*arguments.defaults]
    every = [
        *((each, default, False) for each, default in zip(by_place, defaults, strict=True)),
        *(
            (each, default, True)
            for each, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
        ),
    ]
    return Description(
        doc,
        {
            each.arg: ParameterDescription(
                name=each.arg,
                annotation=ast.unparse(each.annotation) if each.annotation else "",
                rule=_rule(each.annotation),
                optional="None" in ast.unparse(each.annotation or ast.Constant("")).split(" | "),
                default=REQUIRED if default is None else _value(default),
                keyword=keyword,
                words=words.get(each.arg, ""),
            )
            for each, default, keyword in every
        },
        more=arguments.vararg.arg if arguments.vararg else "",
    )


def advice(rule: ParameterRule, value: Any) -> str:
    """Return the part of an error message that states which values a rule allows.

    An example is ``did you mean r161? allowed: …``. The question is left out if `value` is not a
    string, or if no allowed name is similar to it.
    """
    hint = nearest(value, rule.complete()) if isinstance(value, str) else ""
    return f"{hint}allowed: {rule.allowed}"


def first_line(module: str, name: str) -> str:
    """Return the first line of a function's docstring, read without importing its module.

    `name` is the name of a function in the module `module`, or ``Class.method``. Raises
    `FileNotFoundError` for an unknown module, and `ValueError` if there is no such function or no
    docstring.
    """
    return _header(module, name).split('"""')[1].split("\n")[0]


def _header(module: str, name: str) -> str:
    """Return the source text of a function up to the end of its docstring.

    Raises `ValueError` if it has no docstring.
    """
    text = _source(module).read_text(encoding="utf-8")
    start = rf"^ *def {name.rsplit('.', maxsplit=1)[-1]}\("
    # A function without a docstring must not get the docstring of the next function.
    header = re.search(rf'{start}(?:(?!^ *def ).)*?""".*?"""', text, flags=re.DOTALL | re.MULTILINE)
    if header is None:
        raise ValueError(f"{module} has no function {name} with a docstring")
    return dedent(header[0])


def _source(module: str) -> Path:
    """Return the file of a module, without importing any of its packages."""
    top, *parts = module.split(".")
    spec = find_spec(top)
    assert spec is not None, module
    origin = Path(str(spec.origin))
    if not parts:
        return origin
    path = origin.parent.joinpath(*parts)
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _rule(annotation: ast.expr | None) -> ParameterRule:
    """Return the rule of an annotation, ignoring None; `ANYTHING` for a type without a rule."""
    match annotation:
        case ast.BinOp(left=left, right=right):
            parts = [part for part in (left, right) if ast.unparse(part) != "None"]
            return _rule(parts[0]) if len(parts) == 1 else ANYTHING
        case ast.Subscript(value=ast.Name("Literal"), slice=values):
            return rule_of(Literal[ast.literal_eval(values)])
        case ast.Subscript(value=ast.Name("Sequence" | "list"), slice=of_one):
            rule = _rule(of_one)
            return rule if rule is ANYTHING else several(rule)
        case ast.Name(name) if name in BY_NAME:
            return BY_NAME[name]
        case ast.Name(name):
            return rule_of(_value_of_name(name))
    return ANYTHING


def _value_of_name(name: str) -> Any:
    """Return the value called `name` in the modules of types, or None."""
    values = (getattr(module, name, None) for module in map(import_module, TYPES))
    return next((each for each in values if each is not None), None)


def _value(default: ast.expr) -> Any:
    constant = _value_of_name(default.id) if isinstance(default, ast.Name) else None
    if constant is not None:
        return constant
    try:
        return ast.literal_eval(default)
    except ValueError:
        return Unread(ast.unparse(default))


def _sentences(doc: str) -> Iterator[tuple[str, str]]:
    """Yield name and description of each parameter of a numpydoc docstring."""
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=\n\n\S+\n-+\n|\Z)", doc, re.DOTALL | re.MULTILINE
    )
    for match in re.finditer(
        r"^(\S.*)\n((?:(?: .*)?\n?)*)", section[1] if section else "", re.MULTILINE
    ):
        for name in match[1].split(","):
            yield name.strip(), inspect.cleandoc(match[2])
