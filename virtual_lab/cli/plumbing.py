"""Common parts of all commands: output folders, JSON, tables, figures, progress, completion.

A command is a function that returns its result: an object with a `document` for JSON and a `text`
for the terminal, like every `StudyResult`, and with `save`, `table` and `plot` if the command has
the options for them.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Any, NoReturn

import click

from virtual_lab.errors import IncompleteError, InputError, without_if_it_fails
from virtual_lab.files import check_new_folder, first_free, new_files
from virtual_lab.output.progress import show_progress
from virtual_lab.output.tables import write_csv

Function = Callable[..., Any]
HELP_WIDTH = 1000  # largest length of a sentence of help [characters], so that none is cut
LONGEST_NAME = 60  # largest length of a name within a folder's name [characters]
TABLES, PICTURES = (".csv",), (".png", ".svg", ".pdf")


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Result of a command that is no `StudyResult`."""

    document: Any
    text: str
    code: int = 0  # exit code of the program
    save: Callable[[Path], object] | None = None
    files: Sequence[Path] = field(default_factory=tuple)  # written files, whose paths are printed


class Sections(click.Group):
    """A group whose help lists its commands in sections by purpose."""

    def __init__(self, *, sections: Mapping[str, Sequence[click.Command]], **known: Any) -> None:
        super().__init__(**known)
        self.sections = sections
        for commands in sections.values():
            for each in commands:
                self.add_command(each)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write one table of commands per section."""
        widest = max(len(name) for name in self.commands)
        for title, commands in self.sections.items():
            with formatter.section(title):
                rows = [(str(each.name), each.get_short_help_str(HELP_WIDTH)) for each in commands]
                formatter.write_dl([(name.ljust(widest), words) for name, words in rows])


def command(
    name: str,
    *,
    folder: str | Callable[[Mapping[str, Any]], Path] = "",
    page: str = "",
    keeps: bool = False,
    table: bool = False,
    picture: bool = False,
) -> Callable[[Function], click.Command]:
    """Return a decorator that makes a command from a function.

    Parameters
    ----------
    name
        Name of the command.
    folder
        Name of the default folder in ``out/``, with parameters of the command in braces, or a
        function of the parameters that returns its path; ``--out`` overrides it. Without a
        default folder, results are written only with ``--out``.
    page
        File in the folder whose path is printed at the end, instead of the folder's.
    keeps
        Whether the command has ``--out``, which it always has with a default folder.
    table, picture
        Whether the command has ``--csv`` and ``--plot``.
    """

    def decorate(function: Function) -> click.Command:
        takes_progress = "progress" in inspect.signature(function).parameters

        @wraps(function)
        def run(
            *,
            as_json: bool,
            out: Path | None = None,
            csv: Path | None = None,
            plot: Path | None = None,
            **asked: Any,
        ) -> int:
            target = out
            if target is None and folder:
                target = first_free(_usual_folder(folder, asked))
            if target is not None:
                check_new_folder(target)
            for path, endings in ((csv, TABLES), (plot, PICTURES)):
                if path is not None:
                    _check_new_file(path, endings)
            missing: list[str] = []

            def form(path: Path) -> AbstractContextManager[None]:
                """Return a context in which a form is made: if it fails, the folder stays saved."""
                return without_if_it_fails(str(path), missing) if target else nullcontext()

            with show_progress() if takes_progress else nullcontext() as progress:
                found = function(**asked, **({"progress": progress} if takes_progress else {}))
                if target is not None:
                    if progress is not None:
                        progress(f"writing {target}")
                    try:
                        found.save(target)
                    except IncompleteError as fault:
                        missing += fault.missing
                if csv is not None:
                    with form(csv), new_files(csv.parent) as draft:
                        write_csv(found.table, draft / csv.name)
                if plot is not None:
                    with form(plot), new_files(plot.parent) as draft:
                        found.plot(draft / plot.name)
            files = [path for path in (csv, plot) if path and path.exists()]
            _print(found, target, "" if missing else page, files, as_json=as_json)
            if missing:
                raise IncompleteError(str(target), missing)
            return int(getattr(found, "code", 0))

        shared = _shared_options(folder, keeps=keeps, table=table, picture=picture)
        # click lists options from last to first, so the shared ones follow the command's
        run.__click_params__ = [*reversed(shared), *getattr(run, "__click_params__", [])]  # type: ignore[attr-defined]
        return click.command(name)(run)

    return decorate


def _shared_options(
    folder: object, *, keeps: bool, table: bool, picture: bool
) -> list[click.Option]:
    options = []
    path = click.Path(path_type=Path)
    if folder or keeps:
        usual = ""
        if isinstance(folder, str) and folder:
            named = re.sub(r"{(\w+)}", lambda found: found[1].upper(), folder)
            usual = f"out/{named}, or with -2, -3, …"
        words = f"New folder for all results.{f'  [default: {usual}]' if usual else ''}"
        options.append(click.Option(["--out"], type=path, metavar="FOLDER", help=words))
    if table:
        words = "Write the table into a new .csv file."
        options.append(click.Option(["--csv"], type=path, metavar="FILE", help=words))
    if picture:
        words = "Draw the figure into a new .png, .svg or .pdf file."
        options.append(click.Option(["--plot"], type=path, metavar="FILE", help=words))
    words = "Print the result as one JSON document."
    return [*options, click.Option(["--json", "as_json"], is_flag=True, help=words)]


def _usual_folder(
    folder: str | Callable[[Mapping[str, Any]], Path], asked: Mapping[str, Any]
) -> Path:
    """Return the default folder; its name contains seed and number only if the user gave them."""
    if not isinstance(folder, str):
        return folder(asked)
    parts = {key: _part(value) for key, value in asked.items() if isinstance(value, str)}
    name = folder.format_map(parts)
    for key in ("seed", "number"):
        source = click.get_current_context().get_parameter_source(key)
        if source is click.core.ParameterSource.COMMANDLINE:
            name += f"-{key}-{asked[key]}"
    return Path("out") / name


def _part(value: str) -> str:
    """Return the part of a name or path for a folder's name."""
    return re.sub(r"[^\w.-]+", "-", Path(value).stem)[:LONGEST_NAME]


def _check_new_file(path: Path, endings: Sequence[str]) -> None:
    """Refuse an existing file, or one with another ending."""
    if path.suffix not in endings:
        raise InputError(
            "", "file", str(path), f"allowed: a name that ends in {', '.join(endings)}"
        )
    try:
        there = path.exists() or path.is_symlink()
    except OSError as fault:
        raise InputError("", "file", str(path), f"cannot be written ({fault.strerror})") from fault
    if there:
        raise InputError("", "file", str(path), "is there already; name another")


def _print(
    found: Any, folder: Path | None, page: str, files: Sequence[Path], *, as_json: bool
) -> None:
    """Print the result, and the paths of all written files.

    With JSON on stdout, the folder is the key `folder` of the document, or a line on stderr.
    """
    written = [*([folder] if folder else []), *files]
    if not as_json:
        written = [*(getattr(found, "files", ()) or ([folder / page] if folder else ())), *files]
        parts = [found.text, "\n".join(map(str, written))]
        click.echo("\n\n".join(part for part in parts if part))
        return
    document = found.document
    if folder and isinstance(document, dict):
        document, written = document | {"folder": str(folder)}, [*files]
    click.echo(json.dumps(document, indent=2, allow_nan=False))
    for path in written:
        click.echo(str(path), err=True)


def usage(message: str) -> NoReturn:
    """Refuse options that exclude each other."""
    raise click.UsageError(message)


def names(*kinds: str) -> Callable[..., list[str]]:
    """Return a completer for catalog names of some kinds."""

    def complete(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
        from virtual_lab import catalog

        found = [name for kind in kinds for name in catalog.names(kind)]
        return [name for name in found if name.startswith(incomplete)]

    return complete


def rigs(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    """Complete the name of an installed rig that fires at bats."""
    from virtual_lab.simulation.rig import Stage, installed_rigs

    found = [name for name, rig in installed_rigs().items() if rig.stage is Stage.IMPACT]
    return [name for name in found if name.startswith(incomplete)]


def procedure_option(
    default: str | None = "astm-f1881", words: str = ""
) -> Callable[[Function], Function]:
    """Return the option of one procedure."""
    return click.option(
        "--procedure",
        default=default,
        show_default=default is not None,
        shell_complete=names("procedures"),
        help=f"Test procedure: a name ('virtual-lab list procedures') or a .toml file{words}.",
    )


def laboratories_option(default: int) -> Callable[[Function], Function]:
    """Return the option for the number of laboratories."""
    return click.option(
        "--laboratories",
        type=click.IntRange(min=2),
        default=default,
        show_default=True,
        metavar="NUMBER",
        help="Number of simulated laboratories, each with other balls and calibration errors.",
    )


def seed_option(words: str, default: int | None = 1) -> Callable[[Function], Function]:
    """Return the option of a seed."""
    return click.option(
        "--seed",
        type=click.IntRange(min=0),
        default=default,
        show_default=default is not None,
        metavar="NUMBER",
        help=f"Seed of all random numbers{words}",
    )


workers_option = click.option(
    "--workers",
    type=click.IntRange(1, 4096),
    default=1,
    show_default=True,
    metavar="NUMBER",
    help="Number of processes, each with one thread.",
)
fault_option = click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="FAULT",
    help="Fault of the test day ('virtual-lab list faults'); may be given several times.",
    shell_complete=names("faults"),
)

inertia_option = click.option(
    "--reference-inertia",
    metavar="BAT|'NUMBER UNIT'",
    shell_complete=names("bats"),
    help="Moment of inertia I0 in the swing law: that of a bat, or a number with unit  "
    "[default: 17000 oz in^2, as in the paper]",
)

law_option = click.option(
    "--swing-law",
    type=click.Choice(["power", "energy"]),
    default="power",
    show_default=True,
    help="Swing law: bat speed proportional to I^-n, or the same energy for bat and batter.",
)

ball_option = click.option(
    "--ball",
    shell_complete=names("balls"),
    help="Ball in play on the field  [default: standard ball of the bat's sport]",
)
