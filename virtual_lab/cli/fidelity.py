"""Commands that chart speed against accuracy, and map where the numerics hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from virtual_lab import api
from virtual_lab.cli.plumbing import command, names

if TYPE_CHECKING:
    from virtual_lab.output.progress import Progress


@click.group()
def chart() -> None:
    """Draw error against run time of models and methods, of a part or of the whole laboratory."""


@click.group()
def stability() -> None:
    """Map where the models of collision and motion, or the camera methods, are valid."""


def _study(group: click.Group, name: str, words: str) -> None:
    """Add the command of one chart or map."""

    def measured(progress: Progress) -> Any:
        return getattr(api, str(group.name))(name, progress=progress)

    measured.__doc__ = words
    group.add_command(command(name, folder=f"{group.name}-{name}", table=True)(measured))


_study(chart, "collision", "Error of the collision models against their time per shot.")
_study(
    chart, "motion", "Error of the motion models, and of pymunk alone, against their time per shot."
)
_study(
    chart,
    "camera",
    "Error of every method to locate the ball against its time per frame.",
)
_study(
    chart,
    "uncertainty",
    "Error of u and of the interval's ends by each method to propagate, against their time.",
)
_study(
    chart,
    "laboratory",
    "Effect of every model and method of a test on its metric, against their time.",
)
_study(
    stability,
    "collision",
    "Map the valid time steps of the modal model over modes, place, speed and ball.",
)
_study(
    stability,
    "motion",
    "Map the valid time steps of pymunk over speed, place and settings.",
)
_study(
    stability,
    "camera",
    "Map the errors of locating the ball over the disturbances of a picture.",
)


@command("convergence", table=True)
@click.argument("bats", nargs=-1, metavar="[BAT]...", shell_complete=names("bats"))
def convergence(bats: tuple[str, ...], progress: Progress) -> Any:
    """Show the error in e_A against the number of modes, for BATs (or all in the catalog)."""
    return api.convergence(bats, progress=progress)
