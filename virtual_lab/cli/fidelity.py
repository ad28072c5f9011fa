"""Commands that chart speed against accuracy, and map where the numerics hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from virtual_lab import api
from virtual_lab.cli.plumbing import command, names

if TYPE_CHECKING:
    from virtual_lab.output.progress import Progress

__all__ = ["chart", "convergence", "stability"]


@click.group()
def chart() -> None:
    """Draw speed against accuracy: of the collision, the motion, the camera."""


@click.group()
def stability() -> None:
    """Map where the numerics hold: of the collision, the motion, the camera."""


def _study(group: click.Group, name: str, words: str) -> None:
    """Add the command of one chart or map."""

    def measured(progress: Progress) -> Any:
        return getattr(api, str(group.name))(name, progress=progress)

    measured.__doc__ = words
    group.add_command(command(name, folder=f"{group.name}-{name}", table=True)(measured))


_study(chart, "collision", "Error of the collision rungs against their time per shot.")
_study(
    chart, "motion", "Error of the motion rungs, and of pymunk alone, against their time per shot."
)
_study(
    chart,
    "camera",
    "Error of every way of locating the ball in a picture against its time per frame.",
)
_study(
    stability,
    "collision",
    "Map the steps of the modal rung against modes, place, speed and ball.",
)
_study(
    stability,
    "motion",
    "Map the steps of pymunk, alone and as a rung, against speed, place and its settings.",
)
_study(
    stability,
    "camera",
    "Map the ways of locating the ball against all that may go wrong in a picture.",
)


@command("convergence", table=True)
@click.argument("bats", nargs=-1, metavar="[BAT]...", shell_complete=names("bats"))
def convergence(bats: tuple[str, ...], progress: Progress) -> Any:
    """Show the error in e_A by the number of modes, for BATs or every bat of the catalog."""
    return api.convergence(bats, progress=progress)
