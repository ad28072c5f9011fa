"""The ball of a laboratory: its lot as measured, and the scatter of e0 between hits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from math import ceil, sqrt
from typing import Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.files import parse_toml
from virtual_lab.lab import RoundRobin
from virtual_lab.lab.fitting import require_ball
from virtual_lab.measurement.certification import Certification, variance_of_hits
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.session_reduction import reduce_block
from virtual_lab.output.metrics import METRICS
from virtual_lab.records.session import Session
from virtual_lab.sheets import Sheet, toml_text
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.studies.own_laboratory.rig_sheets import (
    Document,
    SheetNumbers,
    StatedNumber,
    enter_numbers,
    write_numbers,
)
from virtual_lab.studies.plan.sample import SampledTests
from virtual_lab.uncertainty.scatter import bartlett_p

TESTS, TRIAL = 1024, 0.004  # number of tests, and scatter of e0 of a hit, to adapt the balls
SEED = 1  # seed of the tests that are simulated to find the scatter of e0
LUCKY = 0.05  # share of tests with a smaller u, below which a test is called lucky
STAGES = {"wall": "balls", "bat": "impact"}  # stages of the hits
LUCK = "{}: u {:.2g} in the records, rms {:.2g} in simulated tests; {:.0f} % have a smaller u."
LUCKY_WORDS = " Its hits agree by luck."
SIGNIFICANT = 0.05  # p-value of Bartlett's test below which days differ
DIFFERING = "The scatter of hits at the {} differs from day to day (Bartlett's test, p = {:.2g})."
PLACES = {"wall": "hit_restitution", "bat": "bat_hit_restitution"}  # keys of the scatters


def ball_of_tests(tests: Sequence[Certification]) -> tuple[str, SheetNumbers, list[str]]:
    """Return name and statements of the ball of tests by one procedure, and remarks on their u.

    The sheets of the rigs must be in place. The scatter of e0 is left out if laboratories of the
    procedure cannot be simulated in blocks.
    """
    last = tests[-1]
    rules = catalog.read(last.session.procedure_text, last.procedure.name, Procedure)
    ball, bat = rules.spec.ball, _bat(last.session)
    document, numbers = stated_ball(tests)
    if not RoundRobin.of(bat, rules).in_blocks:
        return ball, numbers, []
    days = [scatter_of_hits(test) for test in tests]
    places = {place: [day[place] for day in days if place in day] for place in PLACES}
    wanted = {place: StandardDeviation.pool(each) for place, each in places.items() if each}
    scatters = hit_scatters(
        wanted, lambda each: sample_of_tests(with_scatter(document, each), bat, rules, SEED)
    )
    shown = {
        f"spread.{PLACES[place]}": (each, f"{STAGES[place]}/gates")
        for place, each in scatters.items()
    }
    entered = enter_numbers(document, shown)
    trial, printed = write_numbers(document, entered, "trial"), METRICS[rules.spec.metric]
    simulated = {
        hits: sample_of_tests(trial, bat, _with_hits(rules, hits), SEED)
        for hits in {_hits_of(test) for test in tests if test.metric is not None}
    }
    remarks = [remark for place, each in places.items() for remark in _differing_days(place, each)]
    for test in tests:
        if test.metric is not None:
            sample = simulated[_hits_of(test)]
            u = sample.u[sample.has_result]
            rms = printed.in_unit(float(np.sqrt(np.mean(u**2))))
            share = float(np.mean(u < test.metric.u))
            name = f"{test.session.bat} by {rules.spec.name}"
            words = LUCK.format(name, printed.in_unit(test.metric.u), rms, 100 * share)
            remarks.append(f"{words}{LUCKY_WORDS if share < LUCKY else ''}")
    return ball, numbers | entered, remarks


def _hits_of(test: Certification) -> int:
    """Return the number of hits per position, those of the test if it has a single position."""
    rules = test.procedure
    return rules.valid_hits if rules.scan else int(test.hit_weights.used.sum())


def _with_hits(rules: Entry[Procedure], hits: int) -> Entry[Procedure]:
    """Return a procedure with another number of hits per position, and attempts in proportion."""
    spec = rules.spec
    attempts = ceil(spec.attempts * hits / spec.valid_hits)
    sheet = Sheet("procedures", spec.name, rules.text).with_(valid_hits=hits, attempts=attempts)
    return catalog.read(sheet.text, sheet.name, Procedure)


def _differing_days(place: str, days: Sequence[StandardDeviation]) -> list[str]:
    """Return a sentence if the scatter of the hits differs from day to day, or an empty list."""
    if len(days) < 2:
        return []
    totals, dof = (np.array([getattr(each, name) for each in days]) for name in ("total", "dof"))
    p = bartlett_p(totals**2, dof)
    return [DIFFERING.format(place, p)] if p < SIGNIFICANT else []


def stated_ball(tests: Sequence[Certification]) -> tuple[Document, SheetNumbers]:
    """Return the sheet of the ball of tests by one procedure, and their statements about it.

    The scatter of e0 between hits stays as in the catalog. Raises `InputError` if the procedure
    would reject most of the measured balls, because no test can be simulated with them.
    """
    rules = tests[-1].procedure
    document = deepcopy(parse_toml(*catalog.source("balls", rules.ball)))
    numbers = enter_numbers(document, _ball_numbers(tests))
    write_numbers(document, numbers, "trial")
    measured = catalog.read(toml_text(document), f"balls/{rules.ball}", BallSpec).spec
    require_ball(rules, replace(measured, name="ball of the records"))
    return document, numbers


def _bat(session: Session) -> str:
    """Return the tested bat if it is in the catalog, or else a bat of its sport."""
    if session.bat in catalog.names("bats"):
        return session.bat
    return "softball-34" if "softball" in (session.bat_sport, session.ball_sport) else "r161"


def scatter_of_hits(test: Certification) -> dict[str, StandardDeviation]:
    """Return the standard deviation of a hit, of e0 at the wall and of the metric at the bat [SI].

    In a scan the hits near the best position count, too, as they do for the stated u. A place where
    the hits are not repeated, or are all equal, is left out.
    """
    reduced, _ = reduce_block(test.block)
    preparation = reduced.preparation
    error = preparation.constants["balls.restitution_0"].row(0)
    hits = int((preparation.balls.ball[0, 0] == 0).sum())
    scatters = {"wall": StandardDeviation(error.u * sqrt(hits), error.dof)}
    budget = test.first_order
    if budget is not None and budget.scatter is not None:
        variance = variance_of_hits(reduced, reduced.hit_weights, budget.scatter.variance)
        scatters["bat"] = StandardDeviation(sqrt(variance.total[0]), float(variance.dof[0]))
    return {place: each for place, each in scatters.items() if each.value and each.dof}


def _ball_numbers(tests: Sequence[Certification]) -> dict[str, tuple[Any, str]]:
    """Return number [SI] and record for each key of a ball's sheet that the records state.

    The numbers are means over the lots, and standard deviations between the balls of a lot. Radius
    and slope are those of the last test, with their u.
    """
    days = [reduce_block(test.block)[0].preparation for test in tests]
    mass = [each.lot.mass[0, 0] for each in days]
    e0 = [each.lot.restitution[0, 0] for each in days]
    errors = [each.constants["balls.restitution_0"].u[0] for each in days]
    last, constants = days[-1].lot, days[-1].constants
    numbers: dict[str, tuple[Any, str]] = {
        "mass": (float(np.mean([each.mean() for each in mass])), "bench/ball-mass"),
        "spread.mass": (StandardDeviation.of_groups(mass), "bench/ball-mass"),
        "restitution.speed": (float(last.speed.ravel()[0]), "balls/log"),
        "restitution.value": (float(np.mean([each.mean() for each in e0])), "balls/gates"),
        "restitution.slope": (float(last.slope.ravel()[0]), "balls/gates"),
        "spread.restitution": (
            StandardDeviation.of_groups(e0, float(np.mean(np.square(errors)))),
            "balls/gates",
        ),
        "radius": (float(constants["ball.radius"].value[0]), "ball.radius"),
        "radius_u": (float(constants["ball.radius"].u[0]), "ball.radius"),
    }
    if "balls.slope_repeatability" not in constants:  # measured at one speed
        slope = "ball.restitution_slope"
        numbers["restitution.slope_u"] = (float(constants[slope].u[0]), slope)
    return numbers


def hit_scatters(
    wanted: Mapping[str, StandardDeviation],
    simulate: Callable[[Mapping[str, float]], SampledTests],
) -> dict[str, StandardDeviation]:
    """Return the scatter of e0 between hits with which simulated hits scatter as `wanted`.

    The variance of a hit is linear in the square of this scatter. Two samples of simulated tests
    are therefore enough to find the scatter at a place. The wall comes first, because an error of
    e0 of the balls changes hits at the bat, too. Instruments and aim alone may cause more variance
    than wanted. In this case the scatter is 0.

    Parameters
    ----------
    wanted
        Standard deviation of a hit: of e0 at the ``wall``, and of the metric at the ``bat`` [SI].
    simulate
        Function that returns simulated tests with a scatter of e0, by place of the hits.
    """
    scatters = dict[str, StandardDeviation]()
    for place in sorted(wanted, key=list(PLACES).index):
        earlier = {each: scatter.value for each, scatter in scatters.items()}
        without, with_it = (
            _variances(simulate(earlier | {place: each}))[place] for each in (0.0, TRIAL)
        )
        others = wanted[place]._replace(known=without)
        scatters[place] = others.scaled(TRIAL / sqrt(with_it - without))
    return scatters


def _variances(sample: SampledTests) -> dict[str, float]:
    """Return the mean variance of a hit in simulated tests, at the wall and at the bat."""
    wall, bat = sample.wall_variance[sample.has_result], sample.pooled[sample.has_result]
    return {"wall": float(wall.mean()), "bat": float(bat.mean())}


def sample_of_tests(
    ball: Mapping[str, Any], bat: str, rules: Entry[Procedure], seed: int
) -> SampledTests:
    """Return simulated tests with a ball that has the content `ball` of its sheet."""
    with catalog.sheets_in_place({("balls", rules.spec.ball): toml_text(ball)}):
        return SampledTests.of(RoundRobin.of(bat, rules), TESTS, seed)


def with_scatter(ball: Mapping[str, Any], scatters: Mapping[str, float]) -> Document:
    """Return the content of a ball's sheet with other scatters of e0, by place of the hits."""
    numbers = {
        f"spread.{PLACES[place]}": StatedNumber(each, "trial") for place, each in scatters.items()
    }
    return write_numbers(deepcopy(dict(ball)), numbers, "trial")
