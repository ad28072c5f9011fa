"""Commands made from the signatures and docstrings of public functions.

An option has the name, the default, the rule and the description of its parameter. Only options
that the user gives are passed on, so defaults are defined in the function alone. The help of a
command does not import the module of its function.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from virtual_lab import api
from virtual_lab.api.describing import (
    REQUIRED,
    Description,
    ParameterDescription,
    advice,
    describe,
    first_line,
)
from virtual_lab.api.door import LABORATORY, SEALED, public, with_settings
from virtual_lab.cli.plumbing import Output
from virtual_lab.errors import InputError, nearest
from virtual_lab.output.progress import Progress
from virtual_lab.parameters import ANYTHING, SETTINGS, ParameterRule

GIVEN = (ParameterSource.COMMANDLINE, ParameterSource.DEFAULT_MAP)
OUTPUT = ("as_json", "out", "csv", "plot")
UNSAVED = ("self", "folder", "overwrite")  # parameters of a result's `save` that are not options
HIDDEN = ("progress",)  # parameters that the shell provides itself
GENERAL = ("FILE", "FOLDER", "NAME", "TEXT", "NUMBER")  # value names that several parameters share
TYPED = "bool, int, float, str, Path, Literal of texts, Sequence of one, or virtual_lab.parameters"
Place = str | tuple[str, str]  # a public name, or module and name of another function


class RuleType(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.2 on only
    """The click type of a value that is checked by the rule of its parameter."""

    def __init__(self, rule: ParameterRule) -> None:
        self.rule, self.name = rule, rule.metavar

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a word of the command line or a value of a file as the function's argument."""
        try:
            return self.rule.read(self.rule.parse(value) if isinstance(value, str) else value)
        except InputError:
            raise
        except (TypeError, ValueError, OverflowError):
            self.fail(f"{value!r}; {advice(self.rule, value)}", param, ctx)

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str | None:
        """Return the placeholder of a value in the help; None for the name of the argument."""
        word = self.rule.metavar
        general = word in GENERAL or word.startswith("[")
        return None if isinstance(param, click.Argument) and general else word

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete the names or words that the rule knows."""
        if self.rule.metavar in ("FILE", "FOLDER"):
            return [CompletionItem(incomplete, type="file" if self.name == "FILE" else "dir")]
        return [
            CompletionItem(word) for word in self.rule.complete() if word.startswith(incomplete)
        ]


class Flag(click.Option):
    """A flag with a ``--no-`` form, which overrides a value from a file.

    The help shows this form only if it is needed.
    """

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Return the help, with the ``--no-`` form for a flag that is on by default."""
        if self.default:
            forms = f"{self.opts[0]} / {self.secondary_opts[0]}"
            return forms, f"{self.help}  [default: {self.opts[0]}]"
        return self.opts[0], str(self.help)


NOTHING: Mapping[str, Any] = {}
PRINTED = Output()


class FunctionCommand(click.Command):
    """The command of a public function, described by its signature and docstring.

    Parameters
    ----------
    name
        Name of the command.
    place
        Public name of the function, or its module and its name in this module. By default the name
        of the command, with underscores.
    example
        Arguments of an example, which is printed at the end of the help.
    fixed
        Arguments that the command sets itself.
    options
        Positional parameters that are options of the command.
    saving
        Method that saves the result, as ``Class.method``. Its parameters are options too.
    output
        Options and actions for printing and saving the result.
    """

    def __init__(
        self,
        name: str,
        place: Place = "",
        *,
        example: str = "",
        fixed: Mapping[str, Any] = NOTHING,
        options: Sequence[str] = (),
        saving: str = "",
        output: Output = PRINTED,
    ) -> None:
        words = f"\b\nExample:\n  virtual-lab {example}" if example else None
        super().__init__(name, callback=self._run, epilog=words)
        self.example = example
        del self.params, self.help  # __getattr__ makes them at their first use
        self.place, self.fixed, self.options = place or name.replace("-", "_"), fixed, options
        self.saving, self.output = saving, output

    def __getattr__(self, name: str) -> Any:
        """Make options or help at their first use, because most runs use only one command."""
        if name == "help":
            self.help = for_shell(_description(self.place).words)
        elif name == "params":
            self.params = [
                *(_parameter(each, self.options) for each in self.parameters.values()),
                *self.output.options(self.parameters),
                self._config(),
            ]
        else:
            raise AttributeError(name)
        return vars(self)[name]

    def get_short_help_str(self, limit: int = 45) -> str:
        """Return the first line of the docstring."""
        return for_shell(first_line(*_place(self.place)))

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a table of the arguments before that of the options."""
        rows = [
            (each.make_metavar(ctx), help_text(self.parameters[str(each.name)]))
            for each in self.params
            if isinstance(each, click.Argument)
        ]
        if rows:
            with formatter.section("Arguments"):
                formatter.write_dl(rows)
        super().format_options(ctx, formatter)

    @cached_property
    def parameters(self) -> dict[str, ParameterDescription]:
        """The parameters that are arguments or options, by their names in Python."""
        left_out = (*HIDDEN, self.output.into, *self.fixed)
        every = dict(_description(self.place).parameters)
        every |= self._saving
        return {key: each for key, each in every.items() if key not in left_out}

    def require_rules(self) -> None:
        """Raise `ValueError` for a function without docstring, or a parameter without a rule."""
        self.get_short_help_str()
        for key, each in self.parameters.items():
            if (each.rule.several or each.rule) is ANYTHING:
                annotation = each.annotation or "missing"
                raise ValueError(f"the type of {key} has no rule ({annotation}); allowed: {TYPED}")

    @cached_property
    def _saving(self) -> Mapping[str, ParameterDescription]:
        """The parameters of the method that saves the result."""
        if not self.saving:
            return {}
        module, _ = api.PLACES[self.saving.split(".")[0]]
        every = describe(module, self.saving).parameters
        return {key: each for key, each in every.items() if key not in UNSAVED}

    def _run(self, **values: Any) -> int:
        """Call the function with the user's arguments, and write its result."""
        context = click.get_current_context()
        request = {
            key: value
            for key, value in values.items()
            if key in self.parameters and context.get_parameter_source(key) in GIVEN
        }
        place = self.place
        how = {key: request.pop(key) for key in self._saving if key in request}
        _check_saving(how)

        def call(progress: Progress, **more: Any) -> Any:
            function = getattr(api, place) if isinstance(place, str) else public(place[1], place)
            if "progress" in _description(place).parameters:
                more["progress"] = progress
            result = function(**self.fixed, **request, **more)
            words = f"virtual-lab {_words(context)} --config {SETTINGS}"
            result = replace(result, **how) if how else result
            return with_settings(result, words, request | how, sealed=self.name in SEALED)

        defaults = {key: each.default for key, each in self.parameters.items()}
        shared = {key: value for key, value in values.items() if key in OUTPUT}
        return self.output.execute(call, request, defaults, **shared)

    def _config(self) -> click.Option:
        """Return the option of a file that contains values for the other options."""

        def load(context: click.Context, _param: click.Parameter, path: Path | None) -> None:
            if path is not None:
                context.default_map = settings_in(path, str(self.name), self.parameters)

        return click.Option(
            ["--config"],
            type=click.Path(path_type=Path),
            metavar="FILE",
            is_eager=True,
            expose_value=False,
            callback=load,
            help="A .toml file with values for these options. Its keys are the names of the "
            "parameters in Python. Options on the command line override the file.",
        )


def _words(context: click.Context) -> str:
    """Return the full name of a command after the program's name, such as ``campaign summary``."""
    above = context.parent
    return f"{_words(above)} {context.info_name}".strip() if above else ""


def _place(place: Place) -> tuple[str, str]:
    """Return module and name of a function."""
    return api.PLACES[place] if isinstance(place, str) else place


def _description(place: Place) -> Description:
    return describe(*_place(place))


def _parameter(each: ParameterDescription, options: Sequence[str]) -> click.Parameter:
    """Return the argument or option of a parameter."""
    rule = each.rule.several or each.rule
    required = each.default is REQUIRED
    if not each.keyword and each.name not in options:
        nargs = -1 if each.rule.several else 1
        return click.Argument([each.name], type=RuleType(rule), nargs=nargs, required=required)
    name = each.name.removesuffix("s") if each.rule.several else each.name
    form, words = f"--{name.replace('_', '-')}", help_text(each)
    if rule.flag:
        forms = f"{form}/--no-{form.removeprefix('--')}"
        return Flag([forms, each.name], default=bool(each.default), help=words)
    return click.Option(
        [form, each.name],
        type=RuleType(rule),
        multiple=each.rule.several is not None,
        required=required,
        help=words,
    )


def _check_saving(how: Mapping[str, Any]) -> None:
    """Refuse impossible options for saving a certificate, before the test begins."""
    if how.get("pdf"):
        from virtual_lab.certificate.pdf import require_pdf

        require_pdf(how.get("paper", "a4"))
    if how.get("sign"):
        from virtual_lab.certificate.signing import require_key

        require_key(how["sign"], private=True)


def settings_in(
    path: Path, name: str, parameters: Mapping[str, ParameterDescription]
) -> dict[str, Any]:
    """Return the values in a file of settings, keyed by parameter name.

    If a parameter takes several values, a single value becomes a list. The values of the key
    ``instruments`` are not checked. `name` is the name of the command in the error message.

    Raises `InputError` if the file is missing or not TOML, and for an unknown key or a value that
    is not allowed. The message names file and key.
    """
    from virtual_lab.files import parse_toml, read_text

    settings = parse_toml(read_text(path), str(path))
    for key, value in settings.items():
        if key not in parameters:
            allowed = f"unknown key, {nearest(key, parameters)}keys of {name}: "
            raise InputError(str(path), key, None, allowed + ", ".join(parameters))
        rule = parameters[key].rule
        try:
            if key != LABORATORY:  # a string NAME=FILE in a file, a sheet in Python
                rule.read(value)
        except (TypeError, ValueError, OverflowError) as fault:
            raise InputError(str(path), key, value, advice(rule, value)) from fault
        if rule.several and not isinstance(value, list):
            settings[key] = [value]
    return settings


def help_text(each: ParameterDescription) -> str:
    """Return the help text of a parameter.

    It is the first paragraph of the parameter's description, followed by the choices and the
    default value, if there are any.
    """
    words = for_shell(each.words.split("\n\n")[0])
    if each.rule.several and each.keyword:
        words = f"{words} May be given several times."
    if not each.keyword and each.rule.metavar.startswith("["):
        words = f"{words}  {each.rule.metavar}"
    if each.rule.flag or each.default in (REQUIRED, None, (), ""):
        return words
    values = each.default if isinstance(each.default, tuple) else (each.default,)
    return f"{words}  [default: {', '.join(map(str, values))}]"


def for_shell(words: str) -> str:
    """Return a docstring's text without backticks, as the help shows it."""
    return re.sub(r"``(.*?)``|`~?(.*?)`", lambda match: match[1] or match[2], words)
