"""Instruments that compute their own sums scatter as the full record and its reduction do.

Rigs and laboratories are drawn from fixed seeds. The root mean square errors against the truth
agree to 15 %, the means to four standard errors, unless stated otherwise.
"""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.measurement.reduction.gates import Passages, flights, passages
from virtual_lab.measurement.reduction.recoil import fit_recoil
from virtual_lab.measurement.reduction.swing import fit_swing
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.faults.fault import with_sheet
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.board_kernel import fill_gains, gain_memory
from virtual_lab.simulation.instruments.light_board import LightBoards, LightBoardSpec
from virtual_lab.simulation.instruments.light_gate import LightGates, LightGateSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.physics.truth import draw_balls, make_bat
from virtual_lab.simulation.stations.impact import contact_angle
from virtual_lab.simulation.stations.rig import ShotPlan, Specimen, Stage, find_rig
from virtual_lab.streams import Streams

RADIUS, GRAVITY, DRAG = 0.0366, 9.80665, 0.007
LABS, SHOTS = 80, 20
WITHIN = 0.15


def balls(speed_in: float, speed_out: float, draws: Streams, rise: float) -> Passage:
    """Return flights of a laboratory, with heights over a whole pitch and random slopes."""
    return Passage(
        speed_in=np.full(SHOTS, speed_in),
        speed_out=np.full(SHOTS, speed_out),
        drag=np.full(SHOTS, DRAG),
        radius=RADIUS,
        gravity=GRAVITY,
        height=8e-3 * draws.uniform("height", SHOTS),
        slope_in=2e-3 * draws.normal("slope", SHOTS),
        slope_out=rise + 0.03 * draws.normal("rise", SHOTS),
    )


def errors(
    name: str, speed_in: float, speed_out: float, rise: float, detail: RecordDetail, **changes
):
    """Return the errors of two speeds, offset and slope, (quantity, shot), at known distances."""
    spec = catalog.load("instruments", name, LightBoardSpec).spec
    spec = replace(spec, distance_u=0.0, height_u=0.0, clock_u=0.0, sabot_rate=0.0, **changes)
    constants = {"hall.gravity": np.array(GRAVITY)}
    for key, stated in spec.certificate().items():
        constants[f"impact.gates.{key}"] = np.array(stated.value)
    rows = []
    for seed in range(LABS):
        draws = Streams(seed)
        boards = LightBoards.commission(spec, draws, "b")
        passage = balls(speed_in, speed_out, draws, rise)
        contact = boards.arrival(passage)
        record = boards.watch(
            passage, contact, contact + 7e-4, draws, "b", np.arange(contact.size), detail
        )
        board_passages = passages(record, lowest=spec.lowest, pitch=spec.pitch)
        flight = flights(constants, "impact", board_passages, passage.drag)
        rows.append(
            [
                flight.speed_in / speed_in - 1,
                flight.speed_out / speed_out - 1,
                flight.offset - passage.height,
                flight.slope_out - passage.slope_out,
            ]
        )
    return np.concatenate(rows, axis=1)


@pytest.mark.parametrize(
    ("name", "speed_in", "speed_out", "rise"),
    [
        ("light-boards", 60.8, 14.0, 0.05),
        ("light-boards", 60.8, 6.0, 0.05),
        ("light-boards", 60.8, 3.5, 0.10),  # fall of 0.1 m at the far board, at 20°
        ("light-boards", 71.5, 12.0, -0.05),
        ("swing-boards", 31.3, 45.0, 0.0),
        ("swing-boards", 31.3, 8.0, 0.0),  # balls half below the far curtain
    ],
)
def test_summed_boards_scatter_as_their_edges_do(
    name: str, speed_in: float, speed_out: float, rise: float
) -> None:
    """Two speeds, offset and slope of 80 laboratories with random thresholds, 20 shots each."""
    full, summed = (
        errors(name, speed_in, speed_out, rise, detail)
        for detail in (RecordDetail.FULL, RecordDetail.SUMMED)
    )
    for quantity, each, sums in zip(("in", "out", "offset", "slope"), full, summed, strict=True):
        assert np.array_equal(np.isfinite(each), np.isfinite(sums)), quantity
        # 68 % quantile: a few shots at the rim of a curtain have tails that no such model has
        usual = [float(np.nanquantile(np.abs(deviation), 0.68)) for deviation in (each, sums)]
        assert usual[1] == pytest.approx(usual[0], rel=WITHIN), quantity
        # number of independent thresholds: 80, one set per laboratory
        apart = np.nanmedian(sums) - np.nanmedian(each)
        assert abs(apart) < 4 * 1.25 * sqrt(2) * usual[0] / sqrt(LABS), quantity


def test_boards_without_threshold_spread_scatter_as_their_edges_do() -> None:
    """Without a spread of the thresholds, the noise is the clock's jitter."""
    full, summed = (
        errors("light-boards", 60.8, 12.0, 0.05, detail, trip_spread=0.0)
        for detail in (RecordDetail.FULL, RecordDetail.SUMMED)
    )
    ratio = np.sqrt((summed**2).mean(axis=1) / (full**2).mean(axis=1))
    assert np.abs(ratio - 1).max() < WITHIN


def gains(centre: np.ndarray, beams: int, radius: float | np.ndarray) -> np.ndarray:
    """Return the gains of passage, slope and threshold for centers in pitches, (3, ...)."""
    result = np.empty((3, centre.size))
    radii = np.broadcast_to(radius, centre.shape).ravel().copy()
    fill_gains(centre.ravel(), beams, radii, gain_memory(radii.max()), result)
    return result.reshape(3, *centre.shape)


def test_the_gains_of_many_beams_are_the_closed_forms() -> None:
    """Closed forms for many beams, n = 2R/pitch, with a height from the thresholds alone.

    The passage is the mean of n midpoints: 1/√(2n). Thresholds change the squares of all chords
    equally; the oracle of a weighted line through them is a numerical integral.
    """
    radius = 150.0
    edge, _, trip = gains(np.array([1000.3]), 2001, radius)[:, 0]
    assert edge == pytest.approx(1 / sqrt(4 * radius), rel=2e-3)
    u = np.linspace(-1, 1, 400_001)[1:-1]
    weight = 1 / np.maximum(1 - u**2, 1e-2)
    step, lean = u[1] - u[0], weight * u
    by_hand = np.sqrt((lean**2).sum() * step) / ((lean * u).sum() * step) / sqrt(radius)
    assert trip == pytest.approx(by_hand, rel=0.02)


def test_too_few_beams_give_no_gain() -> None:
    """Beams at 0 to 9 and a ball of radius 2.2: four beams are broken from a center of 1 on."""
    centre = np.array([[0.5, 1.0, 5.0, 8.0, 8.5], [np.nan, -30.0, 40.0, 4.5, 5.2]])
    visible = [[False, True, True, True, False], [False, False, False, True, True]]
    for gain in gains(centre, 10, 2.2):
        assert np.isfinite(gain).tolist() == visible


def test_summed_gates_scatter_as_their_edges_do() -> None:
    """Two edges per gate: times of 20 000 shots scatter alike, to four standard errors, 2.8 %."""
    n = 20_000
    spec = catalog.load("instruments", "pivot-gates", LightGateSpec).spec
    gates = LightGates.commission(replace(spec, distance_u=0.0, clock_u=0.0), Streams(1), "g")
    passage = Passage(
        speed_in=np.full(n, 26.8),
        speed_out=np.full(n, 7.0),
        drag=np.zeros(n),
        radius=RADIUS,
        gravity=0.0,
    )
    contact = gates.arrival(passage)
    scatter = []
    for detail in RecordDetail:
        record = gates.watch(
            passage, contact, contact, Streams(2), "g", np.arange(contact.size), detail
        )
        gate_passages = passages(record)
        scatter.append(
            [
                inward(gate_passages).std(),
                (gate_passages.times[:, 1, 0] - gate_passages.times[:, 1, -1]).std(),
            ]
        )
    assert scatter[1] == pytest.approx(scatter[0], rel=4 * sqrt(2) / sqrt(2 * n))


def inward(gate_passages: Passages) -> np.ndarray:
    """Return the time from the first gate to the last [s], (shot,)."""
    return gate_passages.times[:, 0, -1] - gate_passages.times[:, 0, 0]


class _Modal:
    def __call__(self, body, support):
        return ModalModel.of(body, support)

    def efficiencies(self, struck, support, scenes: Scenes):
        ((body, _),) = struck
        return self(body, support).collide(scenes).collision_efficiency


def specimen(bat: str, draws: Streams) -> Specimen:
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    return Specimen(
        bat=make_bat(catalog.load_bat(bat).spec, draws),
        balls=draw_balls(ball, 12, draws),
        collision=_Modal(),
    )


def plan(
    shots: int, speed: float, place: float, detail: RecordDetail, turn_rate: float = 0.0
) -> ShotPlan:
    return ShotPlan(
        slot=np.arange(shots),
        ball=np.arange(shots) % 12,
        speed=np.full(shots, speed),
        place=np.full(shots, place),
        turn_rate=turn_rate,
        detail=detail,
    )


@pytest.mark.parametrize(("bat", "place"), [("r161", 0.16), ("ea70", 0.10)])
def test_a_summed_recoil_scatters_as_its_counts_do(bat: str, place: float) -> None:
    """Errors of the recoil rate against momentum conservation, 3 laboratories of 150 shots."""
    errors: dict[RecordDetail, list[np.ndarray]] = {detail: [] for detail in RecordDetail}
    for seed in (3, 4, 5):
        draws = Streams(seed)
        struck = specimen(bat, draws)
        station = find_rig("astm-pivot", Stage.IMPACT).commission(draws)
        station = with_sheet(station, "pivot", friction=0.0)
        beam = beam_of(struck.bat.body)
        axis = beam.length - station.holder.from_knob
        for detail in RecordDetail:
            request = plan(150, 26.8, place, detail)
            play = station.play(request, struck, draws)
            truth, record = play.truth, play.records["encoder"]
            tilt = contact_angle(struck, truth["place"], truth["across"])
            normal = truth["speed"] * np.cos(tilt) * (1 + truth["collision_efficiency"])
            impulse = struck.balls.mass[request.ball] * normal * np.cos(tilt)
            true = impulse * (axis - truth["place"]) / beam.inertia(axis)
            if detail is RecordDetail.FULL:
                gate_passages = passages(play.records["gates"])
                far, near = station.gates.distances[[0, -1]]
                contact = gate_passages.times[:, 0, -1] + near * inward(gate_passages) / (
                    far - near
                )
                record = fit_recoil(record, contact)
            turn = station.encoder.scale * station.encoder.spec.counts_per_turn / 2 / np.pi
            deviation = record.rate / turn * station.gates.clock - true
            errors[detail].append(deviation)
    full, summed = (
        np.concatenate(errors[detail]) for detail in (RecordDetail.FULL, RecordDetail.SUMMED)
    )
    ratio = summed.std() / full.std()
    assert abs(ratio - 1) < WITHIN
    assert abs(summed.mean() - full.mean()) < 5 * full.std() * sqrt(2 / full.size)


def test_a_summed_swing_scatters_as_its_counts_do() -> None:
    """Rates of 36 to 50 rad/s of 30 bats; rounding is white over many bats, not for each."""
    errors: dict[RecordDetail, list[np.ndarray]] = {detail: [] for detail in RecordDetail}
    angles: list[np.ndarray] = []
    for seed, turn_rate in enumerate(np.linspace(36, 50, 30)):
        draws = Streams(seed)
        swung = specimen("r161", draws)
        station = find_rig("ncaa-swing", Stage.IMPACT).commission(draws)
        boards = replace(station.gates, spec=replace(station.gates.spec, sabot_rate=0.0))
        station = replace(station, gates=boards)
        axis = swung.bat.body.length - station.holder.from_knob
        for detail in RecordDetail:
            play = station.play(plan(40, 31.3, 0.15, detail, float(turn_rate)), swung, draws)
            truth, record = play.truth, play.records["swing"]
            turn = station.encoder.scale * station.encoder.spec.counts_per_turn / 2 / np.pi
            if detail is RecordDetail.FULL:
                spec = boards.spec
                board_passages = passages(
                    play.records["gates"], lowest=spec.lowest, pitch=spec.pitch
                )
                far, near = boards.distances[[0, -1]]
                speed = (far - near) / inward(board_passages)
                limit = (axis - 0.15) / speed / turn
                record = fit_swing(record, board_passages.times[:, 0, -1] + near / speed, limit)
                angles.append(record.angle / turn - truth["angle"])
            true = truth["bat_speed"] / (axis - truth["place"])
            errors[detail].append(record.rate / turn * station.gates.clock / true - 1)
    full, summed = (
        np.concatenate(errors[detail]) for detail in (RecordDetail.FULL, RecordDetail.SUMMED)
    )
    # ratio in four samples: 0.83 to 0.88; 1 % of the fits are poor, with few counts before contact
    assert 0.8 < summed.std() / full.std() < 1.1
    assert abs(summed.mean() - full.mean()) < 5 * full.std() * sqrt(2 / full.size) + 3e-5
    # error of a line through boards 0.4 m away: 40 µs early without drag, 1.7 mrad of the angle
    assert np.abs(np.concatenate(angles)).max() < 2.5e-3


@pytest.mark.parametrize("missing", [0, 3, 7])
def test_the_gain_of_a_ball_at_the_end_of_a_board_agrees_with_a_fitted_line(missing: int) -> None:
    """The oracle is the intercept of numpy.polyfit at the ball's center, through the beams left.

    The midpoint of a beam has two edges. Beams on one side give the passage with a larger
    uncertainty than the same number about the center.
    """
    radius, phase = 7.3, 0.0
    beams = np.arange(-7, 8)[missing:] - phase
    _, covariance = np.polyfit(beams, np.sin(beams), 1, cov="unscaled")
    passage = gains(np.array([7.0 - missing]), 40, radius)[0, 0]
    assert passage == pytest.approx(sqrt(covariance[1, 1] / 2), rel=1e-9)


@pytest.mark.parametrize("missing", [0, 3, 7])
def test_the_gains_of_the_height_agree_with_a_weighted_parabola(missing: int) -> None:
    """The oracle is numpy.polyfit through the squares of the chords: slope at the ball's center.

    An error of half a chord changes its square by 2 √square of it; a chord has two edges.
    """
    radius, phase = 7.3, 0.25
    place = (np.arange(-7, 8)[missing:] - phase) / radius
    square = 1 - place**2
    weight = np.sqrt(1 / np.maximum(square, 1e-2))
    slopes = np.array([np.polyfit(place, one, 2, w=weight)[1] for one in np.eye(place.size)])
    path_gain, trip = gains(np.array([7.25 - missing]), 40, radius)[1:, 0]
    assert path_gain == pytest.approx(sqrt((slopes**2 * square).sum() / 2), rel=1e-9)
    assert trip == pytest.approx(sqrt((slopes**2).sum()), rel=1e-9)


def test_the_gains_of_a_ball_do_not_depend_on_other_balls() -> None:
    """Balls of two radii, in mixed order, give the same bits as alone."""
    centre, radius = np.array([5.1, 5.1, 5.1, 6.3]), np.array([7.0, 7.3, 7.0, 7.3])
    together = gains(centre, 40, radius)
    alone = [gains(centre[i : i + 1], 40, radius[i]) for i in range(4)]
    assert np.array_equal(together, np.concatenate(alone, axis=1))
