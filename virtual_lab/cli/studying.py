"""Commands that study the laboratory and its procedures; they may read the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from virtual_lab import api
from virtual_lab.cli.plumbing import (
    ball_option,
    command,
    fault_option,
    inertia_option,
    laboratories_option,
    law_option,
    names,
    procedure_option,
    seed_option,
    usage,
    workers_option,
)

if TYPE_CHECKING:
    from virtual_lab.output.progress import Progress

NUMBERED = "; its laboratories are taken by number, from 0"


@command("coverage", keeps=True, table=True)
@click.argument("bat", default="r161", shell_complete=names("bats"))
@procedure_option(None, "  [default: astm-f1881; of clips bbcor]")
@laboratories_option(1000)
@seed_option(NUMBERED)
@click.option(
    "--summed",
    is_flag=True,
    help="Instruments write sums (a camera: places), the bat is nominal: much faster.",
)
@click.option("--individual", is_flag=True, help="With --summed: a made bat in every laboratory.")
@click.option(
    "--history",
    "earlier_tests",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    metavar="NUMBER",
    help="Earlier tests of each laboratory, whose scatter of hits counts, too.",
)
@workers_option
@click.option(
    "--effects",
    is_flag=True,
    help="Instead of the coverage, compare the effect of each budget component, stated and found.",
)
@click.option(
    "--clips",
    type=click.IntRange(min=2),
    metavar="NUMBER",
    help="Film one shot in each of so many laboratories, and count the camera's intervals "
    "of v_in, v_out and e_A instead.",
)
@click.pass_context
def coverage(
    context: click.Context,
    /,
    bat: str,
    procedure: str | None,
    laboratories: int,
    effects: bool,
    clips: int | None,
    individual: bool,
    earlier_tests: int,
    workers: int,
    progress: Progress,
    **asked: Any,
) -> Any:
    """Test BAT in many laboratories; count the 95 % intervals that contain the true value."""
    if clips is not None:
        given = context.get_parameter_source("laboratories")
        beside = effects or individual or earlier_tests or workers > 1
        if beside or given is click.core.ParameterSource.COMMANDLINE:
            others = "--effects, --individual, --history, --laboratories, --workers"
            usage(f"--clips goes with none of {others}")
        rules = procedure or "bbcor"
        return api.clip_coverage(bat, procedure=rules, clips=clips, progress=progress, **asked)
    asked |= {"procedure": procedure or "astm-f1881", "laboratories": laboratories}
    if effects:
        if individual or earlier_tests:
            usage("--effects goes without --individual and --history")
        return api.effects(bat, workers=workers, progress=progress, **asked)
    asked |= {"individual": individual, "earlier_tests": earlier_tests, "workers": workers}
    return api.coverage(bat, progress=progress, **asked)


@command("operating", keeps=True, table=True, picture=True)
@click.argument("bat", default="r161", shell_complete=names("bats"))
@click.option(
    "--procedure",
    "procedures",
    multiple=True,
    default=("astm-f1881",),
    show_default=True,
    help="Procedure with a limit; may be given several times.",
    shell_complete=names("procedures"),
)
@laboratories_option(1000)
@seed_option(NUMBERED)
def operating(bat: str, progress: Progress, **asked: Any) -> Any:
    """Show the chance that bats like BAT pass, over their true metric; of three tests the best."""
    return api.operating(bat, progress=progress, **asked)


@command("bias", keeps=True, table=True)
@procedure_option()
def bias(procedure: str, progress: Progress) -> Any:
    """Show the error of every result without any randomness, for every bat of the catalog."""
    return api.bias(procedure, progress=progress)


@command("faults", keeps=True, table=True)
@click.argument("faults", nargs=-1, metavar="[FAULT]...", shell_complete=names("faults"))
@laboratories_option(60)
@seed_option(NUMBERED)
@click.option(
    "--procedure",
    "procedures",
    multiple=True,
    help="Procedure; may be given several times  [default: astm-f1881, bbcor]",
    shell_complete=names("procedures"),
)
def faults(faults: tuple[str, ...], progress: Progress, **asked: Any) -> Any:
    """Simulate FAULTs of a test day (or all); compare detection and bias with predictions."""
    return api.faults(faults, progress=progress, **asked)


@command("critique", keeps=True, table=True, picture=True)
@click.argument("bats", nargs=-1, required=True, metavar="BAT BAT...", shell_complete=names("bats"))
@click.option(
    "--procedure",
    "procedures",
    multiple=True,
    shell_complete=names("procedures"),
    help="Test procedure; may be given several times  [default: all for the bats' sport]",
)
@law_option
@click.option(
    "--swing",
    "swings",
    type=float,
    multiple=True,
    metavar="N",
    help="Exponent n of the power law in the field; may be given several times"
    "  [default: 0, 0.3, 0.5]",
)
@inertia_option
@ball_option
@laboratories_option(20)
@seed_option(NUMBERED)
def critique(bats: tuple[str, ...], progress: Progress, **asked: Any) -> Any:
    """Show which test procedures rank BATs in the same order as play on the field."""
    return api.critique(bats, progress=progress, **asked)


@command("daily", folder="daily", table=True, picture=True)
@click.option(
    "--ball",
    default="check-ball",
    show_default=True,
    shell_complete=names("balls"),
    help="Check ball: a name or a .toml file.",
)
@click.option("--days", type=int, default=60, show_default=True, help="Number of mornings.")
@click.option(
    "--baseline",
    type=int,
    default=25,
    show_default=True,
    help="Days that set the limits.",
)
@click.option("--hits", type=int, default=10, show_default=True, help="Hits each morning.")
@click.option(
    "--drift", type=float, default=0.0, help="Loss of the wall's restitution per day, e.g. 0.0005."
)
@click.option("--step", type=float, default=0.0, help="Sudden loss of the wall's restitution.")
@fault_option
@click.option(
    "--since", type=int, help="First day of drift, step and faults  [default: after the baseline]"
)
@click.option(
    "--rule",
    "rules",
    type=int,
    multiple=True,
    default=(1, 2, 3, 4),
    show_default=True,
    help="Western Electric rule, 1 to 4; may be given several times.",
)
@seed_option("")
def daily(progress: Progress, **asked: Any) -> Any:
    """Fire a check ball at wall and check cylinder each morning; draw control charts."""
    return api.daily(progress=progress, **asked)


@command("paper", keeps=True, table=True, picture=True)
def paper(progress: Progress) -> Any:
    """Compare every number, figure and claim of the 2003 paper with this program's result."""
    return api.paper(progress=progress)
