"""The laboratory of a plan: its rules, its instruments, and simulated tests in it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import Self

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.reading import Key
from virtual_lab.errors import InputError
from virtual_lab.lab import RoundRobin
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.rules import MOST_COUNTED
from virtual_lab.sheets import Sheet
from virtual_lab.studies.plan.prediction import Counts, Exchanged, Forecast
from virtual_lab.studies.plan.sample import SampledTests
from virtual_lab.units import Array

# actions that every shot needs, and the decision whether the shot is valid
EACH_SHOT = (
    *("load-ball", "zero-encoder", "clear-scrap", "wait-pressure", "wait-rest", "fire", "accept"),
)
# numbers of tests: of the present laboratory and with another scatter, and with another u
PILOT, FEW = 1024, 64
LEAST_GAIN = 0.002  # smallest share of the variance that an exchange must remove
MOST_EXCHANGES = 8  # largest number of instruments that may be exchanged
SCATTER = "_scatter"  # ending of the keys of a scatter


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedLaboratory:
    """A laboratory that tests a bat by a procedure, and the instruments it may exchange."""

    shared: RoundRobin
    seed: int
    workers: int
    exchanges: Mapping[str, Sheet]  # new sheet keyed by instrument name
    forecast: Forecast

    @classmethod
    def of(
        cls, bat: str, procedure: str, exchanges: Mapping[str, Sheet], seed: int, workers: int
    ) -> Self:
        """Simulate tests in the laboratory, also with each exchange alone, and return it.

        Only exchanges that lower u noticeably are kept. Raises `InputError` for unknown names, a
        bat that does not fit the procedure, or a procedure that cannot be simulated in blocks.
        """
        shared = RoundRobin.of(bat, procedure)
        if not shared.in_blocks:
            allowed = "its laboratories cannot be played side by side"
            raise InputError("", "procedure", procedure, allowed)
        setup, other = shared.setup, seed ^ 1  # the plans' tests have the seed itself
        forecast = Forecast(
            rules=setup.rules.spec, sample=SampledTests.of(shared, PILOT, other, workers)
        )
        if not forecast.sample.has_result.any():
            raise InputError("", "bat", bat, "no simulated test of this bat has a result")
        gains, samples = {}, {}
        for name, sheet in exchanges.items():
            scatter = _scatter_of(sheet) != _scatter_of(Sheet.of(*_key(sheet)))
            tests = PILOT if scatter else FEW
            with catalog.sheets_in_place({_key(sheet): sheet.text}):
                samples[name] = Exchanged(SampledTests.of(shared, tests, other), scatter)
            gains[name] = replace(forecast, exchanged=[samples[name]]).gain
        names = sorted(gains, key=lambda name: -gains[name])[:MOST_EXCHANGES]
        names = [name for name in names if gains[name] > LEAST_GAIN]
        forecast = replace(forecast, exchanged=[samples[name] for name in names])
        present = forecast.present
        if present.final_hits:
            doubled = replace(present, hits=2 * present.hits)
            forecast = replace(
                forecast,
                doubled=SampledTests.of(_with(shared, forecast, doubled), PILOT, other, workers),
            )
        return cls(
            shared=shared,
            seed=seed,
            workers=workers,
            exchanges={name: exchanges[name] for name in names},
            forecast=forecast,
        )

    def exchange_names(self, number: int) -> tuple[str, ...]:
        """Return the names of the instruments that set number `number` exchanges."""
        return tuple(name for bit, name in enumerate(self.exchanges) if number >> bit & 1)

    def simulate(self, exchanged: Collection[str], counts: Counts, tests: int) -> SampledTests:
        """Return simulated tests with exchanged instruments and other counts."""
        sheets: dict[Key, str] = {
            _key(sheet): sheet.text for name, sheet in self.exchanges.items() if name in exchanged
        }
        with catalog.sheets_in_place(sheets):
            laboratories = _with(self.shared, self.forecast, counts)
            return SampledTests.of(laboratories, tests, self.seed, self.workers)

    def predict_u(self, grid: Counts) -> Array:
        """Return the predicted median u [SI], (set of exchanges, …); inf for an impossible plan."""
        possible = feasible(self.forecast, grid)
        return np.asarray(np.where(possible, self.forecast.u(grid), np.inf))

    def minutes(self, counts: Counts) -> Array:
        """Return the duration of a test [min], shape (set of exchanges, …), … as the counts.

        The actions take as long as at the rehearsal bench. The time to weigh the balls is
        proportional to the number of balls. The time to fire them at the wall is proportional to
        the number of wall hits. Both include the balls of boxes with too few balls in the windows.
        """
        actions = catalog.sheet("bench", "actions")[0]["actions"]
        forecast, present = self.forecast, self.forecast.present
        balls = np.asarray(counts.balls) / present.balls * forecast.sample.boxes.mean()
        times: dict[str, Array] = {
            "weigh-balls": balls,
            "hit-wall": balls * counts.wall_hits / present.wall_hits,
            "set-place": forecast.sample.places.mean(),
            **dict.fromkeys(EACH_SHOT, forecast.shots_of_sets(counts)),
        }
        constants = self.shared.laboratory(self.seed).calibration
        minutes = np.zeros(())
        for name, action in actions.items():
            needed = action.get("needs", "")
            fitted = not needed or any(each.startswith(f"{needed}.") for each in constants)
            if fitted and (action["in_book"] or name in EACH_SHOT):
                minutes = minutes + action["minutes"]["value"] * times.get(name, np.ones(()))
        return minutes


def better_instruments(rigs: Collection[str]) -> dict[str, Sheet]:
    """Return the data sheets of the instruments of `rigs`, with each u and each scatter halved.

    The result is a dictionary from the name of the instrument to its data sheet.

    The data sheet of a rig can also have standard uncertainties or scatters, for example of the
    pivot. Such a sheet is also returned. Its key is the name of the table that has these values,
    for example ``pivot``. The names of several tables are joined by ``+``. Raises `InputError` for
    an unknown rig.
    """
    exchanges: dict[str, Sheet] = {}
    for rig in rigs:
        base, named = Sheet.of("rigs", rig), catalog.rig_instruments(rig).values()
        for sheet in (base, *(Sheet.of("instruments", name) for name in named)):
            stated = {datum.key: datum.value for datum in catalog.datums(sheet.document)}
            half = {
                key: np.divide(value, 2)
                for key, value in stated.items()
                if key.endswith(("_u", SCATTER))
            }
            if half:
                tables = "+".join(dict.fromkeys(key.partition(".")[0] for key in half))
                exchanges[tables if sheet is base else sheet.name] = sheet.with_(half)
    return exchanges


def attempts(forecast: Forecast, counts: Counts) -> Array:
    """Return the largest number of shots that each plan allows, in the shape of the counts.

    The procedure states a largest number of shots, called attempts. A plan with more hits needs
    more attempts. The ratio is the expected number of shots in the plan divided by the expected
    number in the procedure. The attempts of the procedure are multiplied by this ratio and rounded
    up. If the ratio is below 1, the attempts are not changed.
    """
    more = forecast.shots(counts) / forecast.shots(forecast.present)
    return np.asarray(np.ceil(forecast.rules.attempts * np.maximum(more, 1.0)))


def feasible(forecast: Forecast, counts: Counts) -> Array:
    """Return a mask of the plans with possible counts, in the shape of the counts.

    A plan is possible if two conditions are met:

    * None of its counts is above 1000.
    * The largest number of shots that it allows is at most 1000. The function `attempts` computes
      this number.
    """
    numbers = [attempts(forecast, counts), *counts.values]
    return np.asarray(np.max(np.broadcast_arrays(*numbers), axis=0) <= MOST_COUNTED)


def _with(shared: RoundRobin, forecast: Forecast, counts: Counts) -> RoundRobin:
    """Return the laboratories with other counts of the procedure."""
    rules = shared.setup.rules
    changes = {
        "valid_hits": counts.hits,
        "balls": counts.balls,
        "wall_hits": counts.wall_hits,
        "attempts": ceil(attempts(forecast, counts)),
    }
    if counts.final_hits:
        changes["scan.final_hits"] = counts.final_hits
    sheet = Sheet("procedures", rules.spec.name, rules.text).with_(changes)
    entry = catalog.read(sheet.text, sheet.name, Procedure)
    return replace(shared, setup=replace(shared.setup, rules=entry))


def _scatter_of(sheet: Sheet) -> dict[str, object]:
    return {each.key: each.value for each in sheet.datums if each.key.endswith(SCATTER)}


def _key(sheet: Sheet) -> Key:
    return sheet.kind, sheet.name
