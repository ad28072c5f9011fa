"""A laboratory, or a block of them, on the day of a test: rigs, specimens, and calibrations."""

from __future__ import annotations

import datetime
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self, cast

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.reading import Key
from virtual_lab.catalog.specs import BallSpec, BatBody, BatSpec
from virtual_lab.lab.fitting import (
    nominal_positions,
    require_ball,
    require_camera,
    require_motion,
    require_positions,
    require_rig,
)
from virtual_lab.lab.setup import TestSetup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.origin import ModelUsed, Simulated
from virtual_lab.records.session import Session
from virtual_lab.simulation.collision.ladder import CollisionLaw, Ladder, probing_scenes
from virtual_lab.simulation.physics.beam import Pinned
from virtual_lab.simulation.physics.truth import TrueBalls, draw_balls, make_bat
from virtual_lab.simulation.stations.rig import (
    ImpactStation,
    Reality,
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    Station,
    StoringStation,
    find_rig,
)
from virtual_lab.streams import SEED_BITS, Draws, Quiet, Slots, commitment
from virtual_lab.uncertainty.estimate import Estimate, Estimates
from virtual_lab.units import Mask

EFFICIENCY_U = 2e-3  # typical u of e_A in a test; 0.8e-3 to 2.4e-3, depending on the procedure


@dataclass(frozen=True, slots=True, kw_only=True)
class Laboratory:
    """A laboratory on the day of one test, or a block of laboratories side by side.

    Values that differ between the laboratories of a block are arrays (laboratory,), and numbers for
    a single laboratory. The draws, measurements and certificate of a laboratory depend only on its
    number, so they are the same in a block and alone.
    """

    setup: TestSetup
    seed: int
    salt: bytes  # random bytes of the commitment to the seed; empty: the seed was chosen
    date: str
    sealing: str  # statement whether the truth can be found by trying seeds
    draws: Draws
    collision: CollisionLaw
    stations: Mapping[Stage, Station]
    specimen: Specimen
    calibration: Mapping[str, Estimates]  # constants before the first measurement
    box: Slots  # number of the open box of balls, from 0
    sheets: Mapping[Key, str]  # texts that replaced sheets of the catalog when it was opened
    most_boxes: int = 3  # number of boxes after which a test ends without enough balls
    control_ratio: float = 1.0  # ratio of the control bat's true e with these balls to its known e

    @classmethod
    def open(cls, setup: TestSetup) -> Self:
        """Install the rigs, and draw bat and balls. Without a seed a random one is used.

        Raises
        ------
        InputError
            The rig or the collision model is unknown. The rig does not have the motion model, the
            camera for a film, or a record that the procedure needs. Or the bat or the ball does not
            fit the procedure.
        """
        setup.require_seeded()
        rules, bat, ball = setup.rules.spec, setup.bat.spec, setup.ball.spec
        rig = find_rig(setup.rig, Stage.IMPACT)
        require_rig(rig, rules)
        require_motion(rig, setup.motion)
        if setup.film:
            require_camera(rig)
        require_positions(rules, bat)
        require_ball(rules, ball)
        seed = secrets.randbits(SEED_BITS) if setup.seed is None else setup.seed
        draws = setup.draws(seed)
        test_draws = draws if setup.test is None else setup.draws(seed, setup.test)
        bats = (draws if setup.same_bat else test_draws) if setup.random_bat else Quiet()
        ideal = setup.reality is Reality.IDEAL
        stations = {
            stage: setup.faults.station(stage, find_rig(name, stage).commission(draws, ideal=ideal))
            for stage, name in setup.rigs.items()
        }
        constants = {
            constant_name(stage, name): estimate
            for stage, station in stations.items()
            for name, estimate in station.calibration.items()
        }
        entered = setup.faults.calibration(constants | lot_constants(ball))
        collision = setup.collision or collision_of(bat, ball, rules, setup.collision_model)
        count, box = setup.count, np.zeros(setup.shape, dtype=np.intp)
        return cls(
            setup=setup,
            seed=seed,
            salt=secrets.token_bytes(16) if setup.seed is None else b"",
            date=datetime.date.today().isoformat(),
            sealing=_sealing(setup),
            draws=test_draws,
            collision=collision,
            stations=stations,
            specimen=Specimen(
                bat=make_bat(bat, bats),
                balls=_balls_of(setup, seed, stations[Stage.BENCH], box),
                collision=collision,
            ),
            calibration={
                name: each if isinstance(each, Estimates) else Estimates.stack([each] * count)
                for name, each in entered.items()
            },
            box=box,
            sheets=catalog.texts_in_place(),
        )

    def open_boxes(self, opening: Mask) -> Laboratory:
        """Return the block with the balls of the next box where `opening` is set, (laboratory,)."""
        box = self.box + opening.reshape(self.box.shape)
        balls = _balls_of(self.setup, self.seed, self.stations[Stage.BENCH], box)
        return replace(self, box=box, specimen=replace(self.specimen, balls=balls))

    @property
    def rules(self) -> Entry[Procedure]:
        """The procedure, with its text."""
        return self.setup.rules

    @property
    def impact(self) -> ImpactStation:
        """Rig that fires at the bat, as installed in this laboratory."""
        return cast("ImpactStation", self.stations[Stage.IMPACT])

    @property
    def sessions(self) -> SessionBlock:
        """Sessions before the first measurement."""
        bat, ball = self.setup.bat.spec, self.setup.ball.spec
        return SessionBlock(
            procedure_text=self.setup.rules.text,
            calibration=self.calibration,
            history=self.setup.history,
            records={},
            owner=np.zeros(0, dtype=np.intp),
            laboratories=self.setup.count,
            bat=bat.name,
            bat_sport=bat.sport or "",
            ball_sport=ball.sport or "",
            bat_construction=bat.construction or "",
            boxes=np.reshape(self.box + 1, -1),
        )

    @property
    def session(self) -> Session:
        """Session of a single laboratory before the first measurement."""
        return self.session_of(self.sessions, {})

    def session_of(self, one: SessionBlock, models: Mapping[str, ModelUsed]) -> Session:
        """Return the session of one laboratory, with the models that were used."""
        setup = self.setup
        return Session(
            bat=one.bat,
            ball=setup.ball.spec.name,
            bat_sport=one.bat_sport,
            ball_sport=one.ball_sport,
            bat_construction=one.bat_construction,
            boxes=int(one.boxes[0]),
            date=self.date,
            particulars=setup.particulars,
            rigs={stage.value: name for stage, name in setup.rigs.items()},
            procedure_text=one.procedure_text,
            calibration={name: estimates.row(0) for name, estimates in one.calibration.items()},
            history={name: estimates.row(0) for name, estimates in one.history.items()},
            uncertainty=setup.uncertainty,
            records=one.records,
            origin=Simulated(
                reality=setup.reality.value,
                sealing=self.sealing,
                seed_commitment=commitment(self.salt, self.seed) if self.salt else "",
                unverified_numbers=setup.unverified,
                rungs=models,
            ),
        )

    def play(self, stage: Stage, plan: ShotPlan) -> RigOutput:
        """Return the records and the truth of a plan carried out with the faults of this day."""
        station, specimen = self.stations[stage], self.specimen
        if stage is Stage.IMPACT:
            specimen = replace(specimen, balls=specimen.balls.at_bat())
        return self.setup.faults.play(stage, station, plan, specimen, self.draws)


def _balls_of(setup: TestSetup, seed: int, bench: Station, box: Slots) -> TrueBalls:
    """Return the balls of each laboratory's box. Each box is a lot of its own."""
    lot = setup.lot_draws(seed)
    store = bench.store_humidity(lot, box) if isinstance(bench, StoringStation) else None
    draws = setup.draws(seed) if setup.test is None else setup.draws(seed, setup.test)
    return draw_balls(setup.ball.spec, setup.rules.spec.balls, draws, lot, store, box)


def collision_of(
    bat: BatSpec, ball: BallSpec, rules: Procedure, model_name: str | None = None
) -> Ladder:
    """Return the object that selects and holds the collision model for tests of one bat design.

    The model is used for all individual bats of this design in tests by the procedure `rules`. If
    `model_name` is None, the fastest model that is accurate enough is selected. The selection is
    made when the result is first used, and an unknown name raises `InputError` only then. Setups
    with the same nominal bat, ball, speed, pivot and positions get the same object, so the
    selection is made once.
    """
    speed = rules.ball_speed + (rules.bat_speed or 0.0)
    support = Pinned(bat.body.length - rules.pivot_from_knob)
    return _ladder(bat.body, support, ball, speed, nominal_positions(rules, bat), model_name)


@lru_cache(maxsize=64)
def _ladder(
    body: BatBody,
    support: Pinned,
    ball: BallSpec,
    speed: float,
    places: tuple[float, float],
    model_name: str | None,
) -> Ladder:
    return Ladder(
        nominal=body,
        support=support,
        probe=probing_scenes(ball, speed, places),
        standard_uncertainty=EFFICIENCY_U,
        model_name=model_name,
    )


def constant_name(stage: Stage, name: str) -> str:
    """Return the name of a calibration constant in a session, such as ``impact.gates.clock``.

    `name` is the name at the station, such as ``gates.clock``. The name in the session begins with
    the stage (kind of measurement). Constants of air and gravity are common to all rigs in a hall.
    Their names begin with ``hall`` instead, as in ``hall.air.density``.
    """
    if name.startswith("hall."):
        return name
    return f"hall.{name}" if name.startswith("air.") else f"{stage.value}.{name}"


def lot_constants(ball: BallSpec) -> dict[str, Estimate]:
    """Return the constants of a lot that do not need measurements of its balls, keyed by name.

    They are ``ball.radius`` [m] and ``ball.restitution_slope``, the slope of e0 over speed [s/m].
    """
    return {
        "ball.radius": Estimate(value=ball.radius, u=ball.radius_u),
        "ball.restitution_slope": Estimate(
            value=ball.restitution.slope, u=ball.restitution.slope_u
        ),
    }


def _sealing(setup: TestSetup) -> str:
    """Return a sentence that states whether the truth can be recomputed by trying seeds."""
    if setup.reality is not Reality.REAL:
        return "reproducible: nothing is random, not sealed"
    if setup.seed is not None:
        return "reproducible: seed chosen, not sealed"
    return f"sealed: random seed of {SEED_BITS} bits, stored only with the truth"
