"""Commands of the command line, made from the rows of the table of commands.

An option has the name, the default, the rule and the description of its parameter. Only options
that the user gives are passed on, so defaults are defined in the function alone. The help of a
command does not import the module of its function.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from virtual_lab.api.describing import REQUIRED, ParameterDescription
from virtual_lab.commands.call import Call, read_value, settings_in
from virtual_lab.commands.command import Command
from virtual_lab.commands.output import Answer
from virtual_lab.commands.running import CallOutcome, carry_out
from virtual_lab.errors import IncompleteError, InputError
from virtual_lab.output.progress import show_progress
from virtual_lab.parameters import ParameterRule

GIVEN = (ParameterSource.COMMANDLINE, ParameterSource.DEFAULT_MAP)
JSON = "Print the result as one JSON document."
GENERAL = ("FILE", "FOLDER", "NAME", "TEXT", "NUMBER")  # value names that several parameters share


class RuleType(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.2 on only
    """The click type of a value that is checked by the rule of its parameter."""

    def __init__(self, rule: ParameterRule) -> None:
        self.rule, self.name = rule, rule.metavar

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a word of the command line or a value of a file as the function's argument."""
        try:
            return read_value(self.rule, value)
        except InputError:
            raise
        except ValueError as fault:
            self.fail(str(fault), param, ctx)

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str | None:
        """Return the placeholder of a value in the help; None for the name of the argument."""
        word = self.rule.metavar
        general = word in GENERAL or self.rule.kind == "choice"
        return None if isinstance(param, click.Argument) and general else word

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete the names or words that the rule knows."""
        if self.rule.kind in ("file", "clip", "folder"):
            kind = "dir" if self.rule.kind == "folder" else "file"
            return [CompletionItem(incomplete, type=kind)]
        return [
            CompletionItem(word, help=title or None)
            for word, title in self.rule.complete().items()
            if word.startswith(incomplete)
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


class FunctionCommand(click.Command):
    """A command of the table, with its options and its help.

    These are made at their first use, because most runs use only one command.
    """

    def __init__(self, command: Command) -> None:
        line = command.example_line
        words = f"\b\nExample:\n  virtual-lab {line}" if line else None
        super().__init__(command.name.split()[-1], callback=self._run, epilog=words)
        del self.params, self.help  # __getattr__ makes them at their first use
        self.command = command

    def __getattr__(self, name: str) -> Any:
        """Make options or help at their first use."""
        if name == "help":
            self.help = for_shell(self.command.description.words)
        elif name == "params":
            self.params = [
                *(_parameter(each, self.command) for each in self.command.fields.values()),
                click.Option(["--json", "as_json"], is_flag=True, help=JSON),
                self._config(),
            ]
        else:
            raise AttributeError(name)
        return vars(self)[name]

    def get_short_help_str(self, limit: int = 45) -> str:
        """Return the first line of the docstring."""
        return for_shell(self.command.first_line)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a table of the arguments before that of the options."""
        rows = [
            (each.make_metavar(ctx), help_text(self.command.parameters[str(each.name)]))
            for each in self.params
            if isinstance(each, click.Argument)
        ]
        if rows:
            with formatter.section("Arguments"):
                formatter.write_dl(rows)
        super().format_options(ctx, formatter)

    def call(self, context: click.Context) -> Call:
        """Return the call that a line states, which click has read."""
        given = {
            key: value
            for key, value in context.params.items()
            if key in self.command.fields and context.get_parameter_source(key) in GIVEN
        }
        return Call(self.command, given)

    def _run(self, *, as_json: bool, **_: Any) -> int:
        """Call the function with the user's arguments, print its result, return the exit code."""
        with show_progress() as progress:
            outcome = carry_out(self.call(click.get_current_context()), progress)
        _print(outcome, self.command, as_json=as_json)
        if outcome.missing:
            raise IncompleteError(str(outcome.target), [*outcome.missing])
        return int(getattr(outcome.result, "code", 0))

    def _config(self) -> click.Option:
        """Return the option of a file that contains values for the other options."""

        def load(context: click.Context, _param: click.Parameter, path: Path | None) -> None:
            if path is not None:
                parameters = self.command.parameters
                context.default_map = settings_in(path, str(self.name), parameters)

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


def click_command(command: Command) -> click.Command:
    """Return the command of a row of the table. Its variants become a group."""
    variants = [*map(click_command, command.variants)]
    if not variants:
        return FunctionCommand(command)
    if command.words:
        return click.Group(command.name, commands=variants, help=command.words)
    alone = FunctionCommand(command)

    @click.pass_context
    def run(context: click.Context, /, **values: Any) -> int | None:
        """Run the command itself if no variant is named."""
        return None if context.invoked_subcommand else alone._run(**values)

    return click.Group(
        command.name,
        callback=run,
        commands=variants,
        params=alone.params,
        help=alone.help,
        epilog=alone.epilog,
        invoke_without_command=True,
    )


def _parameter(each: ParameterDescription, command: Command) -> click.Parameter:
    """Return the argument or option of a parameter."""
    rule = each.rule.several or each.rule
    required = each.default is REQUIRED
    if command.takes_position(each.name):
        nargs = -1 if each.rule.several else 1
        return click.Argument([each.name], type=RuleType(rule), nargs=nargs, required=required)
    form, words = f"--{command.option(each.name)}", help_text(each)
    if rule.kind == "flag":
        forms = f"{form}/--no-{form.removeprefix('--')}"
        return Flag([forms, each.name], default=bool(each.default), help=words)
    written = each.name not in command.parameters  # a folder or file of the result
    return click.Option(
        [form, each.name],
        type=click.Path(path_type=Path) if written else RuleType(rule),
        metavar=rule.metavar if written else None,
        multiple=each.rule.several is not None,
        required=required,
        help=words,
    )


def _print(outcome: CallOutcome, command: Command, *, as_json: bool) -> None:
    """Print the result, and the paths of all written files.

    If JSON is printed, the path of the folder is the key `folder` of the document, or a line on
    stderr if the document is not an object.
    """
    result, output, written = outcome.result, command.output, [*outcome.files]
    folder = None if output.file else outcome.target
    if not as_json:
        if isinstance(result, Answer) and result.files:
            written = [*result.files, *written]
        elif outcome.target:
            page = outcome.target / output.page
            shown = folder and not outcome.missing and page.exists()
            written.insert(len(written) if output.file else 0, page if shown else outcome.target)
        parts = [result.text, "\n".join(map(str, written))]
        click.echo("\n\n".join(part for part in parts if part))
        return
    document = result.document
    if folder and isinstance(document, dict):
        document = {**document, "folder": str(folder)}
    elif folder:
        written.insert(0, folder)
    click.echo(json.dumps(document, indent=2, allow_nan=False))
    for path in written:
        click.echo(str(path), err=True)


def help_text(each: ParameterDescription) -> str:
    """Return the help text of a parameter.

    It is the first paragraph of the parameter's description, followed by the choices and the
    default value, if there are any.
    """
    words = for_shell(each.words.split("\n\n")[0])
    if each.rule.several and each.keyword:
        words = f"{words} May be given several times."
    if not each.keyword and each.rule.kind == "choice":
        words = f"{words}  {each.rule.metavar}"
    notes = [each.rule.limits] if each.rule.limits and each.rule.limits not in words else []
    if each.rule.kind != "flag" and each.default not in (REQUIRED, None, (), ""):
        values = each.default if isinstance(each.default, tuple) else (each.default,)
        notes.append(f"default: {', '.join(map(str, values))}")
    return f"{words}  [{'; '.join(notes)}]" if notes else words


def for_shell(words: str) -> str:
    """Return a docstring's text without backticks, as the help shows it."""
    return re.sub(r"``(.*?)``|`~?(.*?)`", lambda match: match[1] or match[2], words)
