"""The command that fires beside the centre of percussion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from virtual_lab.cli.shared import json_option, names, print_json, teller

__all__ = ["percussion"]


@click.command()
@click.argument("bat", shell_complete=names("bats"))
@click.option("--laboratories", type=click.IntRange(min=2), default=10, show_default=True)
@click.option("--first-seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option("--shots", type=click.IntRange(min=2), default=6, show_default=True, help="A place.")
@click.option(
    "--out", type=click.Path(path_type=Path), help="New folder for the CSV and the picture."
)
@json_option
def percussion(bat: str, out: Path | None, as_json: bool, **asked: Any) -> None:
    """Fire at BAT on its pivot along the barrel: what hits beside the centre of percussion cost."""
    from virtual_lab.files import check_new_folder
    from virtual_lab.studies.bats.percussion import percussion as run
    from virtual_lab.studies.bats.percussion import save_percussion
    from virtual_lab.studies.bats.percussion_text import percussion_text

    if out:
        check_new_folder(out)
    found = run(bat, say=teller(), **asked)
    if out:
        save_percussion(found, out)
    if as_json:
        print_json(found.document)
    else:
        picture = f"\n\n{out / 'percussion.png'}" if out else ""
        click.echo(f"{percussion_text(found.rows, found.percussion_in)}{picture}")
