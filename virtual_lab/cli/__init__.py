"""The command line.

Exit codes: 0 finished, whatever the verdict; 1 a bug; 2 bad input; 3 files were changed; 4 parts
of a campaign or forms of a certificate are missing, or not all could be checked.
`virtual_lab.__main__` adds 130, 143 and 129 for interruptions.
"""

from __future__ import annotations

import io
import sys

import click

from virtual_lab.cli.bats import fit_bat, list_, percussion, profile, sensitivity, show, slope
from virtual_lab.cli.camera import board, calibrate, track
from virtual_lab.cli.campaigns import campaign
from virtual_lab.cli.certifying import certify, reduce, report, score, template, verify
from virtual_lab.cli.fidelity import chart, convergence, stability
from virtual_lab.cli.plumbing import Sections
from virtual_lab.cli.rehearse import rehearse
from virtual_lab.cli.studying import bias, coverage, critique, daily, faults, operating, paper
from virtual_lab.errors import VERSION, IncompleteError, InputError

__all__ = ["main"]

PROGRAM = "virtual-lab"


def main() -> None:
    """Run the command line and leave with its exit code."""
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
        asked = fault.ctx.command_path if fault.ctx else PROGRAM
        _leave(2, f"{fault.format_message()} (try '{asked} --help')")
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
    click.echo(f"{PROGRAM}: {' '.join(message.split())}", err=True)
    sys.exit(code)


@click.command("completion")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the completion script for a SHELL, to be sourced from its start-up file."""
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


cli = Sections(
    name=PROGRAM,
    callback=_program,
    help=_program.__doc__,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96},
    sections={
        "Test a bat": (certify, score, reduce, verify, report, template, rehearse),
        "Bats and the catalog": (
            list_,
            show,
            profile,
            fit_bat,
            sensitivity,
            slope,
            percussion,
        ),
        "Studies of laboratories and procedures": (
            coverage,
            operating,
            bias,
            faults,
            critique,
            daily,
            campaign,
            paper,
        ),
        "Camera": (track, calibrate, board),
        "Speed and accuracy": (chart, stability, convergence),
        "Shell": (completion,),
    },
)
click.version_option(VERSION, prog_name=PROGRAM)(cli)
