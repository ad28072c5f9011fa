"""Commands that look: list, show, profile, compare."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from virtual_lab.cli.shared import json_option, names, print_json
from virtual_lab.folder import check_new_folder


@click.command("list")
@click.argument(
    "kind",
    required=False,
    metavar="[KIND]",
    type=click.Choice(["bats", "balls", "procedures", "instruments", "rigs", "conditions"]),
)
@json_option
def list_(kind: str | None, as_json: bool) -> None:
    """List what the catalog holds and which rigs are installed."""
    from virtual_lab.report.text import table_text
    from virtual_lab.studies.shelf import shelf

    rows = shelf(kind)
    if as_json:
        print_json(rows)
    else:
        click.echo(table_text(rows))


@click.command()
@click.argument(
    "name", shell_complete=names("bats", "balls", "procedures", "instruments", "rigs", "conditions")
)
@json_option
def show(name: str, as_json: bool) -> None:
    """Show a specification, every number with its unit and source."""
    from virtual_lab.report.text import sheet_text
    from virtual_lab.studies.shelf import sheet

    document = sheet(name)
    if as_json:
        print_json(document)
    else:
        click.echo(sheet_text(document))


def _inertia_option(function: Callable[..., None]) -> Callable[..., None]:
    return click.option(
        "--reference-inertia",
        metavar="BAT|'NUMBER UNIT'",
        shell_complete=names("bats"),
        help="I0 of the swing law: a bat's own, or e.g. '17000 oz in^2', the paper's (default).",
    )(function)


out_option = click.option(
    "--out", type=click.Path(path_type=Path), help="New folder for the CSV and PNG."
)


@click.command()
@click.argument("bat", shell_complete=names("bats"))
@click.option(
    "--swing",
    type=float,
    default=0.0,
    show_default=True,
    help="Exponent n of the swing law, 0 to 0.5.",
)
@_inertia_option
@out_option
@json_option
def profile(
    bat: str, swing: float, reference_inertia: str | None, out: Path | None, as_json: bool
) -> None:
    """Show e, r, e_A and v_f of BAT along its barrel, its modal frequencies and nodes."""
    from virtual_lab.report.text import profile_text
    from virtual_lab.studies.profile import profile as run
    from virtual_lab.studies.profile import save_profile

    if out:
        check_new_folder(out)
    profiled = run(bat, swing=swing, reference_inertia=reference_inertia)
    if out:
        save_profile(profiled, out)
    if as_json:
        print_json(profiled.document)
    else:
        click.echo(profile_text(profiled.document, profiled.bat.published))


@click.command()
@click.argument("bats", nargs=-1, required=True, metavar="BAT BAT...", shell_complete=names("bats"))
@click.option(
    "--swing",
    "swings",
    type=float,
    multiple=True,
    default=(0.0, 0.5),
    show_default=True,
    help="Exponent n of the swing law, 0 to 0.5; may be given several times.",
)
@_inertia_option
@out_option
@json_option
def compare(
    bats: tuple[str, ...],
    swings: tuple[float, ...],
    reference_inertia: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Compare BATs along the barrel: peaks of e, BPF, e_A and v_f, and what sets them apart."""
    from virtual_lab.report.text import comparison_text
    from virtual_lab.studies.compare import compare as run
    from virtual_lab.studies.compare import save_comparison

    if out:
        check_new_folder(out)
    compared = run(bats, swings=swings, reference_inertia=reference_inertia)
    if out:
        save_comparison(compared, out)
    if as_json:
        print_json(compared.document)
    else:
        click.echo(comparison_text(compared.peaks, compared.differences))
