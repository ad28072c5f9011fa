"""Number of bending modes that a collision needs.

The study computes the largest error of e_A along the barrel of a free bat, for a point contact and
for a contact patch, each with and without the static flexibility of the omitted modes. The
reference has 120 modes and the same contact.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import Column
from virtual_lab.sheets import AnyBats, entry_names
from virtual_lab.simulation.collision.modal import STIFF_MODES, ModalModel
from virtual_lab.simulation.collision.patch import PATCH
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.units import INCH, MPH


def convergence(bats: AnyBats = (), *, progress: Progress = quiet) -> Rows[dict[str, Any]]:
    """Show the largest error of e_A against 120 bending modes, by the number of modes.

    The table has one row per bat, contact (``point`` or ``patch``) and treatment of the omitted
    modes (with or without their static flexibility). Columns ``8_modes`` to ``30_modes`` hold the
    largest absolute error of e_A along the barrel, at relative speeds of 60 and 160 mph.

    Parameters
    ----------
    bats
        Bats: names in the catalog or .toml files. By default every bat in the catalog.

        Or sheets.
    progress
        Function that is called with the number of bats done and in total.

    Raises
    ------
    InputError
        A bat is unknown, or its file cannot be used.
    """
    counts, converged = (8, 12, 16, 20, 30), 120
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    place, speed = np.meshgrid(np.linspace(1, 12, 23) * INCH, np.array([60.0, 160.0]) * MPH)
    scenes = Scenes.with_ball(ball, impact_position=place.ravel(), relative_speed=speed.ravel())
    rows, every_bat = [], entry_names(bats) or catalog.names("bats")
    for number, bat in enumerate(every_bat):
        progress("bats", number, len(every_bat))
        every = modes_of(catalog.load_bat(bat).spec.body, Free(), converged + STIFF_MODES)
        none = every.above(converged + STIFF_MODES)
        for contact, patch in {"point": 0.0, "patch": PATCH}.items():
            full = ModalModel(
                modes=every.first(converged), stiff=every.above(converged), patch=patch
            )
            true = full.collide(scenes).collision_efficiency
            for residual in (False, True):
                row: dict[str, Any] = {
                    "bat": bat,
                    "contact": contact,
                    "residual": "with residual" if residual else "without",
                }
                for count in counts:
                    stiff = every.above(count) if residual else none
                    model = ModalModel(modes=every.first(count), stiff=stiff, patch=patch)
                    gap = model.collide(scenes).collision_efficiency - true
                    row[f"{count}_modes"] = float(np.abs(gap).max())
                rows.append(row)
    return Rows(
        name="convergence",
        title=f"largest error of e_A against {converged} modes, by the number of bending modes",
        columns={
            "bat": Column("bat"),
            "contact": Column("contact"),
            "residual": Column("residual flexibility"),
        }
        | {f"{count}_modes": Column(f"{count} modes", form=".1e") for count in counts},
        rows=rows,
    )
