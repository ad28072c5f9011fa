"""Simulation of the tests of an interlaboratory study, in blocks of laboratories."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.errors import InputError
from virtual_lab.lab import BlockTest, RoundRobin
from virtual_lab.lab.certify import certify_block
from virtual_lab.lab.setup import TestSetup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.model import AS_FOUND
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import Stage
from virtual_lab.studies.interlab.predicted import FOUND, NORMALIZED, NominalTest
from virtual_lab.studies.interlab.study import FACTORS, InterlabStudy, sheets_of
from virtual_lab.units import Array, Mask

_LOT = ("ball.radius", "ball.restitution_slope")  # constants of a lot


@dataclass(frozen=True, slots=True, kw_only=True)
class Play:
    """One bat tested by one procedure in the laboratories of a study."""

    study: Entry[InterlabStudy]
    bat: str
    procedure: str
    workers: int = 1

    @property
    def factors(self) -> tuple[str, ...]:
        """Factors of the study that affect the procedure; the clamp only affects recoil."""
        rules = catalog.load("procedures", self.procedure, Procedure).spec
        clamped = rules.reads == "recoil"
        return tuple(name for name in self.study.spec.varied_factors if clamped or name != "clamp")

    @contextmanager
    def round_robin(self, factors: Sequence[str], varied: tuple[str, ...]) -> Iterator[RoundRobin]:
        """Yield the laboratories in which `factors` have the numbers of the study.

        Within the context the data sheets have these numbers. `varied` are patterns for the names
        of the random numbers that vary, see `Selected`. Raises `InputError` if a name is unknown,
        or if bat, ball or rig does not fit the procedure.
        """
        with catalog.sheets_in_place(sheets_of(self.study, self.procedure, factors)):
            setup = TestSetup.of(self.bat, procedure=self.procedure, detail=RecordDetail.SUMMED)
            setup = replace(setup, random_bat=False, varied=varied)
            shared = RoundRobin(setup=setup)
            if not shared.in_blocks:
                allowed = "its laboratories cannot be played side by side"
                raise InputError("", "procedure", self.procedure, allowed)
            shared.laboratory(self.study.spec.seed)  # checks that all sheets fit together
            yield RoundRobin.with_common_model(setup)

    def nominal_test(self) -> NominalTest:
        """Return the nominal test, with the study's numbers of lots and store."""
        study = self.study.spec
        nominal = [name for name in study.varied_factors if name not in ("wall", "clamp")]
        with self.round_robin(nominal, ()) as shared:
            setup = replace(shared.setup, seed=study.seed, number=np.zeros(1, int))
            tested = certify_block(setup)
        certified, rules = tested.certified, setup.rules.spec
        value = {name: float(each.value[0]) for name, each in certified.results.items()}
        bat, place = certified.reduced.preparation.bat, float(certified.hit_weights.position[0])
        length, mass = float(np.ravel(bat.length)[0]), float(np.ravel(bat.mass)[0])
        axis = length - rules.pivot_from_knob
        lever = axis - float(np.ravel(bat.z_cm)[0])
        bench: Any = tested.laboratory.stations[Stage.BENCH]
        store = bench.spec.store
        return NominalTest(
            procedure=rules,
            bat=setup.bat.spec,
            ball=setup.ball.spec,
            humidity_spread=store.humidity_spread if store else 0.0,
            place=place,
            speed=rules.ball_speed + float(rules.turn_rate(length)) * (axis - place),
            e=value["restitution"],
            e0=value["ball_restitution"],
            r=value["recoil_factor"],
            inertia=float(np.ravel(bat.inertia_cm)[0]) + mass * lever**2,
            calibrations=_effects(tested, set(tested.laboratory.calibration) - {*_LOT}),
            radii=_effects(tested, {_LOT[0]}),
        )

    def alone(self, factors: Sequence[str]) -> dict[str, float]:
        """Return the standard deviation [SI] that `factors` alone cause, keyed by result name.

        Laboratories without a result are left out.
        """
        study = self.study.spec
        varied = tuple(name for factor in factors for name in FACTORS[factor].streams)
        with self.round_robin(factors, varied) as laboratories:
            results = self._results(laboratories, study.alone)
        return {name: float(np.nanstd(values[0], ddof=1)) for name, values in results.items()}

    def exercises(self, first_test: int = 1) -> dict[str, Array]:
        """Return values and stated u, keyed by result name.

        The shape is (2, exercise, laboratory, lot, repeat) [SI]. Values are NaN if a test is
        INVALID. The first test of each laboratory has the number `first_test`.
        """
        study = self.study.spec
        shape = study.exercises, study.laboratories, study.lots, study.repeats
        tests = []
        with self.round_robin(study.varied_factors, study.varied_streams) as shared:
            for number in range(study.lots * study.repeats):
                lot = number // study.repeats
                setup = replace(shared.setup, test=first_test + number, lot=lot)
                count = study.exercises * study.laboratories
                tests.append(self._results(replace(shared, setup=setup), count, valid=True))
        return {
            name: np.stack([test[name] for test in tests], axis=-1).reshape(2, *shape)
            for name in tests[0]
        }

    def _results(
        self, laboratories: RoundRobin, count: int, *, valid: bool = False
    ) -> dict[str, Array]:
        """Return value and u of each result, (2, laboratory) [SI]; NaN without a result."""
        take = _valid_results if valid else _all_results
        parts = list(laboratories.each_block(take, count, self.study.spec.seed, self.workers))
        return {name: np.concatenate([part[name] for part in parts], axis=1) for name in parts[0]}


def _all_results(tested: BlockTest) -> dict[str, Array]:
    return _results_of(tested, tested.certified.has_result)


def _valid_results(tested: BlockTest) -> dict[str, Array]:
    return _results_of(tested, tested.certified.sound)


def _results_of(tested: BlockTest, shown: Mask) -> dict[str, Array]:
    results = tested.certified.results
    return {
        name: np.where(shown, [results[key].value, results[key].u], np.nan)
        for name, key in _keys(tested).items()
    }


def _effects(tested: BlockTest, names: set[str]) -> dict[str, float]:
    """Return the joint effect of the given constants of the budget, keyed by result name."""
    effects = {}
    for name, key in _keys(tested).items():
        parts = tested.certified.results[key].components
        chosen = [at for at, part in enumerate(parts.names) if part in names]
        effects[name] = float(np.linalg.norm(parts.effect[0, chosen]))
    return effects


def _keys(tested: BlockTest) -> dict[str, str]:
    """Return the key of each result of a study in the results of its tests."""
    normalized = tested.certified.procedure.normalized
    return {FOUND: AS_FOUND, NORMALIZED: "metric"} if normalized else {FOUND: "metric"}
