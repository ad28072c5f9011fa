"""Commands that study the laboratory: coverage, bias, critique, daily, chart, stability."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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

Rows = list[dict[str, Any]]


@click.command()
@click.argument("bat", shell_complete=names("bats"))
@click.option(
    "--procedure", default="astm-f1881", show_default=True, shell_complete=names("procedures")
)
@click.option("--laboratories", type=click.IntRange(min=2), default=1000, show_default=True)
@click.option("--first-seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option("--summed", is_flag=True, help="The bat as drawn, instruments that write sums.")
@click.option(
    "--effects",
    is_flag=True,
    help="Not coverage but the effect of every term of the budget, stated and realised.",
)
@json_option
def coverage(
    bat: str,
    procedure: str,
    laboratories: int,
    first_seed: int,
    summed: bool,
    effects: bool,
    as_json: bool,
) -> None:
    """Certify BAT in many laboratories and count the 95 % intervals that hold the truth."""
    from virtual_lab.output.tables import table_text
    from virtual_lab.studies import coverage as intervals
    from virtual_lab.studies import effects as terms

    rows = (terms.effects if effects else intervals.coverage)(
        bat,
        procedure=procedure,
        laboratories=laboratories,
        first_seed=first_seed,
        summed=summed,
        say=teller(),
    )
    if as_json:
        print_json(rows)
    else:
        click.echo(table_text(rows))


@click.command()
@click.argument("bat", default="r161", shell_complete=names("bats"))
@click.option("--clips", type=click.IntRange(min=2), default=100, show_default=True)
@click.option("--first-seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option("--summed", is_flag=True, help="A camera that writes places, not pictures.")
@json_option
def clips(bat: str, clips: int, first_seed: int, summed: bool, as_json: bool) -> None:
    """Film one shot at BAT in each of many laboratories; count intervals that hold the truth."""
    from virtual_lab.output.tables import table_text
    from virtual_lab.studies.clips import clip_coverage

    rows = clip_coverage(bat, clips=clips, first_seed=first_seed, summed=summed, say=teller())
    if as_json:
        print_json(rows)
    else:
        click.echo(table_text(rows))


@click.command()
@click.argument("faults", nargs=-1, metavar="[FAULT]...", shell_complete=names("faults"))
@click.option("--laboratories", type=click.IntRange(min=2), default=60, show_default=True)
@click.option("--first-seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option(
    "--procedure",
    "procedures",
    multiple=True,
    help="One with predictions; may be given several times  [default: astm-f1881, bbcor]",
    shell_complete=names("procedures"),
)
@click.option("--out", type=click.Path(path_type=Path), help="New folder for the CSV.")
@json_option
def faults(
    faults: tuple[str, ...],
    laboratories: int,
    first_seed: int,
    procedures: tuple[str, ...],
    out: Path | None,
    as_json: bool,
) -> None:
    """Play FAULTS of a real day (or all) and hold what comes of them against the predictions."""
    from virtual_lab.files import check_new_folder
    from virtual_lab.studies.faults import faults as run
    from virtual_lab.studies.faults import save_faults
    from virtual_lab.studies.text import faults_text

    if out:
        check_new_folder(out)
    rows = run(
        faults,
        procedures=procedures,
        laboratories=laboratories,
        first_seed=first_seed,
        say=teller(),
    )
    if out:
        save_faults(rows, out)
    if as_json:
        print_json(rows)
    else:
        click.echo(faults_text(rows))


@click.command()
@click.option(
    "--procedure", default="astm-f1881", show_default=True, shell_complete=names("procedures")
)
@json_option
def bias(procedure: str, as_json: bool) -> None:
    """Measure what the method gets wrong when nothing is random, for every bat."""
    from virtual_lab.output.tables import table_text
    from virtual_lab.studies.bias import bias as run

    rows = run(procedure)
    if as_json:
        print_json(rows)
    else:
        click.echo(table_text(rows))


@click.command()
@click.argument("bats", nargs=-1, metavar="[BAT]...", shell_complete=names("bats"))
@click.option(
    "--procedure", default="astm-f1881", show_default=True, shell_complete=names("procedures")
)
@json_option
def slope(bats: tuple[str, ...], procedure: str, as_json: bool) -> None:
    """Show how e_A changes along the barrel where a procedure hits BATS (or those of baseball)."""
    from virtual_lab.output.tables import table_text
    from virtual_lab.studies.place_slope import place_slopes

    rows = place_slopes(bats, procedure=procedure)
    if as_json:
        print_json(rows)
    else:
        click.echo(table_text([row | {"place_in": row["place_in"] or ""} for row in rows]))


@click.command()
@click.argument("bat", shell_complete=names("bats"))
@json_option
def sensitivity(bat: str, as_json: bool) -> None:
    """Show how far the peaks of BAT hang on the law of the ball."""
    from virtual_lab.studies.bats.ball_law import sensitivity as run
    from virtual_lab.studies.bats.text import sensitivity_text

    rows = run(bat, say=teller())
    if as_json:
        print_json(rows)
    else:
        click.echo(sensitivity_text(rows))


@click.command()
@click.argument("bats", nargs=-1, required=True, metavar="BAT BAT...", shell_complete=names("bats"))
@click.option(
    "--procedure",
    "procedures",
    multiple=True,
    shell_complete=names("procedures"),
    help="May be given several times  [default: all of the sport of the field's balls]",
)
@law_option
@click.option(
    "--swing",
    "swings",
    type=float,
    multiple=True,
    help="Exponent n of the power law in the field; may be given several times"
    "  [default: 0, 0.3, 0.5]",
)
@inertia_option
@ball_option
@click.option("--laboratories", type=click.IntRange(min=2), default=20, show_default=True)
@click.option("--first-seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option(
    "--out", type=click.Path(path_type=Path), help="New folder for the CSV and the picture."
)
@json_option
def critique(
    bats: tuple[str, ...],
    swing_law: str,
    swings: tuple[float, ...],
    out: Path | None,
    as_json: bool,
    **asked: Any,
) -> None:
    """Show which test procedures rank BATs as the field does, and which do not."""
    from virtual_lab.files import check_new_folder
    from virtual_lab.studies.bats.profile import chosen_swings
    from virtual_lab.studies.critique import SWINGS, save_critique
    from virtual_lab.studies.critique import critique as run
    from virtual_lab.studies.text import critique_text

    if out:
        check_new_folder(out)
    found = run(bats, swings=chosen_swings(swing_law, swings, SWINGS), say=teller(), **asked)
    if out:
        save_critique(found, out)
    if as_json:
        print_json(found.document)
    else:
        picture = f"\n\n{out / 'critique.png'}" if out else ""
        click.echo(f"{critique_text(found.metrics, found.pairs, found.balls)}{picture}")


@click.command()
@click.argument("bats", nargs=-1, shell_complete=names("bats"))
@json_option
def convergence(bats: tuple[str, ...], as_json: bool) -> None:
    """Worst error in e_A over the number of modes, for BATS or every bat of the catalog."""
    from virtual_lab.fidelity.mode_convergence import convergence as run
    from virtual_lab.output.tables import table_text

    rows = run(bats, say=teller())
    if as_json:
        print_json(rows)
    else:
        click.echo(table_text(rows))


@click.command()
@click.option("--ball", default="check-ball", show_default=True, shell_complete=names("balls"))
@click.option("--days", type=int, default=60, show_default=True)
@click.option("--baseline", type=int, default=25, show_default=True, help="Days that set limits.")
@click.option("--hits", type=int, default=10, show_default=True, help="Each morning.")
@click.option("--drift", type=float, default=0.0, help="What the wall gives back less each day.")
@click.option("--step", type=float, default=0.0, help="What it gives back less at once.")
@click.option(
    "--fault",
    "faults",
    multiple=True,
    help="What goes wrong at the impact rig; may be given several times.",
    shell_complete=names("faults"),
)
@click.option("--since", type=int, help="First day of all that  [default: after the baseline]")
@click.option(
    "--rule",
    "rules",
    type=int,
    multiple=True,
    default=(1, 2, 3, 4),
    show_default=True,
    help="Western Electric rule, 1 to 4; may be given several times.",
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="New folder for the CSV and the control charts  [default: out/daily]",
)
@json_option
def daily(out: Path | None, as_json: bool, **asked: Any) -> None:
    """Fire a check ball at wall and check cylinder each morning and keep control charts."""
    from virtual_lab.files import check_new_folder, first_free
    from virtual_lab.output.tables import table_text
    from virtual_lab.studies.daily import daily as run
    from virtual_lab.studies.daily import save_daily

    target = out or first_free(Path("out/daily"))
    check_new_folder(target)
    played = run(**asked)
    save_daily(played, target)
    if as_json:
        print_json(played.document | {"folder": str(target)})
    else:
        checks = (
            ("check ball at the wall, e0", played.alarms, "daily.png"),
            ("check cylinder at the impact rig, e_A", played.cylinder_alarms, "cylinder.png"),
        )
        parts = [
            f"{words}\n{table_text(rows)}\n{target / picture}" for words, rows, picture in checks
        ]
        click.echo("\n\n".join(parts))


@click.command()
@click.option(
    "--out", type=click.Path(path_type=Path), help="New folder for the CSV, the page and the PNG."
)
@json_option
def paper(out: Path | None, as_json: bool) -> None:
    """Hold every number, figure and claim of the paper against what is found here."""
    from virtual_lab.files import check_new_folder
    from virtual_lab.studies.paper import paper as run
    from virtual_lab.studies.paper import save_paper
    from virtual_lab.studies.paper.text import paper_text

    if out:
        check_new_folder(out)
    found = run(say=teller())
    if out:
        save_paper(found, out)
    if as_json:
        print_json(found.document)
    else:
        page = f"\n\n{out / 'paper.html'}" if out else ""
        click.echo(f"{paper_text(found.rows)}{page}")
