"""Commands that test a bat: certify, score, reduce, and forms for who tests elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from virtual_lab.cli.plumbing import (
    Answer,
    command,
    fault_option,
    names,
    procedure_option,
    rigs,
    seed_option,
    usage,
)

if TYPE_CHECKING:
    from virtual_lab.api import Certificate
    from virtual_lab.output.progress import Progress

__all__ = ["certify", "reduce", "score", "template"]

ALTERED = 3  # exit code


@command("certify", folder="{bat}-{procedure}", picture=True)
@click.argument("bat", shell_complete=names("bats"))
@procedure_option()
@click.option(
    "--rig",
    help="Another rig than the procedure's own; one that lacks what it needs is refused.",
    shell_complete=rigs,
)
@seed_option(": the test is reproducible then, not sealed  [default: drawn]", None)
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
    help="How ball and bat are carried: all shots at once, or one pymunk scene per shot.",
)
@fault_option
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
def certify(
    bat: str,
    procedure: str,
    rig: str | None,
    ideal: bool,
    noise_free: bool,
    film: bool,
    progress: Progress,
    **asked: Any,
) -> Any:
    """Take BAT (a name or a .toml file) through a procedure and write its certificate."""
    from virtual_lab import catalog

    if ideal and noise_free:
        usage("--ideal and --noise-free exclude each other")
    catalog.find("bats", bat)
    if film:
        _require_camera(procedure, rig)
    from virtual_lab.api import certify as test

    reality = "ideal" if ideal else "noise-free" if noise_free else "real"
    certificate = test(
        bat, procedure=procedure, rig=rig, reality=reality, progress=progress, **asked
    )
    return _Kept(certificate, film=film)


class _Kept:
    """A certificate that may be saved with its film."""

    def __init__(self, certificate: Certificate, *, film: bool) -> None:
        self.document, self.text = certificate.document, certificate.text
        self.plot, self.certificate, self.film = certificate.plot, certificate, film
        self.files: list[Path] = []

    def save(self, folder: Path) -> None:
        self.certificate.save(folder, film=self.film)
        self.files.append(folder / "certificate.html")


def _require_camera(procedure: str, rig: str | None) -> None:
    """Refuse to film where nothing can, before the test and not after it."""
    from virtual_lab import catalog
    from virtual_lab.lab.fitting import require_camera
    from virtual_lab.measurement.procedure import Procedure
    from virtual_lab.simulation.rig import Stage, find_rig

    asked = rig or catalog.load("procedures", procedure, Procedure).spec.rig
    require_camera(find_rig(asked, Stage.IMPACT))


@command("reduce", keeps=True, picture=True)
@click.argument("records", type=click.Path(path_type=Path))
def reduce(records: Path) -> Any:
    """Reduce a folder of raw RECORDS, ours or another laboratory's, without the truth."""
    from virtual_lab.api import reduce as certificate_of

    return certificate_of(records)


@command("score", table=True)
@click.argument("folder", type=click.Path(path_type=Path))
def score(folder: Path) -> Any:
    """Open the sealed truth in FOLDER: measured against true, in units and uncertainties.

    What was altered in FOLDER since the test is named, file and key, and the exit code is 3.
    """
    from virtual_lab.studies.score import score_folder

    return score_folder(folder)


@command("template")
@click.argument("procedure", shell_complete=names("procedures"))
@click.argument("folder", type=click.Path(path_type=Path))
def template(procedure: str, folder: Path) -> Answer:
    """Write the empty forms of a PROCEDURE for another laboratory into a new FOLDER."""
    from virtual_lab.files import check_new_folder

    check_new_folder(folder)
    from virtual_lab.studies.template import template as write

    written = write(procedure, folder)
    return Answer(document={"folder": str(written)}, text=str(written))
