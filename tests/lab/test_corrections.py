"""Every constant has an effect: a true constant on records, a stated one on results.

`--ideal` tests all corrections together. Here each is tested alone: a true constant that changes
no record, a calibration that moves no result or in the wrong direction, a scatter without effect.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from math import hypot, pi
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipk

from tests.conftest import PROCEDURE, Play
from tests.laboratories import opened
from tests.one_laboratory import reduce_session
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.certificate.filling import certificate
from virtual_lab.lab import prepare_day
from virtual_lab.lab.laboratory import lot_constants
from virtual_lab.lab.plans import with_records
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import (
    ShotResults,
    measured_balls,
    shot_results,
)
from virtual_lab.measurement.session_reduction import Reduction
from virtual_lab.records import BallRecord, Record
from virtual_lab.records.session import Session
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.faults.fault import (
    instrument_of,
    with_instrument,
    with_sheet,
)
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.physics.beam import Pinned, beam_of
from virtual_lab.simulation.physics.truth import draw_balls, make_bat
from virtual_lab.simulation.stations.impact import scenes_of
from virtual_lab.simulation.stations.rig import (
    Reality,
    ShotPlan,
    Specimen,
    Stage,
    Station,
    installed_rigs,
)
from virtual_lab.streams import Draws, Quiet, Streams
from virtual_lab.units import INCH, MPH

Array = np.ndarray
Changed = set[str]
SHOTS = 8
FAR = 20.0  # change of a constant in u, large enough that no resolution hides it
# A summed record depends on the support only by its nominal axis, see `struck`. Only complete
# records or pictures show the others.
UNSEEN = {
    ("ball-cannon", RecordDetail.SUMMED): {"pivot.from_knob"},
    ("filmed-cannon", RecordDetail.SUMMED): {"pivot.from_knob", "camera.gain"},
}


class Collisions:
    """The modal model for all collisions, with its modes computed once."""

    of = staticmethod(cache(ModalModel.of))

    def __call__(self, body: Any, support: Any) -> ModalModel:
        return self.of(body, support)

    def efficiencies(self, struck: Any, support: Any, scenes: Any) -> Array:
        ((body, _),) = struck
        return np.asarray(self.of(body, support).collide(scenes).collision_efficiency)


COLLISIONS = Collisions()


def specimen(ball: BallSpec | None = None, draws: Draws | None = None) -> Specimen:
    ball = ball or catalog.load("balls", "baseball-2003", BallSpec).spec
    return Specimen(
        bat=make_bat(catalog.load_bat("r161").spec, Quiet()),
        balls=draw_balls(ball, SHOTS, draws or Streams(3)),
        collision=COLLISIONS,
    )


def plan(rig: str, detail: RecordDetail, shots: int = SHOTS) -> ShotPlan:
    swung = "swing" in installed_rigs()[rig].channels
    return ShotPlan(
        slot=np.arange(shots),
        ball=np.arange(shots) % SHOTS,
        speed=np.full(shots, 26.0),
        place=np.full(shots, 0.13),
        turn_rate=40.0 if swung else 0.0,
        detail=detail,
    )


def differing(one: Mapping[str, Record], other: Mapping[str, Record]) -> Changed:
    """Return the channels in which the records of two plays differ."""
    return {
        channel
        for channel, record in one.items()
        if any(
            getattr(record, name).tobytes() != getattr(other[channel], name).tobytes()
            for name in record.columns
        )
    }


def moved(station: Station, name: str) -> Station:
    """Return a station with one true constant changed by `FAR` times its u."""
    if name == "wall.restitution":
        return station.with_wall(0.99)
    part, _, key = name.partition(".")
    instrument = instrument_of(station, part)
    if key == "gain":
        return altered(station, part, gain=instrument.sensor.gain * 1.2)
    true, stated = instrument.true[key], instrument.stated[key]
    return altered(station, part, **{key: true + FAR * stated.u})


def altered(station: Station, part: str, **true: float) -> Station:
    """Return a station with some true constants of one instrument changed."""
    return with_instrument(station, part, instrument_of(station, part).with_true(**true))


def with_part_sheet(station: Any, part: str, **changes: Any) -> Any:
    """Return a station with one part, an instrument or not, that differs from its sheet."""
    if instrument_of(station, part):
        return with_sheet(station, part, **changes)
    own = getattr(station, part)
    return replace(station, **{part: replace(own, spec=replace(own.spec, **changes))})


CHEAP = [rig for rig in installed_rigs() if rig != "filmed-cannon"]


@pytest.mark.parametrize(
    ("rig", "detail"),
    [
        *((rig, detail) for rig in CHEAP for detail in RecordDetail),
        ("filmed-cannon", RecordDetail.SUMMED),
    ],
)
def test_every_true_constant_moves_a_record(rig: str, detail: RecordDetail) -> None:
    """For every station, in both details of the records; a clock changes all its times."""
    draws, struck = Streams(11), specimen()
    station = installed_rigs()[rig].commission(draws)
    asked = plan(rig, detail)
    records = station.play(asked, struck, draws).records
    found = {
        name: differing(records, moved(station, name).play(asked, struck, draws).records)
        for name in station.true_constants
        if name not in station.calibration or station.calibration[name].u > 0
    }
    # marks on an aim paper are no shots: they change the aim, not the set position
    still = {name for name, channels in found.items() if not channels - {"aim"}}
    assert still == UNSEEN.get((rig, detail), set())
    for encoder in ("encoder", "swing"):
        if encoder in records:
            assert {"gates", encoder} <= found["gates.clock"]


def test_the_gain_of_a_camera_moves_its_pictures() -> None:
    """The gain is the only camera constant that the ball's position does not depend on."""
    draws, struck = Streams(11), specimen()
    station = installed_rigs()["filmed-cannon"].commission(draws)
    asked = plan("filmed-cannon", RecordDetail.FULL, 1)
    clip = station.play(asked, struck, draws).records["camera"]
    brighter = moved(station, "camera.gain").play(asked, struck, draws).records["camera"]
    ball = clip.pixels > 1.5 * clip.pixels.mean()
    assert ball.any()
    assert np.median(brighter.pixels[ball] / clip.pixels[ball]) == pytest.approx(1.2, abs=0.02)


def watching(records: Mapping[str, Record]) -> str:
    """Return the channel of the instrument that watches the balls."""
    return next(name for name, record in records.items() if isinstance(record, BallRecord))


@pytest.mark.parametrize("rig", [rig for rig in CHEAP if rig != "bench"])
def test_the_lots_own_radius_and_slope_move_records(rig: str) -> None:
    """The true radius and slope of the balls on the rig are those drawn from `lot_constants`."""
    draws, struck = Streams(12), specimen()
    station, asked = installed_rigs()[rig].commission(draws), plan(rig, RecordDetail.FULL)
    records = station.play(asked, struck, draws).records
    spec = struck.balls.spec
    steeper = replace(spec.restitution, slope=1.2 * spec.restitution.slope)
    for other in (replace(spec, radius=1.02 * spec.radius), replace(spec, restitution=steeper)):
        lot = replace(struck, balls=replace(struck.balls, spec=other))
        moved_by = differing(records, station.play(asked, lot, draws).records)
        assert watching(records) in moved_by


def test_a_lots_radius_and_slope_scatter_as_stated() -> None:
    """In 400 lots, (true - stated)/u is standard normal within 4.5 standard errors."""
    spec = catalog.load("balls", "baseball-2003", BallSpec).spec
    known = lot_constants(spec)
    lots = [draw_balls(spec, 1, Streams(seed)).spec for seed in range(400)]
    for name, values in (
        ("ball.radius", [lot.radius for lot in lots]),
        ("ball.restitution_slope", [lot.restitution.slope for lot in lots]),
    ):
        assert known[name].u > 0
        z = (np.array(values) - known[name].value) / known[name].u
        assert abs(z.mean()) < 4.5 / 20
        assert abs(z.var() - 1) < 4.5 * np.sqrt(2 / 400)


SCATTERS = {  # scatters of each rig: field of the station, number of its sheet, scattered quantity
    "bench": [
        ("scale", "repeatability", "bat-mass"),
        ("scale", "resolution", "ball-mass"),
        ("rule", "repeatability", "length"),
        ("rule", "resolution", "barrel-radius"),
        ("stand", "repeatability", "balance"),
        ("stand", "resolution", "balance"),
        ("pendulum", "timer_jitter", "pendulum"),
        ("pendulum", "timer_resolution", "pendulum"),
        ("pendulum", "amplitude_decay", "pendulum"),
    ],
    "ball-wall": [
        ("gates", "edge_jitter", "gates"),
        ("gates", "tick", "gates"),
        ("cannon", "speed_scatter", "gates"),
    ],
    "astm-pivot": [
        ("gates", "edge_jitter", "gates"),
        ("gates", "tick", "gates"),
        *(("cannon", f"{name}_scatter", "encoder") for name in ("speed", "along", "across")),
        ("cannon", "mark_resolution", "aim"),
        ("pivot", "constant_torque", "encoder"),
        ("pivot", "viscous_torque", "encoder"),
        ("pivot", "air_torque", "encoder"),
        ("pivot", "friction", "encoder"),
        ("pivot", "clearance", "encoder"),
    ],
    "ball-cannon": [
        *(("gates", name, "gates") for name in ("edge_jitter", "tick", "sabot_rate")),
        *(("cannon", f"{name}_scatter", "gates") for name in ("speed", "along", "across", "slope")),
        ("cannon", "mark_resolution", "aim"),
    ],
    "ncaa-swing": [
        *(("gates", name, "gates") for name in ("edge_jitter", "tick", "sabot_rate")),
        *(("cannon", f"{name}_scatter", "gates") for name in ("speed", "along", "across", "slope")),
        *(("drive", name, "swing") for name in ("speed_scatter", "ripple", "droop")),
        ("drive", "timing_scatter", "gates"),
    ],
}
OWN_SHEET = {"drive"}  # part of a station that is a sheet itself
SUMS = {  # recorders round, and the bearing rubs, before readings are summed
    "ball-wall": [("gates", "edge_jitter", "gates"), ("gates", "tick", "gates")],
    "astm-pivot": [("gates", "edge_jitter", "gates"), ("pivot", "friction", "encoder")],
    "ball-cannon": [("gates", "edge_jitter", "gates"), ("gates", "trip_spread", "gates")],
}
EACH_SCATTER = [(rig, RecordDetail.FULL, *what) for rig, all_ in SCATTERS.items() for what in all_]
EACH_SCATTER += [(rig, RecordDetail.SUMMED, *what) for rig, all_ in SUMS.items() for what in all_]


def variances(record: Record) -> dict[str, Array]:
    """Return the variance of each column over its first axis, or over all if its length is 1."""
    found = {}
    for name in record.columns:
        values = np.ma.masked_invalid(np.asarray(getattr(record, name), dtype=float))
        found[name] = np.ma.filled(values.var(axis=0 if len(values) > 1 else None), 0.0)
    return found


@pytest.mark.parametrize(("rig", "detail", "part", "number", "channel"), EACH_SCATTER)
def test_every_declared_scatter_scatters(
    rig: str, detail: RecordDetail, part: str, number: str, channel: str
) -> None:
    """Setting a scatter to zero, with equal draws, changes the variance of its quantity.

    At least one laboratory of eight shows it: the resolution of the rule hides most of its noise.
    """
    assert any(
        scatters(Streams(seed), rig, detail, part, number, channel) for seed in range(11, 19)
    )


def scatters(
    draws: Streams, rig: str, detail: RecordDetail, part: str, number: str, channel: str
) -> bool:
    """Return whether the variance of a record changes without one number of a sheet."""
    station, struck = installed_rigs()[rig].commission(draws), specimen()
    asked = plan(rig, detail, 4 * SHOTS)
    if number == "sabot_rate":  # fault of one shot in a hundred
        station = with_part_sheet(station, part, sabot_rate=0.5)
    if part in OWN_SHEET:
        still = replace(station, **{part: replace(getattr(station, part), **{number: 0.0})})
    else:
        still = with_part_sheet(station, part, **{number: 0.0})
    loud, calm = (each.play(asked, struck, draws).records[channel] for each in (station, still))
    before, after = variances(loud), variances(calm)
    return any(not np.array_equal(before[key], after[key]) for key in before)


@pytest.mark.parametrize("detail", RecordDetail)
def test_the_encoder_turns_about_the_true_axis(detail: RecordDetail) -> None:
    """A rigid bat on an axis 8 mm from its nominal position: ω = J lever / I about that axis.

    If the encoder shows the ring, the oracle adds the slope of each mode there: a sum of decaying
    sines that start with the modal state after the collision.
    """
    struck, asked = specimen(draws=Quiet()), plan("astm-pivot", detail, 2)
    station = installed_rigs()["astm-pivot"].commission(Quiet(), ideal=True)
    station = altered(station, "pivot", from_knob=0.160)
    play = station.play(asked, struck, Quiet())
    body, truth = struck.bat.body, play.truth
    axis, beam = body.length - 0.160, beam_of(body)
    impulse = struck.balls.mass[:2] * truth["speed"] * (1 + truth["collision_efficiency"])
    rate = impulse * (axis - truth["place"]) / beam.inertia(axis)
    spec, clock = station.encoder.spec, station.gates.clock
    per_angle = station.encoder.scale * spec.counts_per_turn / (2 * pi)
    record = play.records["encoder"]
    if detail is RecordDetail.SUMMED:
        assert record.rate * clock / per_angle == pytest.approx(rate, rel=1e-9)
        return
    shown = np.diff(record.counts[:, -2:])[:, 0] * spec.sample_rate * clock / per_angle
    assert shown == pytest.approx(rate, rel=1e-9)
    ringing = with_part_sheet(station, "encoder", sees_ring=True).play(asked, struck, Quiet())
    contact = station.gates.distances[0] + struck.balls.spec.radius
    since = spec.sample_times() / clock - contact / truth["speed"][0] - truth["contact_time"][0]
    since = since[since > 1e-4]
    model = ModalModel.of(body, Pinned(axis))
    collisions = model.collide(
        scenes_of(struck, asked.ball, truth["place"], truth["speed"], truth["ball_restitution"])
    )
    bends = slice(model.modes.rigid, None)
    slope, omega = model.modes.rotation(axis)[bends], model.modes.angular_frequencies[bends]
    q, v = collisions.modal_displacements[0, bends], collisions.modal_velocities[0, bends]
    decay, turn = body.damping_ratio * omega, omega * np.sqrt(1 - body.damping_ratio**2)
    time = since[:, None]
    waves = q * np.cos(turn * time) + (v + decay * q) / turn * np.sin(turn * time)
    ring = (slope * np.exp(-decay * time) * waves).sum(axis=1)
    seen = (ringing.records["encoder"].counts - record.counts)[0, -since.size :] / per_angle
    assert np.abs(seen - ring).max() < 1e-3 * np.abs(ring).max()


@pytest.mark.parametrize("off", [-0.05, 0.0, 0.05])
def test_a_journal_rubs_by_the_reaction_of_the_blow(off: float) -> None:
    """Struck `off` [m] from the center of percussion, the pivot bears |1 - b m d/I| of the blow J.

    The rate falls by μ R J |1 - b m d/I|/I, with J = m v (1 + e_A) and R of the sheet.
    """
    station = with_part_sheet(
        installed_rigs()["astm-pivot"].commission(Quiet()), "pivot", friction=0.0
    )
    struck, asked = specimen(), plan("astm-pivot", RecordDetail.SUMMED, 1)
    beam = beam_of(struck.bat.body)
    axis = beam.length - station.holder.from_knob
    arm, inertia = axis - beam.z_cm, beam.inertia(axis)
    lever = inertia / (beam.mass * arm) - off
    asked = replace(asked, place=np.array([axis - lever - station.cannon.true["along"]]))
    rubbed = with_part_sheet(station, "pivot", friction=0.04)
    (free, truth), (slow, _) = (
        (play.records["encoder"].rate, play.truth)
        for play in (each.play(asked, struck, Quiet()) for each in (station, rubbed))
    )
    blow = struck.balls.mass[0] * truth["speed"] * (1 + truth["collision_efficiency"])
    borne = np.abs(1 - lever * beam.mass * arm / inertia)
    lost = 0.04 * station.holder.spec.journal_radius * borne * blow / inertia
    rate = blow * lever / inertia
    assert 1 - slow / free == pytest.approx(lost / rate, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("place", [3.0, 10.0])
def test_a_loose_bat_turns_as_a_free_one_until_its_journal_bears(place: float) -> None:
    """By hand: a free rigid bat is hit, stops at the axis after 0.2 mm, then turns about it."""
    laboratory = opened("r161", procedure="astm-f1881", seed=0, reality=Reality.NOISE_FREE)
    fixed = laboratory.stations[Stage.IMPACT]
    one = np.zeros(1, dtype=int)
    speed = laboratory.rules.spec.ball_speed
    plan = ShotPlan(slot=one, ball=one, speed=np.array([speed]), place=np.array([place * INCH]))
    fine = with_sheet(fixed, "pivot", friction=0.0, clearance=0.0)
    fine = with_sheet(fine, "encoder", whole_counts=False)
    counts, truth = [], {}
    for clearance in (0.0, 0.2e-3):
        play = with_sheet(fine, "pivot", clearance=clearance).play(
            plan, laboratory.specimen, laboratory.draws
        )
        counts.append(play.records["encoder"].counts[0])
        truth = play.truth
    beam = beam_of(laboratory.specimen.bat.body)
    axis = beam.length - 6 * INCH
    d, z = axis - beam.z_cm, place * INCH
    ball = laboratory.specimen.balls.mass[0]
    blow = ball * speed * (1 + truth["collision_efficiency"][0])
    free = blow * (beam.z_cm - z) / beam.inertia_cm
    slips = blow / beam.mass - free * d  # force at the journal, along the ball's flight
    pinned = blow * (axis - z) / beam.inertia(axis)
    by_hand = (free - pinned) * 0.2e-3 / abs(slips)
    turned = (counts[1] - counts[0]) * 2 * np.pi / 10_000
    assert turned[-1] == pytest.approx(by_hand, rel=1e-3)
    late = turned[len(turned) // 2 :]
    assert np.ptp(late) < 1e-12


def test_the_thresholds_of_beams_scatter_edges() -> None:
    """The spread of thresholds on the sheet is drawn when the boards are commissioned."""
    spread = {}
    for rig in ("ball-cannon", "ncaa-swing"):
        boards = installed_rigs()[rig].commission(Streams(11)).gates
        spread[rig] = boards.trip_depths.std() / boards.spec.trip_spread
    assert spread == pytest.approx(dict.fromkeys(spread, 1.0), abs=4.5 / np.sqrt(2 * 102))


@pytest.mark.parametrize("detail", RecordDetail)
@pytest.mark.parametrize("rig", [rig for rig in CHEAP if rig != "bench"])
@pytest.mark.parametrize("scatter", ["mass", "restitution", "hit_restitution"])
def test_every_scatter_of_a_ball_scatters(rig: str, detail: RecordDetail, scatter: str) -> None:
    """Equal masses, equal e0 or equal hits in a lot change the variance of the ball records."""
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    alike = replace(ball, spread=replace(ball.spread, **{scatter: 0.0}))
    draws, station = Streams(11), installed_rigs()[rig].commission(Streams(11))
    asked = plan(rig, detail)
    before, after = (station.play(asked, specimen(each), draws).records for each in (ball, alike))
    channel = watching(before)
    told = [variances(records[channel]) for records in (before, after)]
    assert any(not np.array_equal(told[0][name], told[1][name]) for name in told[0])


# -- what is known ---------------------------------------------------------------------------


def few(session: Session, shots: int) -> Session:
    """Return a session with only the first shots at the bat, where more constants matter.

    All shots are 2 mm above the bat's axis, by the bat's known height or by the marks, and
    1 % faster than balls at the wall, by the position of the first gate.
    """
    impact: dict[str, Record] = {}
    for channel, record in session.records["impact"].items():
        short = {
            name: getattr(record, name)[:shots]
            for name, column in record.columns.items()
            if column.axes[0] == "shot" and channel != "aim"
        }
        impact[channel] = replace(record, **short)
    impact["aim"] = replace(impact["aim"], across=impact["aim"].across + 2e-3)
    session = replace(session, records={**session.records, "impact": impact})
    known = session.calibration
    session = with_constant(
        session, "impact.gates.distance_0", known["impact.gates.distance_0"].value + 3e-3
    )
    if "impact.pivot.height" not in known:
        return session
    height = known["impact.pivot.height"].value - 2e-3
    return with_constant(session, "impact.pivot.height", height)


def with_constant(session: Session, name: str, value: float) -> Session:
    known = session.calibration[name]
    return replace(session, calibration={**session.calibration, name: replace(known, value=value)})


def slopes(x: Array, y: Array) -> tuple[Array, Array]:
    """Return least-squares slope and intercept of y over x, one line per row."""
    lines = [np.polyfit(*row, 1) for row in zip(*np.broadcast_arrays(x, y), strict=True)]
    slope, intercept = np.array(lines).T
    return slope, intercept


Reduced = tuple[Reduction, ImpactReadings]


def by_hand(session: Session, found: Reduced) -> dict[str, Array]:  # noqa: PLR0915 one page
    """Return the results of the records of an airless laboratory by the paper's equations.

    Signals (passages and rates in counts) are those of the reduction.
    """
    x = {name: known.value for name, known in session.calibration.items()}
    bench, (reduced, readings) = session.records["bench"], found
    rules = reduced.procedure

    def mean(channel: str) -> float:
        return float(bench[channel].readings.mean())

    # bench
    mass = (mean("bat-mass") - x["bench.scale.zero"]) / x["bench.scale.span"]
    length = mean("length") - x["bench.rule.offset"]
    radius = mean("barrel-radius") - x["bench.rule.offset"]
    balance = mean("balance") - x["bench.stand.offset"]
    swung = bench["pendulum"]
    count = swung.times.shape[1] - 1
    first = swung.first_amplitude.mean() - x["bench.pendulum.amplitude_offset"]
    last = swung.last_amplitude.mean() - x["bench.pendulum.amplitude_offset"]
    middles = first * (last / first) ** ((np.arange(count) + 0.5) / count)
    longer = np.mean(2 / pi * ellipk(np.sin(middles / 2) ** 2))
    total = np.mean(swung.times[:, -1] - swung.times[:, 0]) / x["bench.pendulum.clock"]
    lever = length - x["bench.pendulum.pivot_from_knob"] - balance
    moment = mass * lever + x["bench.pendulum.clamp_moment"]
    both = (total / count / longer / 2 / pi) ** 2 * x["hall.gravity"] * moment
    inertia = both - x["bench.pendulum.clamp_inertia"] - mass * lever**2
    # section: balls at the wall
    log = session.records["balls"]["log"]
    seen = reduced.preparation.balls.select((0, 0)).flights.passages
    ball_mass = bench["ball-mass"].readings.mean(axis=1) - x["bench.scale.zero"]
    ball_mass = ball_mass / x["bench.scale.span"]
    v_in, v_out, *_ = flown(x, "balls", seen)
    ratio, ball = v_out / v_in, log.ball.astype(int)
    nominal = log.nominal_speed.mean()
    slope = x["ball.restitution_slope"]
    if np.ptp(log.nominal_speed):
        slope = np.polyfit(log.nominal_speed, ratio, 1)[0]  # rise over nominal speed
        slope /= np.polyfit(log.nominal_speed, v_in, 1)[0]  # rise of the measured speed
    hits = ratio - slope * (v_in - nominal)
    e0 = np.array([hits[ball == each].mean() for each in range(len(ball_mass))])
    # shots at the bat
    shot = session.records["impact"]["log"]
    place = shot.place + x["impact.cannon.along"]
    v_in, v_out, offset = flown(x, "impact", readings.flights.passages)
    axis = length - x["impact.pivot.from_knob"]
    turn, slant = np.zeros(len(place)), np.zeros(len(place))
    for encoder, fit in (("encoder", readings.recoil), ("swing", readings.swing)):
        if fit is not None:
            count_angle = 2 * pi / x[f"impact.{encoder}.counts_per_turn"]
            count_angle /= x[f"impact.{encoder}.scale"]
            turn = count_angle * fit.rate * x["impact.gates.clock"]
            slant = count_angle * fit.angle if encoder == "swing" else slant
    arm = (axis - place) / np.cos(slant)
    struck_mass = ball_mass[shot.ball.astype(int)]
    bat_speed = arm * turn if readings.swing else np.zeros(len(place))
    closing = v_in * np.cos(slant) + bat_speed
    if "impact.pivot.height" in x:
        square = ((offset - x["impact.pivot.height"]) / (radius + x["ball.radius"])) ** 2
    else:
        marks = session.records["impact"]["aim"]
        square = np.mean(marks.across**2) / (radius + x["ball.radius"]) ** 2
    if rules.reads == "recoil":
        about = inertia + mass * (axis - balance) ** 2
        seen_efficiency = about * turn / (struck_mass * arm * v_in) - 1
    else:
        thrown = (v_out + v_in * np.sin(slant) ** 2) / np.cos(slant)
        seen_efficiency = (thrown - bat_speed) / closing
    efficiency = (seen_efficiency + square) / (1 - square)
    held = length - rules.pivot_from_knob
    if rules.recoil == "free":
        recoil = struck_mass * (1 / mass + (place - balance) ** 2 / inertia)
    else:
        recoil = struck_mass * (held - place) ** 2 / (inertia + mass * (held - balance) ** 2)
    restitution = efficiency * (1 + recoil) + recoil
    own = e0[shot.ball.astype(int)] + slope * (closing - nominal)
    rate = rules.bat_speed / (held - 6 * INCH) if rules.bat_speed else 0.0
    lot = e0.mean() + slope * (rules.ball_speed + rate * (held - place) - nominal)
    return {
        "speed": v_in,
        "bat_speed": bat_speed,
        "collision_efficiency": efficiency,
        "recoil_factor": recoil,
        "restitution": restitution,
        "ball_restitution": own,
        "bat_performance_factor": restitution / own,
        "lot_ball_restitution": lot,
        "mass": np.array(mass),
        "z_cm": np.array(balance),
        "inertia_cm": np.array(inertia),
    }


def flown(x: Mapping[str, float], stage: str, seen: Any) -> tuple[Array, Array, Array]:
    """Return the speeds before and after, and the height at the target, of balls without air."""
    gates = seen.times.shape[-1]
    far = np.array([x[f"{stage}.gates.distance_{gate}"] for gate in range(gates)])
    clock = x[f"{stage}.gates.clock"]
    speed_in, speed_out = (
        sign * clock * slopes(seen.times[:, direction], far)[0]
        for direction, sign in ((0, -1), (1, 1))
    )
    if f"{stage}.gates.height_0" not in x:
        return speed_in, speed_out, np.full(len(speed_in), np.nan)
    zeros = np.array([x[f"{stage}.gates.height_{gate}"] for gate in range(gates)])
    fallen = x["hall.gravity"] / 2 * (far / speed_in[:, None]) ** 2
    return speed_in, speed_out, slopes(far, seen.heights[:, 0] + zeros + fallen)[1]


EXACT = {"resolution", "over", "lowest", "pitch"}
# the slope is measured if the wall is hit at two speeds; a bat at rest has no known speed
IDLE = {
    "astm-f1881": set(),
    "bbcor": {"ball.restitution_slope", "impact.pivot.from_knob"},
    "ncaa-besr": {"ball.restitution_slope"},
}
MOVES = 3.0  # step in u of a real laboratory, or a thousandth if a sheet is exact


def moves_of(real: Session, ideal: Session) -> dict[str, float]:
    """Return the changed value of each constant."""
    return {
        name: known.value + (MOVES * real.calibration[name].u or 1e-3 * known.value)
        for name, known in ideal.calibration.items()
        if name.rpartition(".")[2] not in EXACT and "air." not in name
    }


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor", "ncaa-besr"])
def test_every_calibration_moves_the_result_as_its_correction_says(
    procedure: str, played: Play
) -> None:
    """Records of an ideal laboratory, with each constant changed, against the paper's equations."""
    ideal = few(played("r161", Reality.IDEAL, procedure=procedure).certification.session, 6)
    real = played("r161", procedure=procedure).certification.session
    start = reduce_session(ideal)
    best = by_hand(ideal, start)
    for name, value in moves_of(real, ideal).items():
        session = with_constant(ideal, name, value)
        found = reduce_session(session)
        expected = by_hand(session, found)
        moved_by = 0.0
        for key, hand in expected.items():
            bat = found[0].preparation.bat.select((0, 0, 0))
            own = getattr(bat if hand.ndim == 0 else found[0].shots, key)
            known = np.isfinite(own)
            assert own[known] == pytest.approx(hand[known], rel=1e-9, abs=1e-12), (name, key)
            moved_by = max(moved_by, float(np.nanmax(np.abs(hand - best[key]))))
        assert (moved_by > 1e-9) == (name not in IDLE[procedure]), name


def effect(session: Session, name: str, value: float) -> tuple[Reduced, Reduced]:
    return reduce_session(session), reduce_session(with_constant(session, name, value))


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor"])
@pytest.mark.parametrize("name", ["density", "drag_coefficient"])
def test_air_slows_a_ball_from_the_gates_to_the_bat(
    name: str, procedure: str, played: Play
) -> None:
    """The speed at the bat is that between the gates times 1 ∓ κ D, inbound and back, to κ² D²."""
    ideal = few(played("r161", Reality.IDEAL, procedure=procedure).certification.session, 6)
    other = "density" if name == "drag_coefficient" else "drag_coefficient"
    blown = with_constant(ideal, f"hall.air.{other}", {"density": 1.2}.get(other, 0.4))
    values = {"density": 1.2}.get(name, 0.4)
    (still, readings), (windy, _) = effect(blown, f"hall.air.{name}", values)
    if other == "density":  # drag coefficient of air above zero
        still, readings = reduce_session(ideal)
    x = {key: known.value for key, known in ideal.calibration.items()}
    area = pi * x["ball.radius"] ** 2
    kappa = 1.2 * 0.4 * area / 2 / windy.shots.ball_mass
    gates = readings.flights.passages.times.shape[-1]
    middle = np.mean([x[f"impact.gates.distance_{gate}"] for gate in range(gates)])
    within = 3 * float(np.max(kappa * 0.6)) ** 2
    assert windy.shots.speed / still.shots.speed == pytest.approx(1 - kappa * middle, abs=within)
    ratio = windy.shots.rebound_speed / still.shots.rebound_speed
    assert ratio == pytest.approx(1 + kappa * middle, abs=within)


def test_the_beams_of_a_board_are_where_its_sheet_says(played: Play) -> None:
    """Raised beams raise the ball; a wider spacing scales its height above the lowest beam."""
    ideal = few(played("r161", Reality.IDEAL, procedure="bbcor").certification.session, 6)
    lowest = ideal.calibration["impact.gates.lowest"].value
    (_, start), (_, raised) = effect(ideal, "impact.gates.lowest", lowest + 1e-3)
    shown = start.flights.passages.heights
    assert raised.flights.passages.heights == pytest.approx(shown + 1e-3, nan_ok=True)
    pitch = ideal.calibration["impact.gates.pitch"].value
    _, (_, spread) = effect(ideal, "impact.gates.pitch", 1.01 * pitch)
    wider = lowest + 1.01 * (shown - lowest)
    assert spread.flights.passages.heights == pytest.approx(wider, nan_ok=True)


@pytest.mark.parametrize(
    ("name", "factor", "field", "power"),
    [
        ("impact.gates.clock", 1.01, "speed", 1.0),
        ("impact.gates.clock", 1.01, "recoil_rate", 1.0),
        ("impact.gates.clock", 1.01, "recoil_efficiency", 0.0),
        ("impact.encoder.scale", 1.01, "recoil_rate", -1.0),
        ("impact.encoder.counts_per_turn", 1.01, "recoil_rate", -1.0),
        ("bench.scale.span", 1.01, "ball_mass", None),
    ],
)
def test_a_constant_one_percent_larger_has_the_effect_of_its_equation(
    name: str, factor: float, field: str, power: float | None, played: Play
) -> None:
    """A clock known to be fast makes balls faster, a coarser encoder bats slower, and so on."""
    ideal = few(played("r161", Reality.IDEAL).certification.session, 6)
    known = ideal.calibration[name].value
    (start, _), (found, _) = effect(ideal, name, factor * known)
    before, after = getattr(start.shots, field), getattr(found.shots, field)
    expected = before / factor if power is None else before * factor**power
    assert after == pytest.approx(expected, rel=1e-9)


def test_balls_that_strike_farther_along_have_a_shorter_lever(played: Play) -> None:
    """Aimed as measured, struck 1 mm farther along: (1 + e_A) lever and r stay the same."""
    reduced, readings = reduce_session(played("r161", Reality.IDEAL).certification.session)
    x = {name: known.value[0] for name, known in reduced.constants.items()}
    name = "impact.cannon.along"
    bat = reduced.preparation.bat.select((0, 0, 0))
    shifted, model = {**x, name: x[name] + 1e-3}, reduced.single_model(readings)
    balls, settings = measured_balls(shifted, model.balls), reduced.procedure.reduction_settings
    beside = shot_results(ShotResults, shifted, bat, balls, readings, settings, used=model.used)
    lever = bat.length - x["impact.pivot.from_knob"] - reduced.shots.position
    expected = (1 + reduced.shots.collision_efficiency) * lever / (lever - 1e-3) - 1
    expected -= 0.003 / 0.0254 * 1e-3  # slope of e_A along the barrel on the sheet
    assert beside.collision_efficiency == pytest.approx(expected, rel=1e-9)
    assert beside.position == pytest.approx(reduced.shots.position)
    assert beside.recoil_factor == pytest.approx(reduced.shots.recoil_factor, rel=1e-12)


def test_a_drive_that_droops_slows_by_its_share_a_second() -> None:
    """A shaft without ripple has the rate (1 + d t) at t s before contact."""
    station: Any = installed_rigs()["ncaa-swing"].commission(Quiet())
    station = replace(station, drive=replace(station.drive, ripple=0.0, droop=-0.5))
    station = with_part_sheet(station, "swing", whole_counts=False)
    play = station.play(plan("ncaa-swing", RecordDetail.FULL, 1), specimen(), Quiet())
    counts, spec = play.records["swing"].counts[0], station.encoder.spec
    rates = np.diff(counts) * spec.sample_rate / spec.counts_per_turn * 2 * pi
    moving = np.flatnonzero(rates > 1.0)[:-1]  # the last step holds the contact
    slowing = np.polyfit(moving / spec.sample_rate, rates[moving], 1)[0]
    assert slowing == pytest.approx(-0.5 * 40.0, rel=1e-3)


@pytest.mark.parametrize("late", [-3.0, 3.0])
def test_the_slant_of_a_swung_bat_is_corrected(late: float) -> None:
    """An otherwise ideal machine is 0.9 ms early or late: 2.5° at 47 rad/s.

    The ball meets the bat farther out by lever (1/cos - 1), 0.6 mm, and nearer to the boards or
    farther from them by 2 cm. Ignoring the slant would shift e_A by 1e-3 and the place by 0.6 mm.
    """

    class Late(Quiet):
        def normal(self, name: str, *rest: Any, **slots: Any) -> Array:
            drawn = Quiet.normal(self, name, *rest, **slots)
            if name == "ncaa-swing.drive":
                drawn[:, 1] = late
            return drawn

    day = prepare_day(opened("r161", procedure="ncaa-besr", reality=Reality.IDEAL, seed=1))
    laboratory = day.laboratory
    station: Any = laboratory.stations[Stage.IMPACT]
    station = replace(station, drive=replace(station.drive, timing_scatter=0.3e-3))
    along = station.cannon.stated["along"].value
    asked = replace(
        plan("ncaa-swing", RecordDetail.FULL, 4),
        speed=np.full(4, 70 * MPH),
        place=np.array([4.0, 5.0, 6.0, 7.0]) * INCH - along,
        turn_rate=47.0,
    )
    play = station.play(asked, laboratory.specimen, Late())
    slant = play.truth["angle"]
    assert slant == pytest.approx(late * 0.3e-3 * 47.0)
    shots = reduce_session(with_records(day.session, Stage.IMPACT, [play]))[0].shots
    assert shots.position == pytest.approx(play.truth["place"], abs=1e-6)
    assert shots.bat_speed == pytest.approx(play.truth["bat_speed"], rel=1e-6)
    assert shots.collision_efficiency == pytest.approx(play.truth["collision_efficiency"], abs=1e-6)
    # result if the bat is assumed to be square
    lever = play.truth["bat_speed"] / 47.0
    assert (lever * (1 - np.cos(slant)) > 3e-4).all()


# -- what is printed -------------------------------------------------------------------------

PRINTED_BAT = {
    "mass_kg": "mass",
    "length_m": "length",
    "z_cm_m": "z_cm",
    "inertia_cm_kg_m2": "inertia_cm",
}


@pytest.mark.parametrize(
    "procedure", [PROCEDURE, "bbcor", pytest.param("proposed", marks=pytest.mark.long)]
)
def test_every_uncertainty_printed_is_its_budgets(procedure: str, played: Play) -> None:
    """For metric, quantities and bat properties, u is the root of the sum of (sensitivity u)²."""
    found = played("r161", procedure=procedure).certification
    document = certificate(found).as_json()
    assert found.metric is not None
    budgets = {"metric": found.metric} | {
        name: budget for name, budget in found.quantities.items() if name in document
    }
    printed = {name: document[name]["u"] for name in budgets}
    for key, name in PRINTED_BAT.items():
        budgets[key], printed[key] = found.bat[name], document["bat"][key]["u"]
    assert len(printed) >= 9
    for name, budget in budgets.items():
        own = hypot(*(part.sensitivity * part.u for part in budget.components))
        assert printed[name] == pytest.approx(own, rel=1e-9), name
    rows = document["budget"]
    assert document["metric"]["u"] == pytest.approx(hypot(*(r["contribution"] for r in rows)))


def test_components_rest_on_what_the_certificates_state(played: Play) -> None:
    """The u of every calibration in a budget equals that of the session, to the last bit."""
    found = played("r161").certification
    known = found.session.calibration
    for budget in [found.metric, *found.quantities.values(), *found.bat.values()]:
        for part in budget.components:
            if part.name in known and part.name != "hall.air.density":  # values of the day
                assert (part.u, part.dof) == (known[part.name].u, known[part.name].dof)
