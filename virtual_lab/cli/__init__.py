"""The command line.

Exit codes: 0 finished, whatever the verdict; 1 a bug; 2 bad input; 3 files were changed; 4 parts
of a campaign or forms of a certificate are missing, or not all could be checked.
`virtual_lab.__main__` adds 130, 143 and 129 for interruptions.
"""

from __future__ import annotations

import io
import os
import sys

import click

from virtual_lab.cli.commands import FunctionCommand, click_command
from virtual_lab.cli.sections import Sections
from virtual_lab.commands.table import SECTIONS, of_other_packages
from virtual_lab.commands.wording import parameters_named, shell_name
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
    """Print a completion script.

    It is that of a SHELL. Source it from the shell's startup file.
    """
    from click.shell_completion import get_completion_class

    script = get_completion_class(shell)
    assert script is not None
    click.echo(script(cli, {}, PROGRAM, "_VIRTUAL_LAB_COMPLETE").source())


@click.pass_context
def _program(context: click.Context) -> None:
    """Certify baseball bats in a simulated laboratory, and study its tests.

    virtual-lab COMMAND --help has options and an example.
    """
    context.with_resource(parameters_named(shell_name))
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def _of_other_packages(name: str = "") -> list[click.Command]:
    """Return the commands of other packages, or only the command called `name`.

    The general help names a function that is no command on stderr; a call of it raises
    `InputError`.
    """
    commands: list[click.Command] = []
    for each in of_other_packages(cli.commands, name):
        if not isinstance(each, InputError):
            commands.append(FunctionCommand(each))
        elif name:
            raise each
        else:
            click.echo(f"{PROGRAM}: {each}", err=True)
    return commands


cli = Sections(
    name=PROGRAM,
    others=_of_other_packages,
    callback=_program,
    help=_program.__doc__,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96},
    sections={
        **{title: [*map(click_command, rows)] for title, rows in SECTIONS.items()},
        "Shell": (completion,),
    },
)
click.version_option(VERSION, prog_name=PROGRAM)(cli)
