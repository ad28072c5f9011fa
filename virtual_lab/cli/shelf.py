"""Commands that look: list, show, profile."""

from __future__ import annotations

from pathlib import Path

import click

from virtual_lab.cli.shared import json_option, names, print_json
from virtual_lab.errors import InputError


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


@click.command()
@click.argument("bat", shell_complete=names("bats"))
@click.option(
    "--swing",
    type=float,
    default=0.0,
    show_default=True,
    help="Exponent n of the swing law, 0 to 0.5.",
)
@click.option(
    "--csv", type=click.Path(path_type=Path, dir_okay=False), help="Write the table to a file."
)
@json_option
def profile(bat: str, swing: float, csv: Path | None, as_json: bool) -> None:
    """Show e, r, e_A and v_f of BAT along its barrel, its modal frequencies and nodes."""
    from virtual_lab.report.text import profile_text
    from virtual_lab.studies.profile import profile as run

    profiled = run(bat, swing=swing)
    if csv:
        try:
            profiled.table.to_csv(csv, index=False)
        except OSError as fault:
            raise InputError(
                "", "csv", str(csv), f"cannot be written ({fault.strerror})"
            ) from fault
    if as_json:
        print_json(profiled.document)
    else:
        click.echo(profile_text(profiled.document, profiled.bat.published))
