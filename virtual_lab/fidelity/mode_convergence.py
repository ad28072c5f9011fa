"""Number of bending modes that a collision needs.

The study computes the largest error of e_A along the barrel of a free bat, for a point contact and
for a contact patch, each with and without the static flexibility of the omitted modes. The
reference has 120 modes and the same contact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.output.tables import Column
from virtual_lab.sheets import AnyBats, entry_names
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.patch import PATCH
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.units import INCH, MPH

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

COUNTS = (8, 12, 16, 20, 30)  # numbers of bending modes
MARKERS = "osD^v<>"  # markers of the bats, used again after the last one
CONTACTS = {"point": "point contact", "patch": "contact patch"}  # panel titles
DASHES = {"without": "--", "with residual": "-"}  # line styles by treatment of omitted modes


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ModeConvergence(Rows[dict[str, Any]]):
    """Largest errors of e_A by the number of modes, one row per bat, contact and treatment."""

    def draw(self) -> PageFigure:
        """Draw the errors against the number of modes, one panel per contact."""
        bats = list(dict.fromkeys(row["bat"] for row in self.rows))
        with page_figure(3.6) as figure:
            panels = figure.subplots(1, 2, sharex=True, sharey=True)
            for axes, (contact, title) in zip(panels, CONTACTS.items(), strict=True):
                for row in (row for row in self.rows if row["contact"] == contact):
                    bat, dash = bats.index(row["bat"]), DASHES[row["residual"]]
                    label = as_drawn(row["bat"]) if dash == "-" else None
                    look = {"marker": MARKERS[bat % len(MARKERS)], "linestyle": dash}
                    errors = [row[f"{count}_modes"] for count in COUNTS]
                    axes.plot(COUNTS, errors, color="black", markersize=3, label=label, **look)
                axes.set(title=title, xlabel="number of bending modes")
            panels[0].set(yscale="log", ylabel="largest error of $e_A$", xticks=COUNTS)
            handles = panels[0].get_legend_handles_labels()
            figure.legend(*handles, loc="outside lower center", ncols=4)
            words = "static flexibility of the omitted modes: with (solid), without (dashed)"
            figure.suptitle(words, fontsize=8)
        return figure


def convergence(bats: AnyBats = (), *, progress: Progress = quiet) -> ModeConvergence:
    """Show the largest error of e_A for 8 to 30 bending modes, compared with 120 modes.

    The table has one row per bat, contact (``point`` or ``patch``) and treatment of the omitted
    modes (with or without their static flexibility). The columns ``8_modes`` to ``30_modes`` hold
    the largest absolute error along the barrel, at relative speeds of 60 and 160 mph. e_A is the
    collision efficiency.

    Parameters
    ----------
    bats
        Bats: names in the catalog or .toml files. By default every bat in the catalog.

        In Python, sheets such as ``vl.bat("r161")`` are also allowed.
    progress
        Function that is called with a message, the number of bats done, and the total. If it is not
        given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        A bat is unknown, or its file cannot be used.
    """
    converged = 120
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    place, speed = np.meshgrid(np.linspace(1, 12, 23) * INCH, np.array([60.0, 160.0]) * MPH)
    scenes = Scenes.with_ball(ball, impact_position=place.ravel(), relative_speed=speed.ravel())
    rows, every_bat = [], entry_names(bats) or catalog.names("bats")
    for number, bat in enumerate(every_bat):
        progress("bats", number, len(every_bat))
        every = modes_of(catalog.load_bat(bat).spec.body, Free())
        none = every.above(every.count)
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
                for count in COUNTS:
                    stiff = every.above(count) if residual else none
                    model = ModalModel(modes=every.first(count), stiff=stiff, patch=patch)
                    gap = model.collide(scenes).collision_efficiency - true
                    row[f"{count}_modes"] = float(np.abs(gap).max())
                rows.append(row)
    return ModeConvergence(
        name="convergence",
        title=f"largest error of e_A against {converged} modes, by the number of bending modes",
        columns={
            "bat": Column("bat"),
            "contact": Column("contact"),
            "residual": Column("residual flexibility"),
        }
        | {f"{count}_modes": Column(f"{count} modes", form=".1e") for count in COUNTS},
        rows=rows,
    )
