"""A command: a public function, and how its result is printed and saved.

The parameters of a command are read from signature and docstring of its function, without
importing the function's module. They are made at their first use, because most runs use only one
command.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from virtual_lab import api
from virtual_lab.api.describing import Description, ParameterDescription, describe, first_line
from virtual_lab.api.door import PROGRESS, public
from virtual_lab.commands.output import DRAWN, Output
from virtual_lab.parameters import ANYTHING

HIDDEN = (PROGRESS, "out")  # parameters that the program sets itself
UNSAVED = ("self", "folder", "overwrite")  # parameters of a result's `save` that are not options
TYPED = "bool, int, float, str, Path, Literal of texts, Sequence of one, or virtual_lab.parameters"


@dataclass(frozen=True, kw_only=True, eq=False)
class Command:
    """A command, described by the signature and docstring of its function.

    Parameters
    ----------
    name
        Name of the command, such as ``certify`` or ``campaign summary``.
    place
        Public name of the function, or its module and its name in this module. By default the name
        of the command, with underscores.
    example
        Arguments of an example, without the command's name.
    question
        Question that the command answers, if many users ask it.
    options
        Positional parameters that are options of the command.
    saving
        Method that saves the result, as ``Class.method``. Its parameters are options too.
    output
        How the result is printed and saved. By default it is that of a study.
    require
        Function that raises `InputError` for values that the command would refuse after its start.
    variants
        Further commands whose names begin with the name of this one.
    words
        Description of a command that has variants, but no function of its own.
    """

    name: str = field(kw_only=False)
    place: str | tuple[str, str] = field(default="", kw_only=False)
    example: str = ""
    question: str = ""
    options: Sequence[str] = ()
    saving: str = ""
    output: Output = DRAWN
    require: Callable[[Mapping[str, Any]], None] = lambda values: None
    variants: Sequence[Command] = ()
    words: str = ""

    @property
    def example_line(self) -> str:
        """The example with the name of the command, for the end of the help."""
        return f"{self.name} {self.example}" if self.example else ""

    @property
    def public_name(self) -> str:
        """Name of the function in `virtual_lab`; empty for a function of another module."""
        place = self.place or self.name.replace("-", "_")
        return place if isinstance(place, str) else ""

    @property
    def location(self) -> tuple[str, str]:
        """Module and name of the function."""
        return self.place if isinstance(self.place, tuple) else api.PLACES[self.public_name]

    @property
    def function(self) -> Callable[..., Any]:
        """The function, which reads its arguments by their rules."""
        if self.public_name:
            return getattr(api, self.public_name)  # type: ignore[no-any-return]
        return public(self.location[1], self.location)

    @property
    def first_line(self) -> str:
        """The first line of the docstring."""
        return self.words or first_line(*self.location)

    @property
    def description(self) -> Description:
        """Docstring and parameters of the function."""
        return describe(*self.location)

    @cached_property
    def saved_by(self) -> Mapping[str, ParameterDescription]:
        """The parameters of the method that saves the result."""
        if not self.saving:
            return {}
        module, _ = api.PLACES[self.saving.split(".")[0]]
        every = describe(module, self.saving).parameters
        return {key: each for key, each in every.items() if key not in UNSAVED}

    @cached_property
    def parameters(self) -> Mapping[str, ParameterDescription]:
        """The parameters that a user may set, by their names in Python."""
        left_out = (*HIDDEN, self.output.into)
        every = {**self.description.parameters, **self.saved_by}
        return {key: each for key, each in every.items() if key not in left_out}

    @cached_property
    def fields(self) -> Mapping[str, ParameterDescription]:
        """The parameters, and after them folder and files of the result."""
        return {**self.parameters, **self.output.parameters(self.parameters)}

    def takes(self, kinds: Collection[str]) -> bool:
        """Return whether the first parameter is one or more folders of one of the kinds alone."""
        first = next((each.rule.holds for each in self.parameters.values()), ())
        return len(first) == 1 and first[0] in kinds

    def takes_position(self, key: str) -> bool:
        """Return whether a parameter is an argument without an option's name at the shell."""
        return not self.fields[key].keyword and key not in self.options

    def option(self, key: str) -> str:
        """Return the name of a parameter's option at the shell, without its dashes."""
        name = key.removesuffix("s") if self.fields[key].rule.several else key
        return name.replace("_", "-")

    def require_rules(self) -> None:
        """Raise `ValueError` for a function without docstring, or a parameter without a rule."""
        assert self.first_line
        for key, each in self.parameters.items():
            if (each.rule.several or each.rule) is ANYTHING:
                annotation = each.annotation or "missing"
                raise ValueError(f"the type of {key} has no rule ({annotation}); allowed: {TYPED}")
