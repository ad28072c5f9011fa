"""The command line.

Exit codes: 0 finished, whatever the verdict; 1 a bug; 2 bad input; 3 files were changed; 4 parts
of a campaign or forms of a certificate are missing, or not all could be checked.
`virtual_lab.__main__` adds 130, 143 and 129 for interruptions.
"""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from virtual_lab.cli.commands import FunctionCommand
from virtual_lab.cli.plumbing import DRAWN, STUDY, TABLE, Answer, Output, Sections
from virtual_lab.cli.rehearse import rehearse
from virtual_lab.errors import LISTED, VERSION, IncompleteError, InputError

__all__ = ["main"]

PROGRAM = "virtual-lab"


def main() -> None:
    """Run the command line and leave the program with its exit code.

    The code is 0 for success, 1 for a bug, 2 for bad input and 4 for an incomplete result. A
    command can also set another code with its result.
    """
    # OpenCV prints no messages of FFmpeg
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    for stream in (sys.stdout, sys.stderr):  # terminals may lack ² and ±
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        code = cli.main(prog_name=PROGRAM, standalone_mode=False)
    except InputError as fault:
        _leave(2, str(fault))
    except IncompleteError as fault:
        _leave(4, str(fault))
    except click.UsageError as fault:
        command = fault.ctx.command_path if fault.ctx else PROGRAM
        _leave(2, f"{fault.format_message()} (try '{command} --help')")
    except click.ClickException as fault:
        _leave(2, fault.format_message())
    except OSError as fault:  # full disk, or no permission to write
        where = f"{fault.filename}: " if fault.filename else ""
        _leave(2, f"{where}{fault.strerror or fault}")
    except SystemExit:  # click exits when a pipe is closed (EPIPE): no error
        sys.exit(0)
    except Exception:
        import traceback

        traceback.print_exc()
        _leave(1, "a bug in this program, not in your input; please report the lines above")
    sys.exit(code if isinstance(code, int) else 0)


def _leave(code: int, message: str) -> None:
    lines = (" ".join(line.split()) for line in message.split(LISTED))
    click.echo(f"{PROGRAM}: {LISTED.join(lines)}", err=True)
    sys.exit(code)


@click.command("completion")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the completion script for a SHELL. Source the script from the shell's startup file."""
    from click.shell_completion import get_completion_class

    script = get_completion_class(shell)
    assert script is not None
    click.echo(script(cli, {}, PROGRAM, "_VIRTUAL_LAB_COMPLETE").source())


@click.pass_context
def _program(context: click.Context) -> None:
    """Certify baseball bats in a simulated laboratory, and study its tests.

    Exit codes: 0 finished, whatever the verdict; 1 a bug in this program; 2 bad input; 3 files were
    changed (score, verify); 4 parts are missing (campaign, a PDF of certify), or not all could be
    checked (verify); 130 and 143 interrupted by Ctrl-C and SIGTERM.

    Symbols: e restitution of ball and bat, e0 of the ball on a wall, e_A collision efficiency,
    r recoil factor, BPF = e/e0, v_f batted-ball speed, u standard uncertainty.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def _beside_the_clip(values: Mapping[str, Any]) -> Path:
    clip = Path(values["clip"])
    return clip.parent / f"{clip.absolute().stem or 'clip'}-track"


def _answer_fit(bat: Any) -> Answer:
    """Return the answer for a fitted bat: text, JSON and files."""
    return Answer(document=bat.document, text=bat.text, save=bat.write, table=bat.table)


def _board(folder: Path) -> Answer:
    """Return the answer for the folder of a board's pictures."""
    document = {"pictures": str(folder / "pictures"), "truth": str(folder / "truth")}
    return Answer(document=document, text="", files=[folder / "pictures"])


def _form(path: Path) -> Answer:
    """Return the answer for the path of an empty form."""
    return Answer(document={"folder" if path.is_dir() else "file": str(path)}, text=str(path))


def _answer_sweep(table: Any) -> Answer:
    """Return the answer for the table of a sweep: text, JSON and files."""
    document = json.loads(table.to_json(orient="records"))
    return Answer(document=document, text=table.to_string(index=False), table=table)


FOLDER = "virtual_lab.cli.campaign"


def _of_other_packages(name: str = "") -> list[click.Command]:
    """Return one command per entry point of other packages, or only the command called `name`.

    An entry point is a function that carries out a study. A function that cannot be a command, or
    whose name is already used, is left out. The general help names it on stderr, and a call of it
    raises `InputError`.
    """
    from importlib.metadata import entry_points

    commands: dict[str, click.Command] = {}
    for each in entry_points(group="virtual_lab.commands"):
        if name not in ("", each.name):
            continue
        command = FunctionCommand(each.name, (each.module, each.attr), output=DRAWN)
        try:
            if each.name in cli.commands or each.name in commands:
                raise ValueError("another command has this name")
            command.require_rules()
        except (AssertionError, OSError, SyntaxError, ValueError) as fault:
            refusal = InputError(each.value, each.name, None, f"is not a command: {fault}")
            if name:
                raise refusal from fault
            click.echo(f"{PROGRAM}: {refusal}", err=True)
        else:
            commands[each.name] = command
    return list(commands.values())


cli = Sections(
    name=PROGRAM,
    others=_of_other_packages,
    callback=_program,
    help=_program.__doc__,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96},
    sections={
        "Test a bat": (
            FunctionCommand(
                "certify",
                saving="Certificate.save",
                output=Output(folder="{bat}-{procedure}", page="certificate.html"),
                example="certify r161 --procedure bbcor --seed 7",
            ),
            FunctionCommand("score", output=DRAWN, example="score out/r161-bbcor-seed-7"),
            FunctionCommand(
                "reduce",
                saving="Certificate.save",
                output=Output(keeps=True),
                example="reduce out/r161-bbcor-seed-7/records",
            ),
            FunctionCommand("verify", output=TABLE, example="verify out/r161-bbcor-seed-7"),
            FunctionCommand(
                "report", output=DRAWN, example="report out/r161-bbcor-seed-7 out/other"
            ),
            FunctionCommand(
                "template", output=Output(answer=_form), example="template astm-f1881 forms"
            ),
            rehearse,
        ),
        "Bats and the catalog": (
            FunctionCommand("list", "shelf", output=TABLE, example="list bats"),
            FunctionCommand("show", example="show r161"),
            FunctionCommand("profile", output=DRAWN, example="profile r161 ea70 --swing 0.3"),
            FunctionCommand(
                "fit-bat",
                output=Output(table=True, file="New bat file, .toml.", answer=_answer_fit),
                example="fit-bat measured.toml --out mine.toml",
            ),
            FunctionCommand("sensitivity", output=DRAWN, example="sensitivity r161"),
            FunctionCommand("slope", output=DRAWN, example="slope r161 ea70"),
        ),
        "Studies of laboratories and procedures": (
            FunctionCommand(
                "sweep",
                output=Output(table=True, answer=_answer_sweep),
                example="sweep r161 ea70 --laboratories 2",
            ),
            FunctionCommand(
                "coverage",
                output=DRAWN,
                example="coverage r161 --summed --laboratories 20",
            ),
            FunctionCommand("operating", output=DRAWN, example="operating r161 --laboratories 20"),
            FunctionCommand(
                "interlab", output=DRAWN, example="interlab laboratories.toml --predict"
            ),
            FunctionCommand(
                "bias", options=("procedure",), output=DRAWN, example="bias --procedure bbcor"
            ),
            FunctionCommand("faults", output=DRAWN, example="faults gate-moved --laboratories 2"),
            FunctionCommand("plan", output=DRAWN, example="plan bbcor --target-u 0.0015"),
            FunctionCommand("twin", output=DRAWN, example="twin out/r161-bbcor-seed-7"),
            FunctionCommand(
                "critique", output=DRAWN, example="critique r161 ea70 --laboratories 2"
            ),
            FunctionCommand(
                "daily",
                output=Output(folder="daily", table=True, picture=True),
                example="daily --days 12 --baseline 6",
            ),
            click.Group(
                "campaign",
                commands=[
                    FunctionCommand(
                        "run",
                        "campaign",
                        output=Output(into="folder"),
                        example="campaign run study.toml --out campaign",
                    ),
                    FunctionCommand(
                        "resume",
                        "campaign",
                        fixed={"study": None},
                        example="campaign resume campaign",
                    ),
                    FunctionCommand("check", (FOLDER, "check"), example="campaign check campaign"),
                    FunctionCommand(
                        "summary",
                        (FOLDER, "summary"),
                        output=STUDY,
                        example="campaign summary campaign",
                    ),
                ],
                help="Test bats in very many laboratories; store one row per test, no certificate.",
            ),
            FunctionCommand("paper", output=DRAWN, example="paper --csv claims.csv"),
            FunctionCommand("reference", output=DRAWN, example="reference --csv reference.csv"),
        ),
        "Camera": (
            FunctionCommand(
                "track",
                output=Output(folder=_beside_the_clip),
                example="track clip.mp4 --ball 73mm --phone",
            ),
            FunctionCommand(
                "calibrate",
                output=Output(
                    file="New calibration file, .toml. A picture of the residuals is beside it."
                ),
                example="calibrate pictures --board chessboard:9x6:40mm --out camera.toml",
            ),
            FunctionCommand(
                "board",
                output=Output(folder="board", into="folder", answer=_board),
                example="board --board chessboard:9x6:40mm --views 3",
            ),
        ),
        "Speed and accuracy": (
            FunctionCommand(
                "chart",
                output=Output(folder="chart-{part}", table=True, picture=True),
                example="chart motion",
            ),
            FunctionCommand(
                "stability",
                output=Output(folder="stability-{part}", table=True, picture=True),
                example="stability camera",
            ),
        ),
        "Shell": (completion,),
    },
)
click.version_option(VERSION, prog_name=PROGRAM)(cli)
