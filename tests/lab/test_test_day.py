"""A test by steps: their order and the person who takes them change nothing else."""

from dataclasses import replace

import numpy as np

from tests.conftest import PROCEDURE
from tests.laboratories import certified, opened
from virtual_lab import lab
from virtual_lab.measurement.procedure import Judgement, NextShots, judge
from virtual_lab.records import Record

REASON = "sabot scrap on the bat"


def same(one: dict[str, dict[str, Record]], other: dict[str, dict[str, Record]]) -> bool:
    """Return whether two sessions have the same records, bit for bit."""
    return one.keys() == other.keys() and all(
        np.array_equal(getattr(record, name), getattr(other[stage][channel], name), equal_nan=True)
        for stage, records in one.items()
        for channel, record in records.items()
        for name in record.columns
    )


def test_the_order_of_steps_and_rounds_changes_no_record() -> None:
    """With the wall first, the scale last and single shots, metric and all records are equal."""
    run_test = certified(seed=3).certification
    day = lab.TestDay.begin(opened("r161", procedure=PROCEDURE, seed=3))
    day = day.hit_wall().measure_bat().prepare()
    while (asked := day.next_shots()).owner.size:
        day = day.fire(NextShots(asked.owner[:1], asked.position[:1])).judge()
    found = day.finish().of(0).certification
    assert len(day.rounds) > 5
    assert same(dict(found.session.records), dict(run_test.session.records))
    assert found.metric == run_test.metric


def test_the_true_lot_is_the_one_that_the_wall_left() -> None:
    """Softballs age: the true e0 of each is the mean over its hits."""
    day = lab.TestDay.begin(opened("softball-34", procedure="asa", seed=3))
    fresh, after = day.laboratory.specimen.balls, day.hit_wall()
    assert after.wall is not None
    balls = after.session.records["balls"]["log"].ball
    loss = after.wall.truth["restitution_loss"]
    means = [loss[balls == ball].mean() for ball in range(fresh.mass.size)]
    assert min(means) > 1e-6
    found = after.laboratory.specimen.balls.restitution
    assert np.allclose(fresh.restitution - found, means, rtol=1e-9, atol=1e-15)


def test_a_person_may_reject_a_hit() -> None:
    """Another ball is fired, the certificate states the person's reason, and the mean changes."""

    def wary(*given) -> Judgement:
        reasons = judge(*given).reasons
        return Judgement(reasons=tuple(REASON if n == 2 else why for n, why in enumerate(reasons)))

    day = lab.prepare_day(opened("r161", procedure=PROCEDURE, seed=3))
    while (asked := day.next_shots()).owner.size:
        day = day.fire(asked).judge(wary)
    found, sound = day.finish().of(0).certification, certified(seed=3).certification
    assert found.judgement.reasons[2] == REASON
    assert found.judgement.valid.sum() == sound.judgement.valid.sum()
    assert len(found.judgement.reasons) == len(sound.judgement.reasons) + 1
    assert found.metric is not None
    assert sound.metric is not None
    assert found.metric.value != sound.metric.value


def test_a_day_is_not_changed_by_what_follows_it() -> None:
    """Each step returns a new day, so an earlier day can be continued differently."""
    day = lab.prepare_day(opened("r161", procedure=PROCEDURE, seed=3))
    before = replace(day)
    fired = day.fire(day.next_shots()).judge()
    assert day == before
    assert day.reduced is None
    assert fired.reduced is not None
