"""Commands that test a bat: certify, score, reduce, and forms for other laboratories."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
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
    from virtual_lab.api import Certificate
    from virtual_lab.output.progress import Progress
    from virtual_lab.parameters import Paper, RealityName


history_option = click.option(
    "--history",
    type=click.Path(path_type=Path),
    multiple=True,
    metavar="FOLDER",
    help="Result folder of an earlier test of this bat design by the same procedure in this "
    "laboratory, or a folder of such; may be given several times. The scatter of their hits "
    "counts, too.",
)


def saving_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command with the options for saving a certificate."""
    for option in (
        click.option("--reason", default="", help="Why it is replaced."),
        click.option(
            "--replaces",
            type=click.Path(path_type=Path),
            metavar="FOLDER",
            help="Folder of the result that this one replaces.",
        ),
        click.option(
            "--sign",
            type=click.Path(path_type=Path),
            metavar="KEY",
            help="Sign all files with a private key (Ed25519, PEM; needs the extra 'sign').",
        ),
        click.option(
            "--paper",
            type=click.Choice(["a4", "letter"]),
            default="a4",
            show_default=True,
            help="Paper of the certificate.",
        ),
        click.option(
            "--pdf",
            is_flag=True,
            help="Write the certificate as PDF, too (needs the extra 'pdf').",
        ),
    ):
        function = option(function)
    return function


def saved_so(
    pdf: bool, paper: str, sign: Path | None, test: Callable[[], Certificate]
) -> Certificate:
    """Return the certificate of a test. Refuse options that cannot be met before the test."""
    if pdf:
        from virtual_lab.certificate.pdf import require_pdf

        require_pdf(paper)
    if sign:
        from virtual_lab.certificate.signing import require_key

        require_key(sign, private=True)
    return replace(test(), pdf=pdf, paper=paper, key=sign)


@command("certify", folder="{bat}-{procedure}", page="certificate.html", picture=True)
@click.argument("bat", shell_complete=names("bats"))
@procedure_option()
@click.option(
    "--rig",
    help="Rig to use instead of the procedure's own; it must record what the procedure needs.",
    shell_complete=rigs,
)
@seed_option("; makes the test reproducible, not sealed  [default: a random seed]", None)
@click.option(
    "--number",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    metavar="NUMBER",
    help="Number of the laboratory in the study of this seed: another bat, other balls and "
    "calibration errors.",
)
@click.option(
    "--ideal",
    is_flag=True,
    help="Bat, balls and instruments equal their nominal values, without noise.",
)
@click.option(
    "--noise-free",
    is_flag=True,
    help="No randomness; vibration of the bat, encoder counts, drag and friction remain.",
)
@click.option(
    "--collision",
    "collision",
    type=click.Choice(["rigid", "modal", "reference"]),
    help="Collision model  [default: the fastest that is accurate enough]",
)
@click.option(
    "--motion",
    type=click.Choice(["closed-form", "pymunk"]),
    default="closed-form",
    show_default=True,
    help="Motion of ball and bat: closed form for all shots, or one pymunk scene per shot.",
)
@fault_option
@click.option(
    "--control-bat",
    help="Bat of known e, tested first, if the procedure corrects for its balls by one.",
    shell_complete=names("bats"),
)
@click.option(
    "--correction",
    metavar="METHOD:E0",
    help="Convert the result to a standard ball of this e0, e.g. trampoline:0.5; the methods are "
    "ratio and trampoline. For procedures without a conversion; marked as assumed.",
)
@click.option(
    "--film",
    is_flag=True,
    help="Save a video of the first shot for 'track'; needs --rig filmed-cannon.",
)
@click.option(
    "--laboratory",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Who tests, for whom, with which instruments: stated on the certificate. 'template "
    "laboratory FILE' writes an empty one; the next six options come before it.",
)
@click.option("--customer", default="", help="For whom the bat is tested.")
@click.option("--bat-serial", default="", help="Serial number of the bat.")
@click.option("--bat-condition", default="", help="Condition of the bat as received.")
@click.option("--received", default="", metavar="DAY", help="Day of receipt, as 2026-11-25.")
@click.option("--operator", default="", help="Who carries out the test.")
@click.option("--notes", default="", help="What else is to be stated.")
@click.option(
    "--test",
    type=click.IntRange(min=0),
    metavar="NUMBER",
    help="Number of this test in its laboratory, with --seed: the same calibrations, another bat, "
    "other balls.",
)
@history_option
@click.option(
    "--uncertainty",
    type=click.Choice(["first-order", "second-order", "monte-carlo"]),
    default="first-order",
    show_default=True,
    help="Method to propagate it; Monte Carlo draws until two digits of u are right.",
)
@saving_options
def certify(
    bat: str,
    ideal: bool,
    noise_free: bool,
    pdf: bool,
    paper: str,
    sign: Path | None,
    progress: Progress,
    **asked: Any,
) -> Any:
    """Test BAT (a name or a .toml file) by a procedure and write its certificate."""
    if ideal and noise_free:
        usage("--ideal and --noise-free exclude each other")
    reality: RealityName = "ideal" if ideal else "noise-free" if noise_free else "real"
    return saved_so(
        pdf, paper, sign, lambda: api.certify(bat, reality=reality, progress=progress, **asked)
    )


@command("reduce", keeps=True, picture=True)
@click.argument("records", type=click.Path(path_type=Path))
@history_option
@saving_options
def reduce(records: Path, pdf: bool, paper: str, sign: Path | None, **asked: Any) -> Any:
    """Compute the results from a folder of raw RECORDS, without the truth.

    RECORDS is the folder `records` that `certify` wrote, or a folder with the form of another
    laboratory (`template`).
    """
    return saved_so(pdf, paper, sign, lambda: api.reduce(records, **asked))


@command("score", table=True)
@click.argument("folder", type=click.Path(path_type=Path))
def score(folder: Path) -> Any:
    """Compare the certificate in FOLDER with the true values.

    FOLDER is a folder that `certify` wrote. If files or keys in it were changed since the test,
    they are listed and the exit code is 3.
    """
    return api.score(folder)


@command("verify", table=True)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--key",
    type=click.Path(path_type=Path),
    metavar="PUBLIC",
    help="Public key (PEM) of who signed the files; needs the extra 'sign'.",
)
def verify(folder: Path, key: Path | None) -> Any:
    """Repeat the reduction in FOLDER, make its certificate anew, and say what differs.

    FOLDER is a folder that `certify` or `reduce` wrote. Of its truth only the digest is compared.
    The exit code is 3 if anything was altered, 4 if not all could be checked, or if another
    version made the folder and this one finds other results in its records.
    """
    return api.verify(folder, key=key)


@command("report", keeps=True, table=True)
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--pdf", is_flag=True, help="Write the report as PDF, too (needs the extra 'pdf').")
@click.option(
    "--paper",
    type=click.Choice(["a4", "letter"]),
    default="a4",
    show_default=True,
    help="Paper of the report.",
)
def report(folders: tuple[Path, ...], pdf: bool, paper: Paper) -> Any:
    """Compare the certificates in result FOLDERS, or in the folders of one.

    It takes bats by one procedure, one bat by several procedures, laboratories of one bat, or
    repeats of one test, and says which; certificates that differ in more than one way are refused,
    and copies of one test. The numbers are those stated, not verified: `verify` does that.
    """
    return api.report(folders, pdf=pdf, paper=paper)


@command("template")
@click.argument("procedure", shell_complete=names("procedures"))
@click.argument("folder", type=click.Path(path_type=Path))
def template(procedure: str, folder: Path) -> Answer:
    """Write empty record forms of PROCEDURE into a new FOLDER, for another laboratory.

    `template laboratory FILE` writes an empty form of who tests what for whom, for `certify
    --laboratory`.
    """
    from virtual_lab.files import check_new_folder

    if procedure == "laboratory":
        from virtual_lab.studies.template import particulars_form

        particulars_form(folder)
        return Answer(document={"file": str(folder)}, text=str(folder))
    check_new_folder(folder)
    written = api.template(procedure, folder)
    return Answer(document={"folder": str(written)}, text=str(written))
