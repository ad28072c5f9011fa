"""Commands that test a bat: certify, score, reduce, and forms for who tests elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from virtual_lab import api
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
    from virtual_lab.output.progress import Progress

__all__ = ["certify", "reduce", "score", "template"]

ALTERED = 3  # exit code


@command("certify", folder="{bat}-{procedure}", page="certificate.html", picture=True)
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
def certify(bat: str, ideal: bool, noise_free: bool, progress: Progress, **asked: Any) -> Any:
    """Take BAT (a name or a .toml file) through a procedure and write its certificate."""
    if ideal and noise_free:
        usage("--ideal and --noise-free exclude each other")
    reality = "ideal" if ideal else "noise-free" if noise_free else "real"
    return api.certify(bat, reality=reality, progress=progress, **asked)


@command("reduce", keeps=True, picture=True)
@click.argument("records", type=click.Path(path_type=Path))
def reduce(records: Path) -> Any:
    """Reduce a folder of raw RECORDS, ours or another laboratory's, without the truth."""
    return api.reduce(records)


@command("score", table=True)
@click.argument("folder", type=click.Path(path_type=Path))
def score(folder: Path) -> Any:
    """Open the sealed truth in FOLDER: measured against true, in units and uncertainties.

    What was altered in FOLDER since the test is named, file and key, and the exit code is 3.
    """
    return api.score(folder)


@command("template")
@click.argument("procedure", shell_complete=names("procedures"))
@click.argument("folder", type=click.Path(path_type=Path))
def template(procedure: str, folder: Path) -> Answer:
    """Write the empty forms of a PROCEDURE for another laboratory into a new FOLDER."""
    from virtual_lab.files import check_new_folder

    check_new_folder(folder)
    written = api.template(procedure, folder)
    return Answer(document={"folder": str(written)}, text=str(written))
