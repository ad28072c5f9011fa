"""Simulation of the tests of an interlaboratory study, in blocks of laboratories."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.errors import InputError
from virtual_lab.lab import BlockTest, RoundRobin
from virtual_lab.lab.setup import TestSetup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.model import AS_FOUND
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.studies.interlab.study import NAMES, InterlabStudy, sheets_of
from virtual_lab.units import Array, Mask

FOUND, NORMALISED = "as found", "normalized"


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
        return tuple(name for name in self.study.spec.named if clamped or name != "clamp")

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

    def alone(self, factors: Sequence[str]) -> dict[str, float]:
        """Return the standard deviation [SI] that `factors` alone cause, keyed by result name.

        Laboratories without a result are left out.
        """
        study = self.study.spec
        varied = tuple(name for factor in factors for name in NAMES[factor])
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
        with self.round_robin(study.named, study.varied) as shared:
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
    normalised = tested.certified.procedure.normalized
    names = {FOUND: AS_FOUND, NORMALISED: "metric"} if normalised else {FOUND: "metric"}
    return {
        name: np.where(shown, [results[key].value, results[key].u], np.nan)
        for name, key in names.items()
    }
