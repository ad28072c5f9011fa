"""Commands that test a bat: certify, reduce, score, and forms for who tests elsewhere."""

from __future__ import annotations

from pathlib import Path

import click

from virtual_lab.cli.shared import json_option, names, print_json, rigs, teller

ALTERED = 3  # exit code


@click.command()
@click.argument("bat", shell_complete=names("bats"))
@click.option(
    "--procedure",
    default="astm-f1881",
    show_default=True,
    help="Name, or a .toml file.",
    shell_complete=names("procedures"),
)
@click.option(
    "--rig",
    help="Another rig than the procedure's own; one that lacks what it needs is refused.",
    shell_complete=rigs,
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help="Of everything random: the test is reproducible then, not sealed  [default: drawn]",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="New folder for the results  [default: out/BAT]",
)
@click.option(
    "--ideal",
    is_flag=True,
    help="Every individual and instrument equals its nominal.",
)
@click.option(
    "--noise-free",
    is_flag=True,
    help="No randomness; ring, counts, drag and friction stay.",
)
@click.option(
    "--collision",
    "rung",
    type=click.Choice(["rigid", "modal", "reference"]),
    help="Pin the collision model  [default: the cheapest that is good enough]",
)
@click.option(
    "--motion",
    type=click.Choice(["closed-form", "pymunk"]),
    default="closed-form",
    show_default=True,
    help="How ball and bat are carried: all shots at once, or a pymunk scene a shot.",
)
@click.option(
    "--fault",
    "faults",
    multiple=True,
    help="What goes wrong on the day; may be given several times ('virtual-lab list faults').",
    shell_complete=names("faults"),
)
@click.option(
    "--control-bat",
    help="A bat of known e, for rules that correct their balls by one: tested first.",
    shell_complete=names("bats"),
)
@click.option(
    "--correction",
    metavar="METHOD:E0",
    help="Convert to a standard ball where the rules do not: e.g. trampoline:0.5 (assumed).",
)
@click.option(
    "--film",
    is_flag=True,
    help="Keep the first shot in whole frames too, for 'track'; needs --rig filmed-cannon.",
)
@json_option
def certify(
    bat: str,
    procedure: str,
    rig: str | None,
    seed: int | None,
    out: Path | None,
    ideal: bool,
    noise_free: bool,
    rung: str | None,
    motion: str,
    faults: tuple[str, ...],
    control_bat: str | None,
    correction: str | None,
    film: bool,
    as_json: bool,
) -> None:
    """Take BAT (a name or a .toml file) through a procedure and write its certificate."""
    from virtual_lab import catalog
    from virtual_lab.files import check_new_folder, first_free

    if ideal and noise_free:
        raise click.UsageError("--ideal and --noise-free exclude each other")
    reality = "ideal" if ideal else "noise-free" if noise_free else "real"
    catalog.find("bats", bat)
    target = out or first_free(Path("out") / Path(bat).stem)
    check_new_folder(target)
    from virtual_lab.api import certify as run
    from virtual_lab.certificate.text import certificate_text

    if film:
        _require_camera(procedure, rig)
    certificate = run(
        bat,
        procedure=procedure,
        rig=rig,
        seed=seed,
        reality=reality,
        rung=rung,
        motion=motion,
        faults=faults,
        control_bat=control_bat,
        correction=correction,
        say=teller(),
    )
    certificate.save(target, film=film)
    if as_json:
        print_json(certificate.document | {"folder": str(target)})
    else:
        click.echo(certificate_text(certificate.printed))
        click.echo(f"\n{target / 'certificate.html'}")


def _require_camera(procedure: str, rig: str | None) -> None:
    """Refuse to film where nothing can, before the test and not after it."""
    from virtual_lab import catalog
    from virtual_lab.lab.fitting import require_camera
    from virtual_lab.measurement.procedure import Procedure
    from virtual_lab.simulation.rig import Stage, find_rig

    asked = rig or catalog.load("procedures", procedure, Procedure).spec.rig
    require_camera(find_rig(asked, Stage.IMPACT))


@click.command()
@click.argument("records", type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), help="New folder for certificate and readings."
)
@json_option
def reduce(records: Path, out: Path | None, as_json: bool) -> None:
    """Reduce a folder of raw RECORDS, ours or another laboratory's, without the truth."""
    from virtual_lab.files import check_new_folder

    if out:
        check_new_folder(out)
    from virtual_lab.api import reduce as run
    from virtual_lab.certificate.text import certificate_text

    certificate = run(records)
    if out:
        certificate.save(out)
    if as_json:
        print_json(certificate.document)
    else:
        click.echo(certificate_text(certificate.printed))


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@json_option
def score(folder: Path, as_json: bool) -> int:
    """Open the sealed truth in FOLDER: recovered against true, in units and uncertainties.

    What was altered in FOLDER since the test is named, file and key, and the exit code is 3.
    """
    from virtual_lab.studies.score import score_folder, score_text

    document = score_folder(folder)
    if as_json:
        print_json(document)
    else:
        click.echo(score_text(document))
    return ALTERED if document["altered"] else 0


@click.command()
@click.argument("procedure", shell_complete=names("procedures"))
@click.argument("folder", type=click.Path(path_type=Path))
@json_option
def template(procedure: str, folder: Path, as_json: bool) -> None:
    """Write the empty forms of a PROCEDURE for another laboratory into a new FOLDER."""
    from virtual_lab.files import check_new_folder

    check_new_folder(folder)
    from virtual_lab.studies.template import write_template

    written = write_template(procedure, folder)
    if as_json:
        print_json({"folder": str(written)})
    else:
        click.echo(written)
