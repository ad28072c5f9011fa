"""Commands on bats, and on all that the catalog holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from virtual_lab import api
from virtual_lab.cli.plumbing import (
    ball_option,
    command,
    inertia_option,
    laboratories_option,
    law_option,
    names,
    procedure_option,
    seed_option,
)
from virtual_lab.errors import InputError

if TYPE_CHECKING:
    from virtual_lab.output.progress import Progress
    from virtual_lab.parameters import Kind

KINDS = ("bats", "balls", "procedures", "instruments", "rigs", "conditions", "faults")


@command("list", table=True)
@click.argument("kind", required=False, metavar="[KIND]", type=click.Choice(KINDS))
def list_(kind: Kind | None) -> Any:
    """List the catalog (bats, balls, procedures, instruments, rigs, conditions, faults)."""
    return api.shelf(kind)


@command("show")
@click.argument("name", shell_complete=names(*KINDS))
def show(name: str) -> Any:
    """Show a catalog entry, every number with unit and source, or a certificate.json."""
    return api.show(name)


@command("profile", keeps=True, table=True, picture=True)
@click.argument("bats", nargs=-1, required=True, metavar="BAT...", shell_complete=names("bats"))
@law_option
@click.option(
    "--swing",
    "swings",
    type=float,
    multiple=True,
    metavar="N",
    help="Exponent n of the power law, 0 to 0.5; for several bats it may be given several times"
    "  [default: 0; of several bats 0 and 0.5]",
)
@inertia_option
@ball_option
def profile(bats: tuple[str, ...], **asked: Any) -> Any:
    """Show e, r, e_A and v_f of one BAT along its barrel, or compare several BATs.

    For one bat: curves, modal frequencies and nodes. For several bats: the greatest e, BPF, e_A
    and v_f of each, and their differences.
    """
    return api.profile(bats, **asked)


@command("fit-bat", table=True)
@click.argument("measured", type=click.Path(), metavar="MEASURED.TOML")
@click.option(
    "--out",
    "target",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help="New bat file, .toml.",
)
@click.option(
    "--members",
    type=click.IntRange(min=2),
    default=12,
    show_default=True,
    metavar="NUMBER",
    help="Number of fitted bats, which show the spread that the data allow.",
)
@seed_option("")
def fit_bat(measured: str, target: Path, members: int, seed: int, progress: Progress) -> Any:
    """Make a bat file from a file of measurements, and show what they leave uncertain."""
    if target.suffix != ".toml":
        raise InputError("", "out", str(target), "a bat file's name ends in .toml")
    if target.exists():
        raise InputError("", "out", str(target), "is there already; name another file")
    fitted = api.fit_bat(measured, members=members, seed=seed, progress=progress)
    fitted.write(target)
    return fitted


@command("sensitivity", table=True)
@click.argument("bat", shell_complete=names("bats"))
def sensitivity(bat: str, progress: Progress) -> Any:
    """Show how the results of BAT depend on the force law of the ball."""
    return api.sensitivity(bat, progress=progress)


@command("slope", table=True)
@click.argument("bats", nargs=-1, metavar="[BAT]...", shell_complete=names("bats"))
@procedure_option()
def slope(bats: tuple[str, ...], procedure: str) -> Any:
    """Show the slope of e_A along the barrel at the place where a procedure hits BATs.

    Without names the bats are those of the 2003 paper.
    """
    return api.slope(bats, procedure=procedure)


@command("percussion", keeps=True, table=True, picture=True)
@click.argument("bat", shell_complete=names("bats"))
@laboratories_option(10)
@seed_option("; of the first laboratory, the others follow")
@click.option(
    "--shots",
    type=click.IntRange(min=2),
    default=6,
    show_default=True,
    metavar="NUMBER",
    help="Number of shots per laboratory and place.",
)
def percussion(bat: str, progress: Progress, **asked: Any) -> Any:
    """Show the errors of hits off the centre of percussion of a pivoted BAT."""
    return api.percussion(bat, progress=progress, **asked)
