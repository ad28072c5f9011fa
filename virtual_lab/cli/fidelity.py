"""Commands that chart speed against accuracy, and map where the numerics hold."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import click

from virtual_lab.cli.shared import json_option, print_json, teller


@click.group()
def chart() -> None:
    """Draw speed against accuracy."""


@click.group()
def stability() -> None:
    """Map where the numerics hold."""


def _study(group: click.Group, name: str, picture: str, words: str) -> None:
    """Add the command of a module of `fidelity`, which can `measure`, `save` and tell in `text`."""
    module = f"virtual_lab.fidelity.{name}_{group.name}"

    @group.command(name, help=words)
    @click.option(
        "--out",
        type=click.Path(path_type=Path),
        default=Path(f"out/{group.name}-{name}"),
        show_default=True,
        help="New folder for pictures and tables.",
    )
    @json_option
    def command(out: Path, as_json: bool) -> None:
        from virtual_lab.files import check_new_folder

        check_new_folder(out)
        study = import_module(module)
        rows = study.measure(say=teller())
        study.save(rows, out)
        if as_json:
            print_json(rows)
        else:
            click.echo(f"{study.text(rows)}\n\n{out / picture}")


_study(
    chart,
    "collision",
    "collision.png",
    "Error of the collision rungs against their time a shot.",
)
_study(
    chart,
    "motion",
    "motion.png",
    "Error of the motion rungs, and of pymunk alone, against their time a shot.",
)
_study(
    chart,
    "camera",
    "camera.png",
    "Error of every way of locating the ball in a picture against its time a frame.",
)
_study(
    stability,
    "collision",
    "stability.png",
    "Map the steps of the modal rung against modes, place, speed and ball.",
)
_study(
    stability,
    "motion",
    "stability.png",
    "Map the steps of pymunk, alone and as a rung, against speed, place and its settings.",
)
_study(
    stability,
    "camera",
    "stability.png",
    "Map the ways of locating the ball against all that may go wrong in a picture.",
)
