"""Commands of campaigns: very many laboratories, into a folder of Parquet files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from virtual_lab import api
from virtual_lab.cli.plumbing import command, workers_option

if TYPE_CHECKING:
    from virtual_lab.output.progress import Progress

PATH = click.Path(path_type=Path)


def _making(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function with the options of a command that makes parts."""
    options = (
        workers_option,
        click.option(
            "--blocks",
            metavar="N/M",
            help="Make the Nth of M shares only, as a job of an array does: 3/40.",
        ),
        click.option(
            "--dask",
            metavar="ADDRESS",
            help="Let the workers of this Dask scheduler work, tcp://HOST:8786 (extra 'dask').",
        ),
    )
    for option in reversed(options):
        function = option(function)
    return function


@command("run")
@click.argument("study", type=PATH, metavar="STUDY.TOML")
@click.option(
    "--out",
    "folder",
    type=PATH,
    required=True,
    metavar="FOLDER",
    help="Folder of the campaign: a new one, or one of the same study, which is continued.",
)
@_making
def run(study: Path, folder: Path, progress: Progress, **asked: Any) -> Any:
    """Make the campaign of STUDY.TOML: Parquet files with a row for each test.

    Exit code 4 if a part is missing in the end: its block failed twice.
    """
    return api.campaign(study, folder, progress=progress, **asked)


@command("resume")
@click.argument("folder", type=PATH)
@_making
def resume(folder: Path, progress: Progress, **asked: Any) -> Any:
    """Make the parts that are not yet in FOLDER, or damaged. Exit code 4 if one is missing."""
    return api.campaign(None, folder, progress=progress, **asked)


@command("check")
@click.argument("folder", type=PATH)
def check(folder: Path, progress: Progress) -> Any:
    """Read all parts in FOLDER and name those that are damaged or missing (then exit code 4)."""
    return api.Campaign.open(folder).check(progress)


@command("summary", keeps=True, table=True)
@click.argument("folder", type=PATH)
def summary(folder: Path) -> Any:
    """Show verdicts, means, errors and coverage of every bat, procedure and change in FOLDER."""
    return api.Campaign.open(folder).summary()


campaign = click.Group(
    "campaign",
    commands=[run, resume, check, summary],
    help="Certify bats in very many laboratories, into a folder of Parquet files.",
)
