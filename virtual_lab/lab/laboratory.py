"""A laboratory on the day of a test: installed rigs, specimen, and calibrations."""

from __future__ import annotations

import datetime
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.lab.fitting import (
    nominal_places,
    require_ball,
    require_camera,
    require_motion,
    require_places,
    require_rig,
)
from virtual_lab.lab.setup import TestSetup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.records.origin import Simulated
from virtual_lab.records.session import Session
from virtual_lab.simulation.collision.ladder import Ladder, probing_scenes
from virtual_lab.simulation.physics.beam import Pinned
from virtual_lab.simulation.rig import (
    ImpactStation,
    Reality,
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    Station,
    find_rig,
)
from virtual_lab.simulation.truth import draw_balls, made_bat
from virtual_lab.streams import Draws, Quiet, commitment
from virtual_lab.uncertainty.estimate import Estimate

SEED_BITS = 128  # of a seed that is drawn: too many to try
EFFICIENCY_U = 2e-3  # standard uncertainty of e_A in a test: 0.8e-3 to 2.4e-3 by procedure


@dataclass(frozen=True, slots=True, kw_only=True)
class Laboratory:
    """One laboratory on the day of one test."""

    setup: TestSetup
    seed: int
    salt: bytes
    draws: Draws
    collision: Ladder
    stations: Mapping[Stage, Station]
    specimen: Specimen
    session: Session  # what stands in it before anything is measured
    control: float = 1.0  # true e of the control bat with these balls over the e it is known by

    @classmethod
    def open(cls, setup: TestSetup) -> Laboratory:
        """Install the rigs and draw bat and balls; without a seed a random one is used.

        Raises
        ------
        InputError
            An unknown rig or collision model, a motion model that the rig does not have, a rig
            without a record that the procedure needs, a film without a camera, a bat or ball
            that does not fit the procedure.
        """
        rules, bat, ball = setup.rules.spec, setup.bat.spec, setup.ball.spec
        rig = find_rig(setup.rig, Stage.IMPACT)
        require_rig(rig, rules)
        require_motion(rig, setup.motion)
        if setup.film:
            require_camera(rig)
        require_places(rules, bat)
        require_ball(rules, ball)
        seed = secrets.randbits(SEED_BITS) if setup.seed is None else setup.seed
        salt = secrets.token_bytes(16)
        draws = setup.draws(seed)
        own = draws if setup.test is None else setup.draws(seed, setup.test)
        ideal = setup.reality is Reality.IDEAL
        stations = {
            stage: setup.faults.station(stage, find_rig(name, stage).commission(draws, ideal=ideal))
            for stage, name in setup.rigs.items()
        }
        known = {
            constant_name(stage, name): estimate
            for stage, station in stations.items()
            for name, estimate in station.calibration.items()
        }
        collision = setup.collision or collision_of(bat, ball, rules, setup.rung)
        return cls(
            setup=setup,
            seed=seed,
            salt=salt,
            draws=own,
            collision=collision,
            stations=stations,
            specimen=Specimen(
                bat=made_bat(bat, own if setup.made else Quiet()),
                balls=draw_balls(ball, rules.balls, own),
                collision=collision,
            ),
            session=Session(
                bat=bat.name,
                ball=ball.name,
                bat_sport=bat.sport or "",
                ball_sport=ball.sport or "",
                date=datetime.date.today().isoformat(),
                particulars=setup.particulars,
                rigs={stage.value: name for stage, name in setup.rigs.items()},
                procedure_text=setup.rules.text,
                calibration=setup.faults.calibration(known | lot_constants(ball)),
                records={},
                origin=Simulated(
                    reality=setup.reality.value,
                    sealing=_sealing(setup),
                    seed_commitment=commitment(salt, seed),
                    unverified_numbers=setup.unverified,
                    rungs={},
                ),
            ),
        )

    @property
    def rules(self) -> Entry[Procedure]:
        """The procedure, with its text."""
        return self.setup.rules

    @property
    def origin(self) -> Simulated:
        """What a session of this laboratory may say of its simulation."""
        return cast("Simulated", self.session.origin)

    @property
    def impact(self) -> ImpactStation:
        """The rig that fires at the bat, as installed in this laboratory."""
        return cast("ImpactStation", self.stations[Stage.IMPACT])

    def play(self, stage: Stage, plan: ShotPlan) -> RigOutput:
        """Carry out ordered shots, with the faults of this day."""
        station = self.stations[stage]
        return self.setup.faults.play(stage, station, plan, self.specimen, self.draws)


@lru_cache(maxsize=32)
def collision_of(bat: BatSpec, ball: BallSpec, rules: Procedure, rung: str | None = None) -> Ladder:
    """Return the collision of a bat's individuals in tests by a procedure.

    Tests of one setup share it, so its rung is chosen once.
    """
    speed = rules.ball_speed + (rules.bat_speed or 0.0)
    return Ladder(
        nominal=bat.body,
        support=Pinned(bat.body.length - rules.pivot_from_knob),
        probe=probing_scenes(ball, speed, nominal_places(rules, bat)),
        standard_uncertainty=EFFICIENCY_U,
        rung=rung,
    )


def constant_name(stage: Stage, name: str) -> str:
    """Return a constant's name in a session; rigs in one hall share air and gravity."""
    if name.startswith("hall."):
        return name
    return f"hall.{name}" if name.startswith("air.") else f"{stage.value}.{name}"


def lot_constants(ball: BallSpec) -> dict[str, Estimate]:
    """Return the constants of a lot that are known before a ball is measured."""
    return {
        "ball.radius": Estimate(value=ball.radius, u=ball.radius_u),
        "ball.restitution_slope": Estimate(
            value=ball.restitution.slope, u=ball.restitution.slope_u
        ),
    }


def _sealing(setup: TestSetup) -> str:
    """Return whether somebody with the records could recompute the truth by trying seeds."""
    if setup.reality is not Reality.REAL:
        return "reproducible: nothing is random, not sealed"
    if setup.seed is not None:
        return "reproducible: seed chosen by the operator, not sealed"
    return f"sealed: random seed of {SEED_BITS} bits, stored only with the truth"
