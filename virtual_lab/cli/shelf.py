"""Commands on bats: list, show, profile, compare, fit-bat."""

from __future__ import annotations

from pathlib import Path

import click

from virtual_lab.cli.shared import (
    ball_option,
    inertia_option,
    json_option,
    law_option,
    names,
    print_json,
    teller,
)
from virtual_lab.errors import InputError
from virtual_lab.files import check_new_folder
from virtual_lab.units import INCH


@click.command("list")
@click.argument(
    "kind",
    required=False,
    metavar="[KIND]",
    type=click.Choice(
        ["bats", "balls", "procedures", "instruments", "rigs", "conditions", "faults"]
    ),
)
@json_option
def list_(kind: str | None, as_json: bool) -> None:
    """List what the catalog holds and which rigs are installed."""
    from virtual_lab.lab.inventory import shelf
    from virtual_lab.output.tables import table_text

    rows = shelf(kind)
    if as_json:
        print_json(rows)
    else:
        click.echo(table_text(rows))


@click.command()
@click.argument(
    "name",
    shell_complete=names(
        "bats", "balls", "procedures", "instruments", "rigs", "conditions", "faults"
    ),
)
@json_option
def show(name: str, as_json: bool) -> None:
    """Show a specification, every number with its unit and source."""
    from virtual_lab.lab.inventory import sheet_document, sheet_text

    document = sheet_document(name)
    if as_json:
        print_json(document)
    else:
        click.echo(sheet_text(document))


out_option = click.option(
    "--out", type=click.Path(path_type=Path), help="New folder for the CSV and PNG."
)


@click.command()
@click.argument("bat", shell_complete=names("bats"))
@law_option
@click.option("--swing", type=float, help="Exponent n of the power law, 0 to 0.5  [default: 0]")
@inertia_option
@ball_option
@out_option
@json_option
def profile(
    bat: str,
    swing_law: str,
    swing: float | None,
    reference_inertia: str | None,
    ball: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Show e, r, e_A and v_f of BAT along its barrel, its modal frequencies and nodes."""
    from virtual_lab.studies.bats.profile import chosen_swings, save_profile
    from virtual_lab.studies.bats.profile import profile as run
    from virtual_lab.studies.bats.text import profile_text

    if out:
        check_new_folder(out)
    (exponent,) = chosen_swings(swing_law, () if swing is None else (swing,), (0.0,))
    profiled = run(bat, swing=exponent, reference_inertia=reference_inertia, ball=ball)
    if out:
        save_profile(profiled, out)
    if as_json:
        print_json(profiled.document)
    else:
        click.echo(profile_text(profiled.document, profiled.bat.published))


@click.command()
@click.argument("bats", nargs=-1, required=True, metavar="BAT BAT...", shell_complete=names("bats"))
@law_option
@click.option(
    "--swing",
    "swings",
    type=float,
    multiple=True,
    help="Exponent n of the power law, 0 to 0.5; may be given several times  [default: 0, 0.5]",
)
@inertia_option
@ball_option
@out_option
@json_option
def compare(
    bats: tuple[str, ...],
    swing_law: str,
    swings: tuple[float, ...],
    reference_inertia: str | None,
    ball: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Compare BATs along the barrel: peaks of e, BPF, e_A and v_f, and what sets them apart."""
    from virtual_lab.studies.bats.compare import SWINGS, save_comparison
    from virtual_lab.studies.bats.compare import compare as run
    from virtual_lab.studies.bats.profile import chosen_swings
    from virtual_lab.studies.bats.text import comparison_text

    if out:
        check_new_folder(out)
    exponents = chosen_swings(swing_law, swings, SWINGS)
    compared = run(bats, swings=exponents, reference_inertia=reference_inertia, ball=ball)
    if out:
        save_comparison(compared, out)
    if as_json:
        print_json(compared.document)
    else:
        click.echo(comparison_text(compared.peaks, compared.differences, compared.balls))


@click.command("fit-bat")
@click.argument("measured", type=click.Path(), metavar="MEASURED.TOML")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="New bat file.")
@click.option(
    "--members",
    type=click.IntRange(min=2),
    default=12,
    show_default=True,
    help="Bats that meet the data, from which their spread is taken.",
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)
@json_option
def fit_bat(measured: str, out: Path, members: int, seed: int, as_json: bool) -> None:
    """Fit a bat to what was MEASURED of one, and tell what the measurements leave open."""
    from virtual_lab.output.tables import table_text
    from virtual_lab.studies.bats.fit_bat import fit_bat as run
    from virtual_lab.studies.bats.fit_bat import write_bat

    if out.suffix != ".toml":
        raise InputError("", "out", str(out), "a bat file's name ends in .toml")
    if out.exists():
        raise InputError("", "out", str(out), "is there already; name another file")
    fitted = run(measured, members=members, seed=seed, say=teller())
    write_bat(fitted, out, Path(measured).name)
    if as_json:
        print_json(fitted.document)
        return
    worst = ", ".join(
        f"{name} {value / INCH:+.1e} in" if name.startswith("node") else f"{name} {value:+.1e}"
        for name, value in fitted.fitted.misfits.items()
    )
    click.echo(f"{table_text(fitted.spread)}\n\nmisfits (relative): {worst}\n{out}")
