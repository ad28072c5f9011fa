"""Sensitivity of the results of a bat to the force law of the ball, which no bat test measures.

All force laws give the same restitution and the same compression time on a wall; they differ in the
shape of the force. The rest of the program uses only the first law.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.measurement.reduction.kinematics import recoil_factor_free
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.output.tables import columns_of
from virtual_lab.relations.swing import bat_speed
from virtual_lab.sheets import AnyBat, entry_name
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.ball import (
    HuntCrossley,
    LawOfBall,
    PowerLaw,
    WallContact,
    wall_contact,
)
from virtual_lab.simulation.physics.beam import Free, beam_of
from virtual_lab.studies.bats.curves import PLACE
from virtual_lab.studies.bats.profile import CONDITIONS, GameConditions, curves_of, peaks_of
from virtual_lab.studies.bats.text import (
    PEAK_COLUMNS,
    LawRow,
    peak_entries,
    peak_position,
    spread_of,
)
from virtual_lab.units import INCH, Array

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

PLACES_IN = np.arange(2.5, 9.01, 0.5)


class _Law(NamedTuple):
    name: str
    make: LawOfBall
    exponent: float


LAWS = (
    _Law("power law", PowerLaw.of, 1.0),
    _Law("power law", PowerLaw.of, 1.5),
    _Law("power law", PowerLaw.of, 2.0),
    _Law("Hunt-Crossley", HuntCrossley.of, 1.0),
    _Law("Hunt-Crossley", HuntCrossley.of, 1.5),
)
# axis labels keyed by curve name
PANELS = {
    "restitution": "$e$",
    "batted_speed_mph": "$v_f$, mph",
}
LINES = {"power law": ("-", "black"), "Hunt-Crossley": ("--", "0.5")}  # style and color by law
MARKERS = {1.0: "o", 1.5: "s", 2.0: "^"}  # markers of the peaks by exponent


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawTable(Rows[LawRow]):
    """Results of a bat by force law of the ball, one row per law."""

    curves: Sequence[Mapping[str, Array]]  # curves along the bat keyed by name, one mapping per law

    def draw(self) -> PageFigure:
        """Draw e and v_f along the barrel for each law, with a marker at each peak."""
        with page_figure(4.6) as figure:
            panels = figure.subplots(2, 1, sharex=True)
            for row, curves in zip(self.rows, self.curves, strict=True):
                dash, colour = LINES[row.law]
                for axes, name in zip(panels, PANELS, strict=True):
                    axes.plot(curves["impact_position_in"], curves[name], dash, color=colour)
                    peak = (row.peaks[peak_position(name)], row.peaks[f"peak_{name}"])
                    label = f"{row.law}, exponent {row.exponent:g}"
                    look = {"linestyle": dash, "marker": MARKERS[row.exponent]}
                    axes.plot(*peak, color=colour, label=label, **look)
            for axes, label in zip(panels, PANELS.values(), strict=True):
                axes.set_ylabel(label)
            panels[0].set_title(as_drawn(f"{self.rows[0].bat}, markers: largest values"))
            panels[1].set_xlabel(PLACE)
            handles = panels[0].get_legend_handles_labels()
            figure.legend(*handles, loc="outside lower center", ncols=3)
        return figure


def sensitivity(bat: AnyBat, *, progress: Progress = quiet) -> LawTable:
    """Show the effect of the ball's force law.

    The table has one row per force law. It has the contact time [ms] and the largest force [kN] of
    the ball on a wall. It also has the largest bat-ball restitution e, bat performance factor BPF,
    collision efficiency e_A and batted-ball speed v_f [mph] of the free bat under standard game
    conditions, each with its position [in from the tip]. The speed of the ball at the wall is the
    relative speed of ball and bat in an impact 6 in from the tip.

    Parameters
    ----------
    bat
        The bat: a name in the catalog or a .toml file.

        Or a sheet, ``vl.bat("r161")``, whose values may be changed.
    progress
        Function that is called with a message that names the law and its exponent. If it is not
        given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        The bat is unknown, or its file cannot be used.
    """
    bat = entry_name(bat)
    game = catalog.load("conditions", CONDITIONS, GameConditions).spec
    ball = catalog.load("balls", game.ball, BallSpec).spec
    spec = catalog.load_bat(bat).spec
    body = spec.body
    beam, z = beam_of(body), PLACES_IN * INCH
    moving = np.asarray(bat_speed(game.angular_speed, beam.length, z))
    middle = 6.0 * INCH  # the wall is hit at the relative speed at this position [m]
    speed = game.pitch_speed + float(bat_speed(game.angular_speed, beam.length, middle))
    e0 = float(ball.restitution.at(speed))
    r = np.asarray(recoil_factor_free(ball.mass, beam.mass, beam.inertia_cm, z - beam.z_cm))
    # With 40 modes, e_A is 2e-4 lower than with 100, for every law.
    model = ReferenceModel.of(body, Free(), 40)
    goal = _on_wall(_Law("", PowerLaw.of, ball.exponent), ball.mass, speed, e0, ball.stiffness)
    rows, curves = [], []
    for law in LAWS:
        progress(f"{law.name}, exponent {law.exponent:g}")
        stiffness = _stiffness(law, ball.mass, speed, e0, float(goal.compression_time))
        scenes = Scenes.of(
            impact_position=z,
            relative_speed=game.pitch_speed + moving,
            ball_mass=ball.mass,
            ball_restitution=ball.restitution.at(game.pitch_speed + moving),
            stiffness=stiffness,
            exponent=law.exponent,
        )
        collisions = replace(model, law=law.make).collide(scenes)
        wall = _on_wall(law, ball.mass, speed, e0, stiffness)
        curves.append(curves_of(scenes, collisions, r, game.pitch_speed, moving))
        rows.append(
            LawRow(
                bat=spec.name,
                law=law.name,
                exponent=law.exponent,
                stiffness=stiffness,
                wall_time_ms=float(wall.time) * 1e3,
                wall_force_kn=float(wall.force) / 1e3,
                peaks=peak_entries(peaks_of(curves[-1])),
            )
        )
    return LawTable(
        name="sensitivity",
        title=f"{spec.name}: largest values (at inches from the tip) by force law of the ball",
        columns=columns_of(rows[0]) | PEAK_COLUMNS,
        rows=rows,
        words=spread_of(rows),
        curves=curves,
    )


def _stiffness(law: _Law, mass: float, speed: float, e0: float, time: float) -> float:
    """Return the stiffness k for which the ball is compressed on a wall in `time` [s]."""
    unit = _on_wall(law, mass, speed, e0, 1.0).compression_time
    # At a given speed the time is proportional to the compression, which is proportional to k^(-1 /
    # (a + 1)).
    return float((unit / time) ** (law.exponent + 1))


def _on_wall(law: _Law, mass: float, speed: float, e0: float, stiffness: float) -> WallContact:
    contact_law = law.make(stiffness=stiffness, exponent=law.exponent, restitution=e0, speed=speed)
    if isinstance(contact_law, HuntCrossley):
        return contact_law.wall_contact(mass, speed)
    arguments = (mass, speed, stiffness, law.exponent, e0)
    return wall_contact(*(np.array(number) for number in arguments))
