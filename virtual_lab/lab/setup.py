"""All choices made before a test begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import prod
from typing import Any, Self

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.errors import InputError
from virtual_lab.lab.fitting import identities, unverified_rigs
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.parameters import Propagation
from virtual_lab.records.particulars import NOTHING_STATED, Particulars
from virtual_lab.simulation.collision.ladder import CollisionLaw
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import MotionModel, Reality, Stage
from virtual_lab.streams import LABORATORIES, Draws, Quiet, Selected, Slots, require_seed
from virtual_lab.uncertainty.estimate import Estimates

NO_FAULTS = FaultSet()
LOT = 2_000_000  # branch of the lots' random numbers, above those of tests and control tests


@dataclass(frozen=True, slots=True, kw_only=True)
class TestSetup:
    """The choices for one test, with catalog names resolved."""

    bat: Entry[BatSpec]
    ball: Entry[BallSpec]
    rules: Entry[Procedure]
    rig: str
    unverified_rigs: Mapping[str, str]  # number of unverified values of the rigs, by data sheet
    seed: int | None = None  # None draws a seed that only the sealed truth contains
    # number of the laboratory in the study of this seed; shape (n,) for a block
    number: int | Slots = 0
    reality: Reality = Reality.REAL
    # name of the collision model; None selects the fastest one that is accurate enough
    collision_model: str | None = None
    motion: MotionModel = MotionModel.CLOSED_FORM
    faults: FaultSet = NO_FAULTS
    test: int | None = None
    # number of the lot in its laboratory; None: lot 0, or for a numbered test a lot of its own
    lot: int | None = None
    control_bat: Entry[BatSpec] | None = None
    detail: RecordDetail = RecordDetail.FULL
    film: bool = False  # whether the first shot is filmed
    random_bat: bool = True  # whether the bat is drawn at random; False: the nominal bat
    same_bat: bool = False  # whether all tests of a laboratory use the same bat
    collision: CollisionLaw | None = None  # collision models shared by many laboratories
    particulars: Particulars = NOTHING_STATED  # statements of the certificate beside the results
    # variances of hits in earlier tests, see `SessionBlock`
    history: Mapping[str, Estimates] = field(default_factory=dict)
    uncertainty: Propagation = "first-order"
    # patterns of the names of the random numbers that vary, see `Selected`; None: all
    varied: tuple[str, ...] | None = None

    def require_seeded(self) -> None:
        """Raise `InputError` for a numbered test or lot without a seed."""
        for key, value in (("test", self.test), ("lot", self.lot)):
            if value is not None and self.seed is None:
                allowed = (
                    "allowed only with a seed: it is a number within one laboratory of the seed"
                )
                raise InputError("", key, value, allowed)

    @classmethod
    def of(
        cls,
        bat: str | Entry[BatSpec],
        *,
        procedure: str | Entry[Procedure],
        rig: str | None = None,
        seed: int | None = None,
        number: int = 0,
        reality: Reality = Reality.REAL,
        collision_model: str | None = None,
        faults: Sequence[str] = (),
        control_bat: str | Entry[BatSpec] | None = None,
        detail: RecordDetail = RecordDetail.FULL,
        particulars: Particulars = NOTHING_STATED,
    ) -> Self:
        """Return the setup of a bat's test by a procedure.

        The parameters are those of `virtual_lab.certify`. Bat or procedure may also be an entry
        that was already read. `collision_model` names the model of the collision; by default it is
        the fastest one that is accurate enough. `detail` states whether instruments record every
        reading or only summary values. Instruments of the `particulars` are added to those of the
        rigs' data sheets, and replace instruments with the same name. Other fields of the setup are
        set by `dataclasses.replace`.

        Raises
        ------
        InputError
            A name is unknown, a file cannot be used, the seed is not allowed, or a fault cannot
            occur at the rig.
        """
        if seed is not None:
            require_seed(seed)
        if not 0 <= number < LABORATORIES:
            raise InputError("", "number", number, "allowed: 0 to 2^32 - 1")
        if number and seed is None:
            allowed = "allowed only with a seed: it is the number of a laboratory of the seed"
            raise InputError("", "number", number, allowed)
        rules = (
            catalog.load("procedures", procedure, Procedure)
            if isinstance(procedure, str)
            else procedure
        )
        bats = [
            catalog.load_bat(each) if isinstance(each, str) else each for each in (bat, control_bat)
        ]
        bat_entry, control = bats
        assert bat_entry is not None
        rig = rig or rules.spec.rig
        instruments = identities(rigs_of(rig).values()) | dict(particulars.instruments)
        return cls(
            bat=bat_entry,
            ball=catalog.load("balls", rules.spec.ball, BallSpec),
            rules=rules,
            rig=rig,
            unverified_rigs=unverified_rigs(rigs_of(rig).values()),
            seed=seed,
            number=number,
            reality=reality,
            collision_model=collision_model,
            faults=FaultSet.of(faults, rig=rig),
            control_bat=control,
            detail=detail,
            particulars=replace(particulars, instruments=instruments),
        )

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of values that differ between laboratories: (n,) in a block, () for one."""
        return np.shape(self.number)

    @property
    def count(self) -> int:
        """Number of laboratories."""
        return prod(self.shape)

    def draws(self, seed: int, *branch: int) -> Draws:
        """Return the random numbers of the laboratories for a seed, or of a branch of the seed."""
        draws = self.reality.draws(seed, *branch, laboratory=self.number)
        return draws if self.varied is None else Selected(draws, Quiet(self.number), self.varied)

    def lot_draws(self, seed: int) -> Draws:
        """Return the random numbers from which the properties of the lot of balls are drawn."""
        if self.lot is None and self.test is not None:
            return self.draws(seed, self.test)
        return self.draws(seed, LOT, self.lot) if self.lot else self.draws(seed)

    @property
    def rigs(self) -> dict[Stage, str]:
        """The name of the rig at each stage."""
        return rigs_of(self.rig)

    @property
    def sheets(self) -> dict[tuple[str, str], Entry[Any]]:
        """The sheets of bats, ball and procedure, keyed by kind and name in the catalog."""
        bats = [self.bat] if self.control_bat is None else [self.bat, self.control_bat]
        return {
            **{("bats", each.spec.name): each for each in bats},
            ("balls", self.rules.spec.ball): self.ball,
            ("procedures", self.rules.spec.name): self.rules,
        }

    @property
    def unverified(self) -> dict[str, str]:
        """Number of unverified values that the simulation uses, by data sheet."""
        counts: dict[str, str] = {}
        for (kind, name), entry in self.sheets.items():
            unverified = sum(not datum.verified for datum in entry.sheet)
            if unverified and kind != "procedures":  # the certificate states those of the procedure
                counts[f"{kind}/{name}"] = f"{unverified} of {len(entry.sheet)}"
        return {**counts, **self.unverified_rigs}


def rigs_of(impact: str) -> dict[Stage, str]:
    """Return the name of the rig at each stage of a test whose bat is struck at `impact`."""
    return {Stage.BENCH: "bench", Stage.BALLS: "ball-wall", Stage.IMPACT: impact}
