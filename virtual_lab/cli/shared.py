"""What the commands share: JSON on stdout, progress on a terminal, completion of names."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

import click

__all__ = [
    "ball_option",
    "inertia_option",
    "json_option",
    "law_option",
    "names",
    "print_json",
    "rigs",
    "teller",
]

json_option = click.option("--json", "as_json", is_flag=True, help="One JSON document on stdout.")


def teller() -> Callable[[str], None]:
    """Return a teller of progress: to a terminal on stderr, to nobody in a pipe."""
    told = sys.stderr is not None and sys.stderr.isatty()
    return lambda text: click.echo(f"… {text}", err=True) if told else None


def print_json(document: Any) -> None:
    """Print one JSON document."""
    click.echo(json.dumps(document, indent=2, allow_nan=False))


def names(*kinds: str) -> Callable[..., list[str]]:
    """Return a completer for catalog names of some kinds."""

    def complete(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
        from virtual_lab import catalog

        found = [name for kind in kinds for name in catalog.names(kind)]
        return [name for name in found if name.startswith(incomplete)]

    return complete


def rigs(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    """Complete the name of an installed rig that fires at bats."""
    from virtual_lab.simulation.rig import Stage, installed_rigs

    found = [name for name, rig in installed_rigs().items() if rig.stage is Stage.IMPACT]
    return [name for name in found if name.startswith(incomplete)]


inertia_option = click.option(
    "--reference-inertia",
    metavar="BAT|'NUMBER UNIT'",
    shell_complete=names("bats"),
    help="I0 of the swing law: a bat's own, or e.g. '17000 oz in^2', the paper's (default).",
)

law_option = click.option(
    "--swing-law",
    type=click.Choice(["power", "energy"]),
    default="power",
    show_default=True,
    help="Swing by I^-n, or with the same energy into bat and batter.",
)

ball_option = click.option(
    "--ball",
    shell_complete=names("balls"),
    help="Ball in the field  [default: the game conditions' own, of the bat's sport]",
)
