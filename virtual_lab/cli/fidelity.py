"""Commands that chart speed against accuracy, and map where the numerics hold."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from virtual_lab.cli.shared import json_option, print_json, teller

Rows = list[dict[str, Any]]


@click.group()
def chart() -> None:
    """Draw speed against accuracy."""


@chart.command("collision")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("out/chart-collision"),
    show_default=True,
    help="New folder for PNG, CSV and HTML.",
)
@json_option
def chart_collision(out: Path, as_json: bool) -> None:
    """Error of the collision rungs against their time a shot."""
    from virtual_lab.fidelity.collision_chart import measure, save
    from virtual_lab.report.text import table_text

    _measure(measure, save, table_text, out / "collision.png", as_json)


@chart.command("motion")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("out/chart-motion"),
    show_default=True,
    help="New folder for PNG, CSV and HTML.",
)
@json_option
def chart_motion(out: Path, as_json: bool) -> None:
    """Error of the motion rungs, and of pymunk alone, against their time a shot."""
    from virtual_lab.fidelity.motion_chart import chart_text, measure, save

    _measure(measure, save, chart_text, out / "motion.png", as_json)


@click.group()
def stability() -> None:
    """Map where the numerics hold."""


@stability.command("collision")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("out/stability-collision"),
    show_default=True,
    help="New folder for PNG and CSV.",
)
@json_option
def stability_collision(out: Path, as_json: bool) -> None:
    """Map the steps of the modal rung against modes, place, speed and ball."""
    from virtual_lab.fidelity.collision_stability import maps_text, measure, save

    _measure(measure, save, maps_text, out / "stability.png", as_json)


@stability.command("motion")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("out/stability-motion"),
    show_default=True,
    help="New folder for PNG and CSV.",
)
@json_option
def stability_motion(out: Path, as_json: bool) -> None:
    """Map the steps of pymunk, alone and as a rung, against speed, place and its settings."""
    from virtual_lab.fidelity.motion_stability import maps_text, measure, save

    _measure(measure, save, maps_text, out / "stability.png", as_json)


def _measure(
    measure: Callable[..., Rows],
    save: Callable[[Rows, Path], None],
    text: Callable[[Rows], str],
    picture: Path,
    as_json: bool,
) -> None:
    """Measure, save into the picture's folder, which must be new, and print."""
    from virtual_lab.folder import check_new_folder

    check_new_folder(picture.parent)
    rows = measure(say=teller())
    save(rows, picture.parent)
    if as_json:
        print_json(rows)
    else:
        click.echo(f"{text(rows)}\n\n{picture}")
