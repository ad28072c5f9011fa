"""Requirements on every rig, checked for any author.

The author of a rig runs these checks, whether it is installed or not:

    @pytest.mark.parametrize("check", conformance.CHECKS, ids=conformance.name_of)
    def test_my_rig(check, tmp_path):
        check(conformance.Bench(my_rig, tmp_path))

No check depends on a particular rig; each tests a requirement that
`virtual_lab.simulation.stations.rig` documents.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.records import Record, record_types
from virtual_lab.records.origin import Supplied
from virtual_lab.records.session import Session, load_session, save_session
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import CollisionModel, Scenes
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.physics.beam import Support
from virtual_lab.simulation.physics.truth import TrueOutcome, draw_balls, make_bat
from virtual_lab.simulation.stations.rig import (
    ImpactStation,
    Rig,
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    Station,
)
from virtual_lab.streams import Quiet, Streams
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["CHECKS", "Bench", "name_of"]

SEED = 918273645546372819
SHOTS = 4
FEWER = 2
SPEED = 26.8224  # m/s, 60 mph
PLACE = 0.15  # m, on the barrel of any bat
TURN_RATE = 50.0  # rad/s, of a rig that swings its bat


class _Modal:
    """The modal model for all collisions."""

    @staticmethod
    @lru_cache(maxsize=4)
    def __call__(body: BatBody, support: Support) -> CollisionModel:
        return ModalModel.of(body, support)

    def efficiencies(self, struck: Any, support: Support, scenes: Scenes) -> np.ndarray:
        ((body, _),) = struck
        return self(body, support).collide(scenes).collision_efficiency

    true_efficiencies = efficiencies


@dataclass
class Bench:
    """One rig under test, with the plays that several checks use."""

    rig: Rig
    folder: Path

    @cached_property
    def specimen(self) -> Specimen:
        """Return a drawn bat and lot of the catalog's first bat and first ball."""
        bat = catalog.load_bat(catalog.names("bats")[0]).spec
        ball = catalog.load("balls", catalog.names("balls")[0], BallSpec).spec
        draws = Streams(SEED)
        return Specimen(
            bat=make_bat(bat, draws), balls=draw_balls(ball, SHOTS, draws), collision=_Modal()
        )

    def plan(self, shots: int = SHOTS, first: int = 0) -> ShotPlan:
        """Plan one shot for each of the first `shots` balls, numbered from `first`."""
        return ShotPlan(
            slot=first + np.arange(shots),
            ball=np.arange(shots),
            speed=np.full(shots, SPEED),
            place=np.full(shots, PLACE),
            turn_rate=TURN_RATE if "swing" in self.rig.channels else 0.0,
        )

    @cached_property
    def played(self) -> RigOutput:
        """Return one play of the first shots."""
        return self.play()

    def play(self, *, seed: int = SEED, shots: int = SHOTS, first: int = 0) -> RigOutput:
        """Commission the rig again and play: two calls share only their arguments."""
        draws = Streams(seed)
        return self.rig.commission(draws).play(self.plan(shots, first), self.specimen, draws)


def same(left: Mapping[str, Record], right: Mapping[str, Record]) -> bool:
    """Return whether two plays recorded the same channels with the same bits."""
    return left.keys() == right.keys() and all(
        type(left[channel]) is type(right[channel])
        and all(
            getattr(left[channel], field).tobytes() == getattr(right[channel], field).tobytes()
            for field in left[channel].columns
        )
        for channel in left
    )


def attributes(bench: Bench) -> None:
    """Have a name, a stage and the other required attributes."""
    rig = bench.rig
    assert rig.name
    assert rig.name == rig.name.strip().lower()
    assert isinstance(rig.stage, Stage)
    assert rig.channels
    for channel, kind in rig.channels.items():
        assert channel == Path(channel).name, "a channel is the name of a file"
        assert kind in record_types().values()


def records_are_as_declared(bench: Bench) -> None:
    """Record at least one channel, and only declared channels of the declared types."""
    records = bench.played.records
    assert records
    for channel, record in records.items():
        assert type(record) is bench.rig.channels[channel]


def records_survive_the_disk(bench: Bench) -> None:
    """Keep all bits of the records when they are saved and loaded."""
    records, stage = bench.played.records, bench.rig.stage.value
    calibration = bench.rig.commission(Streams(SEED)).calibration
    session = Session(
        bat="bat",
        ball="ball",
        rigs={stage: bench.rig.name},
        procedure_text="",
        calibration={f"{stage}.{key}": known for key, known in calibration.items()},
        records={stage: records},
        origin=Supplied(laboratory="conformance"),
    )
    save_session(session, bench.folder)
    loaded = load_session(bench.folder)
    assert same(loaded.records[stage], records)
    assert {k: (e.value, e.u, e.dof) for k, e in loaded.calibration.items()} == {
        k: (e.value, e.u, e.dof) for k, e in session.calibration.items()
    }


def same_seed_same_records(bench: Bench) -> None:
    """Draw only from `draws`: a rig commissioned twice gives the same records."""
    first, second = bench.played, bench.play()
    assert same(first.records, second.records)
    assert first.truth.keys() == second.truth.keys()
    for name, values in first.truth.items():
        assert values.tobytes() == second.truth[name].tobytes()


def other_seed_other_records(bench: Bench) -> None:
    """Another seed gives another laboratory: no noise of the first one remains."""
    assert not same(bench.played.records, bench.play(seed=SEED + 1).records)


def other_shots_other_noise(bench: Bench) -> None:
    """Shots with other numbers have other noise. A bench has no shots."""
    if bench.rig.stage is not Stage.BENCH:
        assert not same(bench.played.records, bench.play(first=SHOTS).records)


def a_shot_hangs_on_its_number_alone(bench: Bench) -> None:
    """Each shot has the same bits if it is fired in another order or round.

    This holds for both details of the records. Readings once per laboratory stay the same, too.
    """
    draws = Streams(SEED)
    station = bench.rig.commission(draws)
    for detail in RecordDetail:
        plan = replace(bench.plan(), detail=detail)
        whole = station.play(plan, bench.specimen, draws)
        for rows in ([2, 0, 3, 1], [1], [3, 2]):
            part = station.play(_rows_of(plan, rows), bench.specimen, draws)
            assert part.records.keys() == whole.records.keys()
            for channel, record in part.records.items():
                first = whole.records[channel]
                for field, axes in _axes_of(record).items():
                    own, all_of = getattr(record, field), getattr(first, field)
                    grows = axes[0] == "shot" or channel == "ball-mass"
                    expected = all_of[rows] if grows else all_of
                    assert np.array_equal(own, expected, equal_nan=True), f"{channel}.{field}"
            for name, values in part.truth.items():
                first = whole.truth[name]
                expected = first if bench.rig.stage is Stage.BENCH else first[rows]
                assert np.array_equal(values, expected, equal_nan=True), name


def _rows_of(plan: ShotPlan, rows: list[int]) -> ShotPlan:
    own = {name: getattr(plan, name)[rows] for name in ("slot", "ball", "speed", "place")}
    return replace(plan, **own)


def _axes_of(record: Record) -> dict[str, tuple[str, ...]]:
    """Return the axes of all columns and attached arrays of a record."""
    columns = {field: column.axes for field, column in record.columns.items()}
    there = {name: axes for name, axes in record.attached.items() if len(getattr(record, name))}
    return columns | there


def fewer_shots_same_shapes(bench: Bench) -> None:
    """Only the shot axis (and the item axis of a bench) depends on the number of shots."""
    many, few = bench.played, bench.play(shots=FEWER)
    assert many.records.keys() == few.records.keys()
    for channel, record in many.records.items():
        for field, column in record.columns.items():
            more, less = getattr(record, field), getattr(few.records[channel], field)
            grows = column.axes[0] == "shot" or (
                bench.rig.stage is Stage.BENCH and more.shape[0] == SHOTS != less.shape[0]
            )
            expected = ((FEWER,) if grows else more.shape[:1]) + more.shape[1:]
            assert less.shape == expected, f"{channel}.{field}"
            if column.axes[0] == "shot":
                assert more.shape[0] == SHOTS


def true_constants_are_known_ones(bench: Bench) -> None:
    """Every uncertain constant of a calibration has a true value near its stated one."""
    station = bench.rig.commission(Streams(SEED))
    for key, known in station.calibration.items():
        if known.u > 0:
            deviation = abs(station.true_constants[key] - known.value)
            assert 0 < deviation < 6 * known.u, key  # by chance: 2e-9 per constant
    for key in station.true_constants.keys() & station.calibration.keys():
        known = station.calibration[key]
        assert abs(station.true_constants[key] - known.value) <= 6 * known.u, key


def quiet_laboratory_is_nominal(bench: Bench) -> None:
    """Without randomness every true constant equals its calibration."""
    for ideal in (False, True):
        station = bench.rig.commission(Quiet(), ideal=ideal)
        _all_nominal(station)


def ideal_rig_has_no_uncertainty(bench: Bench) -> None:
    """Know all constants exactly if the rig is ideal, whatever is drawn."""
    station = bench.rig.commission(Streams(SEED), ideal=True)
    for key, known in station.calibration.items():
        assert known.u == 0, key
        assert known.dof == inf, key
    _all_nominal(station)


def calibration_is_of_estimates(bench: Bench) -> None:
    """Calibrations are `Estimate`s, true constants finite numbers."""
    station = bench.rig.commission(Streams(SEED))
    assert all(isinstance(known, Estimate) for known in station.calibration.values())
    assert all(np.isfinite(value) for value in station.true_constants.values())


def truth_has_a_shot_axis(bench: Bench) -> None:
    """Give the truth as arrays with one entry per shot, or as single numbers for a bench."""
    truth = bench.played.truth
    assert truth, "a rig that hides what happened cannot be scored"
    for name, values in truth.items():
        assert isinstance(values, np.ndarray), name
        if bench.rig.stage is Stage.BENCH:
            assert values.ndim == 0 or values.shape[0] in (1, SHOTS), name
        else:
            assert values.shape[:1] == (SHOTS,), name


def seed_is_in_no_record(bench: Bench) -> None:
    """No number in a record equals the seed, and no file contains its digits."""
    records = bench.played.records
    for channel, record in records.items():
        for field in record.columns:
            assert not np.any(getattr(record, field) == float(SEED)), f"{channel}.{field}"
        assert str(SEED) not in record.table().to_csv()


def log_is_the_order(bench: Bench) -> None:
    """Log the plan, not the true events, if the rig keeps a shot log."""
    log = bench.played.records.get("log")
    if log is not None:
        plan = bench.plan()
        assert np.array_equal(log.ball, plan.ball)
        assert np.array_equal(log.nominal_speed, plan.speed)
        assert np.array_equal(log.place, plan.place)


def impact_station_knows_the_measurand(bench: Bench) -> None:
    """One plausible number per position, which depends only on bat and mean ball."""
    station = bench.rig.commission(Streams(SEED))
    if bench.rig.stage is not Stage.IMPACT:
        return
    assert isinstance(station, ImpactStation)
    plan = bench.plan()
    before = station.outcome(plan, bench.specimen)
    assert isinstance(before, TrueOutcome)
    station.play(plan, bench.specimen, Streams(SEED))
    after = station.outcome(plan, bench.specimen)
    for name, values in _shares_of(before).items():
        assert values.shape == (SHOTS,), name
        assert np.array_equal(values, _shares_of(after)[name]), name
        assert (values == values[0]).all(), name  # equal positions and speeds
        assert (np.abs(values) < 1).all(), name
    assert (before.relative_speed >= SPEED).all()


def _shares_of(outcome: TrueOutcome) -> dict[str, np.ndarray]:
    return {
        "collision_efficiency": outcome.collision_efficiency,
        "ball_restitution": outcome.ball_restitution,
        **{f"free {name}": values for name, values in asdict(outcome.free).items()},
        **{f"pivoted {name}": values for name, values in asdict(outcome.pivoted).items()},
    }


def _all_nominal(station: Station) -> None:
    for key, known in station.calibration.items():
        if key in station.true_constants:
            assert station.true_constants[key] == known.value, key


def name_of(check: Callable[[Bench], None]) -> str:
    """Return a check's name for a report."""
    return check.__name__


CHECKS: tuple[Callable[[Bench], None], ...] = (
    attributes,
    records_are_as_declared,
    records_survive_the_disk,
    same_seed_same_records,
    other_seed_other_records,
    other_shots_other_noise,
    a_shot_hangs_on_its_number_alone,
    fewer_shots_same_shapes,
    true_constants_are_known_ones,
    quiet_laboratory_is_nominal,
    ideal_rig_has_no_uncertainty,
    calibration_is_of_estimates,
    truth_has_a_shot_axis,
    seed_is_in_no_record,
    log_is_the_order,
    impact_station_knows_the_measurand,
)
