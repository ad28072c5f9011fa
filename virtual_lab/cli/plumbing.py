"""Common parts of all commands: output folders, JSON, tables, figures, progress, completion.

A command is a function that returns its result. The result is an object with a `document` for JSON
and a `text` for the terminal, like every `StudyResult`. It also has `save`, `table` and `plot` if
the command has the options for them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import click

from virtual_lab.errors import IncompleteError, InputError, without_if_it_fails
from virtual_lab.files import check_new_folder, check_writable, first_free, new_files
from virtual_lab.output.progress import show_progress
from virtual_lab.parameters import OUT

HELP_WIDTH = 1000  # longest first sentence in a list of commands [characters], never exceeded
LONGEST_NAME = 60  # largest length of a name within a folder's name [characters]
NAMED = ("seed", "number")  # parameters in the name of the default folder, if the user sets them
TABLES, PICTURES = (".csv",), (".png", ".svg", ".pdf")


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Result of a command that is not a `StudyResult`."""

    document: Any
    text: str
    table: Any = None
    code: int = 0  # exit code of the program
    save: Callable[[Path], object] | None = None
    files: Sequence[Path] = field(default_factory=tuple)  # written files; their paths are printed


class Sections(click.Group):
    """A group whose help lists its commands in sections by purpose.

    `others` returns all commands of other packages, or the one with a given name. It takes as long
    as a short command, so it is called only for the help and for a name that is not in the
    sections.
    """

    def __init__(
        self,
        *,
        sections: Mapping[str, Sequence[click.Command]],
        others: Callable[..., Sequence[click.Command]],
        **more: Any,
    ) -> None:
        super().__init__(**more)
        self.sections, self.others = sections, others
        for commands in sections.values():
            for each in commands:
                self.add_command(each)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command by its name, including the commands of other packages."""
        return self.commands.get(cmd_name) or next(iter(self.others(cmd_name)), None)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write one table of commands per section."""
        others = self.others()
        sections = {**self.sections, **({"From other packages": others} if others else {})}
        widest = max(len(str(each.name)) for commands in sections.values() for each in commands)
        for title, commands in sections.items():
            with formatter.section(title):
                rows = [(str(each.name), each.get_short_help_str(HELP_WIDTH)) for each in commands]
                formatter.write_dl([(name.ljust(widest), words) for name, words in rows])


@dataclass(frozen=True, kw_only=True)
class Output:
    """Options of a command for the result of its function: print it, save it, draw it.

    Parameters
    ----------
    folder
        Name of the default folder in ``out/``, with parameters of the command in braces. Or a
        function that returns the folder's path from the parameters. ``--out`` overrides it. Without
        a default folder, results are written only with ``--out``.
    page
        File in the folder. If it is written, its path is printed at the end, instead of the path
        of the folder.
    keeps
        Whether the command has the option ``--out``. With a default folder it always has it.
    table, picture
        Whether the command has ``--csv`` and ``--plot``.
    file
        Description of the .toml file that the command writes instead of a folder.
    into
        Name of the parameter that receives the folder, if the function writes its results itself.
    answer
        Function that converts the result to the `Answer` to print.
    """

    folder: str | Callable[[Mapping[str, Any]], Path] = ""
    page: str = ""
    keeps: bool = False
    table: bool = False
    picture: bool = False
    file: str = ""
    into: str = ""
    answer: Callable[[Any], Any] = lambda result: result

    def options(self, parameters: Collection[str]) -> list[click.Option]:
        """Return the options that are not among the `parameters` of the function."""
        options = []
        path = click.Path(path_type=Path)
        named, required = "FOLDER", bool(self.file or (self.into and not self.folder))
        if self.file:
            named, words = "FILE", self.file
        elif isinstance(self.folder, str) and self.folder:
            usual = re.sub(r"{(\w+)}", lambda key: key[1].upper(), self.folder)
            added = " and ".join(f"-{each}-{each.upper()}" for each in NAMED if each in parameters)
            usual += f", followed by {added} if given" if added else ""
            words = f"New folder for all results.  [default: out/{usual}; -2, -3, … if it exists]"
        else:
            words = "New folder for all results."
        if self.folder or self.keeps or required:
            options.append(
                click.Option(["--out"], type=path, metavar=named, help=words, required=required)
            )
        if self.table:
            words = "Write the table into a new .csv file."
            options.append(click.Option(["--csv"], type=path, metavar="FILE", help=words))
        if self.picture:
            words = "Draw the figure into a new .png, .svg or .pdf file."
            options.append(click.Option(["--plot"], type=path, metavar="FILE", help=words))
        words = "Print the result as one JSON document."
        return [*options, click.Option(["--json", "as_json"], is_flag=True, help=words)]

    def execute(
        self,
        function: Callable[..., Any],
        request: Mapping[str, Any],
        defaults: Mapping[str, Any],
        *,
        as_json: bool,
        out: Path | None = None,
        csv: Path | None = None,
        plot: Path | None = None,
    ) -> int:
        """Call the function, write and print its result, and return the exit code.

        The function takes a `Progress`, and `into` as a keyword argument. `request` holds the
        values that the user gave, and `defaults` the values of the other parameters. Files and
        folders are checked before the function is called.
        """
        target = out
        if target is None and self.folder:
            target = first_free(_usual_folder(self.folder, {**defaults, **request}, request))
        if target is not None and self.file:
            check_new_file(target, (".toml",))
            check_new_file(target.with_suffix(".png"), PICTURES)
        elif target is not None and (self.folder or not self.into):
            check_new_folder(target)
        for path, endings in ((csv, TABLES), (plot, PICTURES)):
            if path is not None:
                check_new_file(path, endings)
        missing: list[str] = []

        def form(path: Path) -> AbstractContextManager[None]:
            """Return a context in which a further file is made; if it fails, the folder is kept."""
            return without_if_it_fails(str(path), missing) if target else nullcontext()

        with show_progress() as progress:
            more = {self.into: target} if self.into else {}
            result = self.answer(function(progress, **more))
            if target is not None and not self.into:
                progress(f"writing {target}")
                try:
                    result.save(target)
                except IncompleteError as fault:
                    missing += fault.missing
            if csv is not None:
                from virtual_lab.files.tables import write_csv

                with form(csv), new_files(csv.parent) as draft:
                    write_csv(result.table, draft / csv.name)
            if plot is not None:
                with form(plot), new_files(plot.parent) as draft:
                    result.plot(draft / plot.name)
        files = [path for path in (csv, plot) if path and path.exists()]
        folder = None if self.file else target
        files += [target] if target and self.file and not as_json else []
        _print(result, folder, "" if missing else self.page, files, as_json=as_json)
        if missing:
            raise IncompleteError(str(target), missing)
        return int(getattr(result, "code", 0))


def _usual_folder(
    folder: str | Callable[[Mapping[str, Any]], Path],
    values: Mapping[str, Any],
    request: Mapping[str, Any],
) -> Path:
    """Return the default folder. Its name has seed and number only if the user gave them."""
    if not isinstance(folder, str):
        return folder(values)
    parts = {key: _part(value) for key, value in values.items() if isinstance(value, str)}
    name = folder.format_map(parts)
    for key in NAMED:
        if key in request:
            name += f"-{key}-{request[key]}"
    return Path(OUT) / name


def _part(value: str) -> str:
    """Return the part of a name or path that is used in the name of a folder."""
    return re.sub(r"[^\w.-]+", "-", Path(value).stem)[:LONGEST_NAME]


def check_new_file(path: Path, endings: Sequence[str]) -> None:
    """Raise `InputError` for a file that exists, cannot be written, or has another ending.

    `endings` are the allowed endings, such as ``.toml``, in the same case. A missing folder is
    allowed if it can be created.
    """
    if path.suffix not in endings:
        raise InputError(
            "", "file", str(path), f"allowed: a name that ends in {', '.join(endings)}"
        )
    try:
        there = path.exists() or path.is_symlink()
    except OSError as fault:
        raise InputError("", "file", str(path), f"cannot be written ({fault.strerror})") from fault
    if there:
        raise InputError("", "file", str(path), "exists already; name another file")
    check_writable(path, "file")


def _print(
    result: Any, folder: Path | None, page: str, files: Sequence[Path], *, as_json: bool
) -> None:
    """Print the result, and the paths of all written files.

    If JSON is printed, the path of the folder is the key `folder` of the document, or a line on
    stderr if the document is not an object.
    """
    written = [*([folder] if folder else []), *files]
    if not as_json:
        named = result.files if isinstance(result, Answer) else ()
        if folder and not named:
            named = [folder / page if (folder / page).exists() else folder]
        written = [*named, *files]
        parts = [result.text, "\n".join(map(str, written))]
        click.echo("\n\n".join(part for part in parts if part))
        return
    document = result.document
    if folder and isinstance(document, dict):
        document, written = document | {"folder": str(folder)}, [*files]
    click.echo(json.dumps(document, indent=2, allow_nan=False))
    for path in written:
        click.echo(str(path), err=True)


def usage(message: str) -> NoReturn:
    """Raise `click.UsageError` with a message about options that exclude each other."""
    raise click.UsageError(message)


TABLE = Output(table=True)
STUDY = Output(keeps=True, table=True)
DRAWN = Output(keeps=True, table=True, picture=True)
