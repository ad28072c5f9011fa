"""Curves along a bat under standard game conditions: e, r, e_A, BPF, v_bat and v_f.

All numbers are model results for the nominal bat, not measurements.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np
from annotated_types import Gt

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatBody, BatSpec, BatSport, Dimension, Spec
from virtual_lab.files.dictionary import with_units
from virtual_lab.measurement.reduction.kinematics import (
    bat_performance_factor,
    batted_speed,
    recoil_factor_free,
    restitution_from_efficiency,
)
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.relations.peaks import Peak, peak
from virtual_lab.relations.swing import (
    KNOB_OFFSET,
    EnergySwing,
    PowerLawSwing,
    SwingLaw,
    bat_speed,
)
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Collisions, Scenes
from virtual_lab.simulation.physics.beam import Beam, Free, beam_of
from virtual_lab.simulation.physics.modes import barrel_nodes
from virtual_lab.studies.bats.curves import draw_profile
from virtual_lab.studies.bats.text import PEAKS, profile_text
from virtual_lab.units import INCH, MPH, OUNCE, OZ_IN2, Array

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.output.page_figure import PageFigure

CONDITIONS = "standard-2003"
# impact positions of the curves, from the tip [in]
POSITIONS = np.arange(0.5, 12.1, 0.25)


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergySwingSpec(Spec):
    """Constants of the swing law of constant energy; moments of inertia about the batter's axis."""

    knob_from_axis: Annotated[float, Gt(0), Dimension("length")]
    batter_inertia: Annotated[float, Gt(0), Dimension("inertia")]
    reference_inertia: Annotated[float, Gt(0), Dimension("inertia")]


@dataclass(frozen=True, slots=True, kw_only=True)
class GameConditions(Spec):
    """Standard game: pitch, ball and swing for the comparison of bats (the paper's Sec. III D)."""

    name: str
    title: str
    ball: str
    softball: str  # ball for a softball bat
    pitch_speed: Annotated[float, Gt(0), Dimension("speed")]
    angular_speed: Annotated[float, Gt(0), Dimension("angular speed")]
    reference_inertia: Annotated[float, Gt(0), Dimension("inertia")]
    energy_swing: EnergySwingSpec

    def ball_of(self, sport: BatSport | None) -> str:
        """Return the name of the standard ball for the sport of a bat; None: not stated."""
        return self.softball if sport == "softball" else self.ball

    def swing(self, exponent: float | None, reference_inertia: float | None = None) -> SwingLaw:
        """Return the swing law with an exponent, Eq. (14) of Nathan (2003), or of constant energy.

        If `exponent` is None, the law is that of constant energy. `reference_inertia` is about the
        axis of the law [kg m^2]; by default it is the moment of inertia of the game conditions.
        """
        if exponent is not None:
            return PowerLawSwing(
                angular_speed_0=self.angular_speed,
                inertia_0=reference_inertia or self.reference_inertia,
                exponent=exponent,
            )
        return EnergySwing(
            angular_speed_0=self.angular_speed,
            inertia_0=reference_inertia or self.energy_swing.reference_inertia,
            inertia_batter=self.energy_swing.batter_inertia,
            axis_beyond_knob=self.energy_swing.knob_from_axis,
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class BatProfile(StudyResult):
    """Inertial and modal properties of a bat, and its curves along the barrel."""

    bat: BatSpec
    beam: Beam
    frequencies: Array  # bending frequencies of the free bat [Hz]
    nodes: tuple[float, ...]  # nodes of the first two bending modes in the barrel [m]
    ball: BallSpec
    swing: float | None  # exponent n of the swing law; None: constant energy
    reference_inertia: float  # I0 of the swing law, about its axis [kg m^2]
    table: pd.DataFrame  # one row per impact position, columns of `curves_of`

    name = "profile"

    @property
    def title(self) -> str:
        """Title with bat and ball."""
        return f"Profile of {self.bat.name} struck by {self.ball.name}"

    @property
    def rows(self) -> list[Mapping[Hashable, float]]:
        """One row per impact position, in in and mph."""
        return list(self.table.to_dict("records"))

    @property
    def text(self) -> str:
        """Properties of the bat, beside the published ones, and its curves."""
        return profile_text(self.document, self.rows, self.bat.published)

    def draw(self) -> PageFigure:
        """Draw the paper's Fig. 2."""
        return draw_profile(self.table, self.bat.title)

    @property
    def peaks(self) -> dict[str, Peak]:
        """Largest e, BPF, e_A and v_f [mph] on the barrel, each with its position [in]."""
        return peaks_of({str(name): column.to_numpy() for name, column in self.table.items()})

    @property
    def document(self) -> Json:
        """The result as a JSON object, in US customary units."""
        beam = self.beam
        return {
            "bat": self.bat.name,
            "ball": self.ball.name,
            "swing_law": "energy" if self.swing is None else "power",
            "swing_exponent": self.swing,
            "reference_inertia_oz_in2": self.reference_inertia / OZ_IN2,
            "mass_oz": beam.mass / OUNCE,
            "z_cm_in": beam.z_cm / INCH,
            "i_cm_oz_in2": beam.inertia_cm / OZ_IN2,
            "i_knob_oz_in2": _inertia(beam, -KNOB_OFFSET) / OZ_IN2,
            "i_pivot_oz_in2": _inertia(beam, -6 * INCH) / OZ_IN2,
            "modal_frequencies_hz": self.frequencies.tolist(),
            "barrel_nodes_in": [node / INCH for node in self.nodes],
            "peaks": {
                name: {"value": top, "impact_position_in": at}
                for name, (top, at) in self.peaks.items()
            },
            **{str(name): column.tolist() for name, column in self.table.items()},
        }


def profiles(
    bat: str,
    *,
    swings: Sequence[float | None] = (0.0,),
    reference_bat: str | None = None,
    ball: str | None = None,
) -> list[BatProfile]:
    """Return the profiles of a free bat under standard game conditions (the paper's Fig. 2).

    Parameters
    ----------
    bat
        Name in the catalog or path of a .toml file.
    swings
        Exponents n of the swing law, Eq. (14) of Nathan (2003), from 0 (same speed of all bats) to
        0.5 (same kinetic energy of all bats). None means that the total kinetic energy of bat and
        batter is the same for all bats.
    reference_bat
        Bat whose moment of inertia is I0 in the swing law. By default the I0 of the game conditions
        is used, 17000 oz in².
    ball
        Name in the catalog or path of a .toml file; by default the standard ball for the sport of
        the bat.

    Returns
    -------
    list
        One profile per exponent.

    Raises
    ------
    InputError
        A bat or ball is unknown, or a file cannot be used.
    """
    import pandas as pd

    game = catalog.load("conditions", CONDITIONS, GameConditions).spec
    spec = catalog.load_bat(bat).spec
    ball = game.ball_of(spec.sport) if ball is None else ball
    struck = catalog.load("balls", ball, BallSpec).spec
    beam, model = beam_of(spec.body), free_model(spec.body)
    z = POSITIONS * INCH
    recoil = np.asarray(recoil_factor_free(struck.mass, beam.mass, beam.inertia_cm, z - beam.z_cm))
    results = []
    for swing in swings:
        axis = game.swing(swing).axis_beyond_knob
        reference = reference_bat and beam_of(catalog.load_bat(reference_bat).spec.body)
        law = game.swing(swing, _inertia(reference, axis) if reference else None)
        moving = np.asarray(bat_speed(law.angular_speed(_inertia(beam, axis)), beam.length, z))
        scenes = Scenes.with_ball(
            struck, impact_position=z, relative_speed=game.pitch_speed + moving
        )
        collisions = model.collide(scenes)
        results.append(
            BatProfile(
                bat=spec,
                beam=beam,
                frequencies=model.modes.bending_frequencies,
                nodes=barrel_nodes(model.modes),
                ball=struck,
                swing=swing,
                reference_inertia=law.inertia_0,
                table=with_units(
                    pd.DataFrame(curves_of(scenes, collisions, recoil, game.pitch_speed, moving))
                ),
            )
        )
    return results


def curves_of(
    scenes: Scenes, collisions: Collisions, recoil: Array, pitch: float, moving: Array
) -> dict[str, Array]:
    """Return the curves along a bat, keyed by name, each of shape (position,).

    The names are ``impact_position_in`` (from the tip), ``restitution``, ``recoil_factor``,
    ``collision_efficiency``, ``bat_performance_factor``, ``bat_speed_mph``,
    ``batted_speed_mph`` and ``contacts``.

    Parameters
    ----------
    scenes
        Scenes along the bat, with impact positions and ball-wall restitution.
    collisions
        Their collisions.
    recoil
        Recoil factor at each position, (position,).
    pitch
        Speed of the pitched ball [m/s].
    moving
        Speed of the bat at each position, (position,) [m/s].
    """
    e_A = collisions.collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, recoil))
    v_f = np.asarray(batted_speed(e_A, pitch, moving))
    return {
        "impact_position_in": scenes.impact_position / INCH,
        "restitution": e,
        "recoil_factor": recoil,
        "collision_efficiency": e_A,
        "bat_performance_factor": np.asarray(bat_performance_factor(e, scenes.ball_restitution)),
        "bat_speed_mph": moving / MPH,
        "batted_speed_mph": v_f / MPH,
        "contacts": collisions.contacts,
    }


def peaks_of(curves: Mapping[str, Array]) -> dict[str, Peak]:
    """Return the largest e, BPF, e_A and v_f [mph] on the barrel, each with its position.

    These are the bat-ball restitution, the bat performance factor, the collision efficiency and the
    batted-ball speed. `curves` is the result of `curves_of`. The keys of the result are
    ``restitution``, ``bat_performance_factor``, ``collision_efficiency`` and ``batted_speed_mph``.
    A position is in inches from the tip. The peaks are the maxima of cubic splines through the
    curves where ball and bat touch once: near the tip and on the handle a heavy ball may touch a
    light bat twice, and e_A may then be larger than on the barrel.
    """
    once = curves["contacts"] == 1
    return {name: peak(curves["impact_position_in"][once], curves[name][once]) for name in PEAKS}


@lru_cache(maxsize=16)
def free_model(body: BatBody) -> ModalModel:
    """Return the modal model of a free bat. The last 16 models are cached."""
    return ModalModel.of(body, Free())


def _inertia(beam: Beam, axis_beyond_knob: float) -> float:
    return beam.inertia(beam.length + axis_beyond_knob)
