"""A finished test: measured results, and the true values, which only a study may read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from virtual_lab.lab.laboratory import Laboratory, constant_name
from virtual_lab.lab.recipe import Recipe
from virtual_lab.measurement.certification import Certification, Certifications
from virtual_lab.measurement.procedure.model import CONTROL
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.origin import ModelUsed
from virtual_lab.records.session import Session, pack
from virtual_lab.simulation.physics.truth import SealedTruth
from virtual_lab.simulation.stations.rig import MotionModel
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class BatTest:
    """A certification with its sealed truth."""

    certification: Certification
    sealed: SealedTruth
    control: BatTest | None = None  # test of the control bat, if the rules require one
    film: Callable[[Path], None] | None = None  # function that films the first shot into a folder


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockTest:
    """The certifications of a block of laboratories, or of one, with their sealed truth."""

    laboratory: Laboratory
    certified: Certifications
    measurands: Mapping[str, Array]  # ``metric`` and the quantities keyed by name, (laboratory,)
    bench: Mapping[str, Array]  # true properties of the bats
    wall: Mapping[str, Array]  # true values of the hits on the wall, (hit,)
    shots: Mapping[str, Array]  # true values of the shots at the bat, (shot,)
    control: BatTest | None = None
    film: Callable[[Path], None] | None = None

    def of(self, index: int, *, camera: bool = True) -> BatTest:
        """Return the test of one laboratory, ready to print and seal.

        `camera` states whether camera and gates are compared, which takes long.
        """
        return BatTest(
            certification=self.certified.row(index, self._session_of, camera=camera),
            sealed=self._seal_truth(index),
            control=self.control,
            film=self.film,
        )

    def _session_of(self, block: SessionBlock) -> Session:
        laboratory = self.laboratory
        motion = _motion_report(laboratory.setup.motion)
        models = {"collision": laboratory.collision.report(), "motion": motion}
        session = laboratory.session_of(block, models)
        if self.control is None:
            return session
        return replace(session, control_sha256=pack(self.control.certification.session).digest)

    def _seal_truth(self, index: int) -> SealedTruth:
        laboratory, reduced = self.laboratory, self.certified.reduced
        rows = reduced.owner == index
        setup, balls = laboratory.setup, laboratory.specimen.balls
        hits = np.arange(next(iter(self.wall.values())).size).reshape(setup.count, -1)[index]

        def value_of(values: Any) -> float:
            return float(np.broadcast_to(values, setup.count)[index])

        constants = {
            constant_name(stage, name): value_of(value)
            for stage, station in laboratory.stations.items()
            for name, value in station.true_constants.items()
        }
        return SealedTruth(
            seed=laboratory.seed,
            number=int(np.broadcast_to(setup.number, setup.count)[index]),
            salt=laboratory.salt,
            reality=setup.reality.value,
            bat=laboratory.specimen.bat.of(index),
            bat_properties={
                name: np.array(values[index] if values.ndim else values)
                for name, values in self.bench.items()
            },
            balls=balls.of(index) if setup.shape else balls,
            constants=constants
            | ({CONTROL: laboratory.control_ratio} if setup.rules.spec.controlled else {}),
            measurand={
                name: float(values[index])
                for name, values in self.measurands.items()
                if np.isfinite(values[index])
            },
            place=reduced.position[rows],
            shots={name: values[rows] for name, values in self.shots.items()},
            wall_hits={name: values[hits] for name, values in self.wall.items()},
            faults=setup.faults.names,
            recipe=Recipe.of(laboratory, index).as_json(),
        )


def _motion_report(motion: MotionModel) -> ModelUsed:
    pinned = "" if motion is MotionModel.CLOSED_FORM else ", as requested"
    return ModelUsed(rung=motion.value, reason=f"{motion.value}{pinned}")
