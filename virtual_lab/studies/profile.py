"""A bat along its barrel under standard game conditions: e, r, e_A, bat and batted-ball speed.

What the model says of the bat as drawn: nothing here is measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.collision.modal import ModalModel
from virtual_lab.collision.scene import Scenes
from virtual_lab.errors import InputError
from virtual_lab.physics.beam import Beam, beam_of
from virtual_lab.physics.modes import barrel_nodes
from virtual_lab.physics.supports import Free
from virtual_lab.physics.swing import KNOB_OFFSET, PowerLawSwing, bat_speed
from virtual_lab.relations.kinematics import (
    batted_speed,
    recoil_factor_free,
    restitution_from_efficiency,
)
from virtual_lab.specs import BallSpec, BatSpec, Dimension, Spec
from virtual_lab.units import INCH, MPH, OUNCE, OZ_IN2

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["GameConditions", "Profiled", "profile"]

Array = NDArray[np.float64]
CONDITIONS = "standard-2003"
FIRST_IN, LAST_IN, STEP_IN = 0.5, 16.0, 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class GameConditions(Spec):
    """Pitch, ball and swing under which bats are compared (the paper's Sec. III D)."""

    name: str
    title: str
    ball: str
    pitch_speed: Annotated[float, Gt(0), Dimension("speed")]
    angular_speed: Annotated[float, Gt(0), Dimension("angular speed")]
    reference_inertia: Annotated[float, Gt(0), Dimension("inertia")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Profiled:
    """A bat's inertial and modal properties, and its collision at places z, arrays (place,)."""

    bat: BatSpec
    beam: Beam
    frequencies: Array  # bending, free bat [Hz]
    nodes: tuple[float, ...]  # of the first two bending modes, in the barrel [m]
    swing: float
    z: Array  # [m]
    restitution: Array
    recoil_factor: Array
    collision_efficiency: Array
    bat_speed: Array  # [m/s]
    batted_speed: Array  # [m/s]

    @property
    def table(self) -> pd.DataFrame:
        """A row a place, in the units of the field."""
        import pandas as pd

        return pd.DataFrame(
            {
                "z_in": self.z / INCH,
                "e": self.restitution,
                "r": self.recoil_factor,
                "e_A": self.collision_efficiency,
                "v_bat_mph": self.bat_speed / MPH,
                "v_f_mph": self.batted_speed / MPH,
            }
        )

    @property
    def document(self) -> dict[str, Any]:
        """The same for JSON, in the units of the field."""
        beam = self.beam
        return {
            "bat": self.bat.name,
            "swing_exponent": self.swing,
            "mass_oz": beam.mass / OUNCE,
            "z_cm_in": beam.z_cm / INCH,
            "i_cm_oz_in2": beam.inertia_cm / OZ_IN2,
            "i_knob_oz_in2": beam.inertia(beam.length - KNOB_OFFSET) / OZ_IN2,
            "modal_frequencies_hz": self.frequencies.tolist(),
            "barrel_nodes_in": [node / INCH for node in self.nodes],
            **{str(name): column.tolist() for name, column in self.table.items()},
        }


def profile(bat: str, *, swing: float = 0.0) -> Profiled:
    """Return the profile of a free bat under standard game conditions (the paper's Fig. 2).

    Parameters
    ----------
    bat
        Name in the catalog or path of a .toml file.
    swing
        Exponent n of Eq. (14): 0, all bats swung alike, to 0.5, the same energy into each.

    Raises
    ------
    InputError
        Unknown bat, a file that cannot be used, an exponent outside 0 to 0.5.
    """
    if not 0 <= swing <= 0.5:
        raise InputError("", "swing", swing, "allowed: 0 to 0.5")
    game = catalog.load("conditions", CONDITIONS, GameConditions).spec
    ball = catalog.load("balls", game.ball, BallSpec).spec
    spec = catalog.load_bat(bat).spec
    beam = beam_of(spec.body)
    law = PowerLawSwing(
        angular_speed_0=game.angular_speed, inertia_0=game.reference_inertia, exponent=swing
    )
    model = ModalModel.of(spec.body, Free())
    z = np.arange(FIRST_IN, LAST_IN + STEP_IN / 2, STEP_IN) * INCH
    omega = law.angular_speed(beam.inertia(beam.length - KNOB_OFFSET))
    moving = np.asarray(bat_speed(omega, beam.length, z))
    relative = game.pitch_speed + moving
    line = ball.restitution
    scenes = Scenes.of(
        impact_position=z,
        relative_speed=relative,
        ball_mass=ball.mass,
        ball_restitution=np.maximum(line.value + line.slope * (relative - line.speed), line.floor),
        stiffness=ball.stiffness,
        exponent=ball.exponent,
    )
    efficiency = model.collide(scenes).collision_efficiency
    recoil = np.asarray(recoil_factor_free(ball.mass, beam.mass, beam.inertia_cm, z - beam.z_cm))
    return Profiled(
        bat=spec,
        beam=beam,
        frequencies=model.modes.bending_frequencies,
        nodes=barrel_nodes(model.modes),
        swing=swing,
        z=z,
        restitution=np.asarray(restitution_from_efficiency(efficiency, recoil)),
        recoil_factor=recoil,
        collision_efficiency=efficiency,
        bat_speed=moving,
        batted_speed=np.asarray(batted_speed(efficiency, game.pitch_speed, moving)),
    )
