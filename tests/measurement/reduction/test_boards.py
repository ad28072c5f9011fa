"""The reduction of board records, against a numerically integrated flight past point beams."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from virtual_lab import catalog
from virtual_lab.measurement.reduction.flights import Flights
from virtual_lab.measurement.reduction.gates import (
    GateReadings,
    Passages,
    flights,
    heights_moved,
    passages,
)
from virtual_lab.records import BoardRecord
from virtual_lab.simulation.instruments.light_board import LightBoards, LightBoardSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Quiet, Streams

FIRST = np.zeros(1, dtype=int)  # index of the first shot
DISTANCES = (0.50, 0.35, 0.20)  # distances of the boards [m]
LOWEST, PITCH, BEAMS, RADIUS, GRAVITY = -0.150, 0.008, 34, 0.0366, 9.80665
DRAG = 0.00697  # drag rate of a baseball [1/m]
CONTACT, LEAVING = 0.02, 0.0207  # times of contact and of its end [s]
WINDOW = 0.3e-3  # edge_misfit of data/procedures/bbcor.toml [m]
KNOWN = {
    **{f"impact.gates.distance_{i}": np.array(d) for i, d in enumerate(DISTANCES)},
    **{f"impact.gates.height_{i}": np.array(0.0) for i in range(3)},
    "impact.gates.clock": np.array(1.0),
    "hall.gravity": np.array(GRAVITY),
}


def nominal_boards() -> LightBoardSpec:
    """Return the boards of the catalog at their nominal positions, with an exact clock."""
    spec = catalog.load("instruments", "light-boards", LightBoardSpec).spec
    return replace(spec, distances=DISTANCES, heights=(), clock_fast=0.0)


def flown(speed: float, height: float, slope: float, drag: float, way: int) -> np.ndarray:
    """Return the edges of every beam, (board, beam, edge) [s] from contact; NaN: not broken.

    `slope` is the height per meter of distance. The flight in is integrated backward from the
    target.
    """

    def motion(_: float, state: np.ndarray) -> list[float]:
        pull = -drag * np.hypot(state[2], state[3])
        return [state[2], state[3], pull * state[2], pull * state[3] - GRAVITY]

    sign = -1 if way == 0 else 1
    end = sign * 1.3 * 0.56 / speed
    start = [0.0, height, sign * speed, sign * speed * slope]
    path = solve_ivp(motion, (0, end), start, dense_output=True, rtol=1e-11, atol=1e-13).sol
    grid = np.linspace(0, end, 2001)
    along = path(grid)
    edges = np.full((3, BEAMS, 2), np.nan)
    for board, distance in enumerate(DISTANCES):
        for beam in range(BEAMS):
            at = np.array([distance, LOWEST + PITCH * beam])

            def gap(time: float, at: np.ndarray = at) -> float:
                return float(np.hypot(*(path(time)[:2] - at)) - RADIUS)

            gaps = np.hypot(*(along[:2] - at[:, None])) - RADIUS
            nearest = int(gaps.argmin())
            if gaps[nearest] < 0 < gaps[-1] and gaps[0] > 0:
                roots = [
                    brentq(gap, *sorted(pair), xtol=1e-15, rtol=1e-14)
                    for pair in ((0.0, grid[nearest]), (grid[nearest], end))
                ]
                edges[board, beam] = sorted(roots)
    return edges


@cache
def record_of(
    speed_in: float,
    speed_out: float,
    *,
    height: float = 0.0,
    slope_in: float = 0.0,
    slope_out: float = 0.0,
    drag: float = DRAG,
) -> BoardRecord:
    inward = CONTACT + flown(speed_in, height, slope_in, drag, 0)
    outward = LEAVING + flown(speed_out, height, slope_out, drag, 1)
    return BoardRecord(times=np.stack([inward, outward])[None])


def reduced(record: BoardRecord, drag: float = DRAG) -> tuple[Passages, Flights]:
    board_passages = passages(record, lowest=LOWEST, pitch=PITCH)
    return board_passages, flights(KNOWN, "impact", board_passages, np.array([drag]))


FLIGHTS = [
    {"speed_in": 60.8, "speed_out": 14.0},
    {"speed_in": 60.8, "speed_out": 14.0, "height": 3.3e-3, "slope_out": 0.09},
    {"speed_in": 60.8, "speed_out": 6.0, "height": -2.1e-3, "slope_in": 4e-3, "slope_out": -0.05},
    {"speed_in": 71.5, "speed_out": 5.0, "height": 1e-3, "slope_in": -4e-3, "slope_out": 0.1},
    {"speed_in": 31.3, "speed_out": 44.0, "height": 2e-2, "slope_out": 0.2},
]


@pytest.mark.parametrize("flight", FLIGHTS)
def test_speeds_offset_and_slope_of_a_flight_are_recovered(flight: dict[str, float]) -> None:
    """The reduction neglects the curvature over a ball's width and the effect of drag on the rise.

    Gravity bends the flight by g (R/v)²/2 while the ball passes a beam, drag raises a rising ball
    by κ x of the rise, and the path is √(1 + slope²) times the distance. The bounds follow from
    these.
    """
    board_passages, measured_flight = reduced(record_of(**flight))
    back, slope = flight["speed_out"], abs(flight.get("slope_out", 0.0))
    fall = GRAVITY * 0.5 / back**2  # slope gained by the far board
    bend = GRAVITY * (RADIUS / back) ** 2 / 2
    assert measured_flight.speed_in == pytest.approx(flight["speed_in"], rel=2e-6)
    assert measured_flight.speed_out == pytest.approx(
        back, rel=2e-6 + DRAG * 0.5 * (slope + fall) ** 2 + bend * (slope + fall) / 0.3
    )
    assert measured_flight.offset == pytest.approx(flight.get("height", 0.0), abs=2e-6)
    assert measured_flight.slope_out == pytest.approx(
        flight.get("slope_out", 0.0), abs=2e-5 + bend / 0.3 + DRAG * 0.5 * (slope + fall)
    )
    assert np.nanmax(board_passages.misfit * [flight["speed_in"], back]) < WINDOW / 5


@pytest.mark.parametrize("flight", FLIGHTS)
def test_the_boards_record_the_edges_of_a_flight(flight: dict[str, float]) -> None:
    """The instrument flies straight at each board; the error is the curvature, some micrometers."""
    spec = nominal_boards().ideal()
    assert (spec.distances, spec.lowest, spec.pitch) == (DISTANCES, LOWEST, PITCH)
    passage = Passage(
        speed_in=np.array([flight["speed_in"]]),
        speed_out=np.array([flight["speed_out"]]),
        drag=np.array([DRAG]),
        radius=RADIUS,
        gravity=GRAVITY,
        height=np.array([flight.get("height", 0.0)]),
        slope_in=np.array([flight.get("slope_in", 0.0)]),
        slope_out=np.array([flight.get("slope_out", 0.0)]),
    )
    boards = LightBoards.commission(spec, Quiet(), "b")
    written = boards.watch(passage, np.array([CONTACT]), np.array([LEAVING]), Quiet(), "b", FIRST)
    flown_edges = record_of(**flight).times
    both = np.isfinite(written.times) & np.isfinite(flown_edges)
    # grazed beams: may be broken in one record only
    assert (np.isfinite(written.times) != np.isfinite(flown_edges)).sum() <= 4
    assert both[0, 0].sum() > 3 * 8 * 2
    speeds = np.reshape([flight["speed_in"], flight["speed_out"]], (1, 2, 1, 1, 1))
    apart = np.abs(np.where(both, written.times - flown_edges, 0.0)) * speeds
    deep = np.where(both, np.diff(flown_edges, axis=-1) * speeds, 0.0) > RADIUS
    bend = GRAVITY * (RADIUS / flight["speed_out"]) ** 2 / 2
    assert apart[deep.repeat(2, axis=-1) if deep.shape[-1] == 1 else deep].max() < 5e-5 + 2 * bend


def test_the_boards_need_the_drag() -> None:
    """Without drag the reduced speed is off by κ x, with x the mean distance of the boards."""
    _, measured_flight = reduced(record_of(60.8, 14.0), drag=0.0)
    assert measured_flight.speed_in / 60.8 - 1 == pytest.approx(DRAG * 0.35, rel=0.02)


def changed(record: BoardRecord, edges: tuple, value: float) -> BoardRecord:
    times = np.array(record.times)
    times[edges] = value
    return BoardRecord(times=times)


GOOD = dict(FLIGHTS[1])


def test_two_boards_are_enough() -> None:
    """If one board saw nothing, speed and height are as accurate as before."""
    for board in range(3):
        _, measured_flight = reduced(changed(record_of(**GOOD), np.s_[0, :, board], np.nan))
        assert measured_flight.speed_in == pytest.approx(60.8, rel=5e-6)
        assert measured_flight.speed_out == pytest.approx(14.0, rel=1e-4)
        assert measured_flight.offset == pytest.approx(3.3e-3, abs=1e-5)


def test_one_board_gives_no_speed() -> None:
    _, measured_flight = reduced(changed(record_of(**GOOD), np.s_[0, 1, :2], np.nan))
    assert np.isnan(measured_flight.speed_out[0])
    assert np.isnan(measured_flight.slope_out[0])
    assert np.isfinite(measured_flight.speed_in[0])


@pytest.mark.parametrize(("left", "seen"), [(4, True), (3, False), (0, False)])
def test_fewer_than_four_beams_are_no_passage(left: int, seen: bool) -> None:
    """Half of the ball passes outside the curtain, so the broken beams are on one side of it."""
    times = np.array(record_of(**GOOD).times)
    broken = np.flatnonzero(np.isfinite(times[0, 0, 0, :, 0]))
    times[0, 0, 0, broken[left:]] = np.nan
    board_passages, flight = reduced(BoardRecord(times=times))
    assert np.isfinite(board_passages.times[0, 0, 0]) == seen
    assert np.isfinite(board_passages.heights[0, 0, 0]) == seen
    assert flight.speed_in == pytest.approx(60.8, rel=2e-5)


def test_two_dead_beams_per_board_do_no_harm() -> None:
    """Two adjacent beams of each board are dead; only the noise grows."""
    for dead in (15, 18, 20):
        _, measured_flight = reduced(
            changed(record_of(**GOOD), np.s_[0, :, :, dead : dead + 2], np.nan)
        )
        assert measured_flight.speed_in == pytest.approx(60.8, rel=5e-6)
        assert measured_flight.speed_out == pytest.approx(14.0, rel=1e-4)
        assert measured_flight.offset == pytest.approx(3.3e-3, abs=2e-5)


def test_a_ball_half_below_the_curtain_is_measured_by_its_upper_beams() -> None:
    """At 2.95 m/s it falls 135 to 146 mm by the far board, whose lowest beam is at -150 mm."""
    board_passages, measured_flight = reduced(record_of(60.8, 2.95))
    broken = np.isfinite(record_of(60.8, 2.95).times[0, 1, 0, :, 0])
    assert broken[0]
    assert 4 <= broken.sum() < 9
    assert np.isfinite(board_passages.times).all()
    assert measured_flight.speed_out == pytest.approx(2.95, rel=5e-3)


@pytest.mark.parametrize("beams", [1, 2, 4])
@pytest.mark.parametrize("ahead", [0.01, 0.03, 0.10])
def test_a_scrap_of_the_sabot_is_detected_or_harmless(beams: int, ahead: float) -> None:
    """Some beams of the far board break early: the misfit is too large, or the speed is right."""
    record = record_of(**GOOD)
    for first in range(14, 24 - beams):
        struck = np.s_[0, 0, 0, first : first + beams, 0]
        early = np.array(record.times[struck]) - ahead / 60.8
        board_passages, measured_flight = reduced(changed(record, struck, early))
        deviation = abs(float(measured_flight.speed_in[0]) / 60.8 - 1)
        assert board_passages.misfit[0, 0] * 60.8 > WINDOW or deviation < 1e-5, (first, deviation)
    assert np.isfinite(record.times[0, 0, 0, 16:20]).all()


def test_a_doubled_edge_is_detected() -> None:
    """A flickering beam clears 5 mm of flight late, at any one board and in either direction."""
    record = record_of(**GOOD)
    for direction, speed in ((0, 60.8), (1, 14.0)):
        for board in range(3):
            beams = np.flatnonzero(np.isfinite(record.times[0, direction, board, :, 0]))
            middle = beams[len(beams) // 2]
            edge = np.s_[0, direction, board, middle, 1]
            late = float(record.times[edge]) + 5e-3 / speed
            board_passages, _ = reduced(changed(record, edge, late))
            assert board_passages.misfit[0, direction] * speed > WINDOW
            assert board_passages.misfit[0, 1 - direction] * (74.8 - speed) < WINDOW / 10


def test_a_shot_is_reduced_as_if_alone() -> None:
    """A batch of odd shots: no board, one board and all boards saw the ball."""
    records = [
        changed(record_of(**GOOD), np.s_[0], np.nan),
        changed(record_of(**GOOD), np.s_[0, :, 1:], np.nan),
        record_of(**GOOD),
    ]
    batch = BoardRecord(times=np.concatenate([record.times for record in records]))
    together = passages(batch, lowest=LOWEST, pitch=PITCH)
    for shot, record in enumerate(records):
        alone = passages(record, lowest=LOWEST, pitch=PITCH)
        for name in ("times", "heights", "misfit"):
            assert np.array_equal(
                getattr(together, name)[shot], getattr(alone, name)[0], equal_nan=True
            )


def test_ideal_boards_have_no_misfit() -> None:
    """On a straight flight without air and gravity, parabola and line are exact."""
    spec = nominal_boards().ideal()
    boards = LightBoards.commission(spec, Quiet(), "b")
    straight = Passage(
        speed_in=np.array([60.8]),
        speed_out=np.array([12.0]),
        drag=np.zeros(1),
        radius=RADIUS,
        gravity=0.0,
        height=np.array([2.7e-3]),
        slope_out=np.array([0.2]),
    )
    record = boards.watch(straight, np.array([CONTACT]), np.array([LEAVING]), Quiet(), "b", FIRST)
    board_passages = passages(record, lowest=LOWEST, pitch=PITCH)
    assert np.abs(board_passages.misfit).max() < 1e-15
    measured_flight = flights(
        KNOWN | {"hall.gravity": np.array(0.0)}, "impact", board_passages, np.zeros(1)
    )
    assert measured_flight.speed_in == pytest.approx(60.8, rel=1e-12)
    assert measured_flight.speed_out == pytest.approx(12.0, rel=1e-12)
    assert measured_flight.offset == pytest.approx(2.7e-3, rel=1e-9)
    assert measured_flight.slope_out == pytest.approx(0.2, rel=1e-9)


@pytest.mark.parametrize("slope", [0.0, -0.25])
def test_heights_scatter_by_their_stated_uncertainty(slope: float) -> None:
    """150 boards with noise against noiseless ones: rms of the errors over that of their u.

    Edges and thresholds both scatter. A ball is level, or half outside the far board, where u is
    twice as large. With 150 draws of the thresholds the standard error is 6 %; the stated u of the
    edges is slightly too large.
    """
    exact = catalog.load("instruments", "light-boards", LightBoardSpec).spec.ideal()
    real = catalog.load("instruments", "light-boards", LightBoardSpec).spec
    noisy = replace(
        exact, trip_spread=real.trip_spread, tick=real.tick, edge_jitter=real.edge_jitter
    )
    n = 9
    passage = Passage(
        speed_in=np.full(n, 60.8),
        speed_out=np.full(n, 12.0),
        drag=np.full(n, DRAG),
        radius=RADIUS,
        gravity=GRAVITY,
        height=np.linspace(-0.5, 0.5, n) * PITCH,
        slope_out=np.full(n, slope),
    )

    def seen(spec: LightBoardSpec, seed: int) -> Passages:
        boards = LightBoards.commission(spec, Streams(seed), "b")
        meeting = np.full(n, CONTACT), np.full(n, LEAVING)
        record = boards.watch(passage, *meeting, Streams(seed), "b", np.arange(n))
        return passages(record, lowest=LOWEST, pitch=PITCH)

    every = [seen(noisy, seed) for seed in range(150)]
    errors = np.array([each.heights for each in every]) - seen(exact, 0).heights
    rms, rms_u = (
        np.sqrt(np.mean(np.square(values), axis=(0, 1)))
        for values in (errors, [each.heights_u for each in every])
    )
    assert ((rms > 0.75 * rms_u) & (rms < 1.15 * rms_u)).all()
    far, rest = rms[1, 0], np.delete(rms, 3)
    assert rest.max() < 1.3 * rest.min()
    assert (far > 2 * rest.max()) == (slope < 0)


@pytest.mark.parametrize("blind", [None, 0, 2])
def test_moved_heights_have_the_covariance_of_a_line(blind: int | None) -> None:
    """Offset and slopes have u² (XᵀX)⁻¹ of the gates that saw the ball, in each direction."""
    sigma = {0: 2e-5, 1: 5e-5}
    board_passages, _ = reduced(record_of(**GOOD))
    heights_u = np.broadcast_to(np.reshape([sigma[0], sigma[1]], (1, 2, 1)), (1, 2, 3)).copy()
    heights = np.array(board_passages.heights)
    if blind is not None:
        heights[:, :, blind] = heights_u[:, :, blind] = np.nan
    board_passages = replace(board_passages, heights=heights, heights_u=heights_u)
    still = flights(KNOWN, "impact", board_passages, np.array([DRAG]))
    distances = np.array(
        [KNOWN[f"impact.gates.distance_{k}"] for k in range(board_passages.times.shape[2])]
    )
    readings = GateReadings(
        stage="impact", passages=board_passages, distances=distances, shows_height=True
    )
    shifts = heights_moved(readings)(KNOWN, np.array([DRAG]))
    parts = np.stack(
        [
            (getattr(shifts, name) - getattr(still, name))[:, 0]
            for name in ("offset", "slope_in", "slope_out")
        ]
    )
    gate_distances = [d for place, d in enumerate(DISTANCES) if place != blind]
    design = np.vander(gate_distances, 2, increasing=True)
    line = np.linalg.inv(design.T @ design)
    expected = np.zeros((3, 3))
    expected[:2, :2] = sigma[0] ** 2 * line
    expected[2, 2] = sigma[1] ** 2 * line[1, 1]
    assert parts @ parts.T == pytest.approx(expected, rel=1e-9, abs=1e-20)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"distances": (0.2, 0.35, 0.5)}, "must fall"),
        ({"distances": (0.5, 0.35, 0.0)}, "above 0"),
        ({"lowest": 0.01}, "none at the line of fire"),
    ],
)
def test_impossible_boards_are_refused(change: dict, said: str) -> None:
    spec = catalog.load("instruments", "light-boards", LightBoardSpec).spec
    with pytest.raises(ValueError, match=said):
        replace(spec, **change)


def test_the_misfit_is_the_scatter_of_the_edges_of_a_beam_without_bias() -> None:
    """Midpoints and half chords of edges that scatter by σ scatter by σ/√2.

    A line and a parabola through n beams leave 2n - 5 degrees of freedom, 11 for 8 beams. 4000
    boards give the variance to 0.7 %; one degree of freedom is 9 %.
    """
    sigma, rng = 2e-6, np.random.default_rng(20261125)
    middle = 0.03 + 1e-6 * np.arange(8)
    half = np.sqrt(RADIUS**2 - (PITCH * (np.arange(8) - 3.4)) ** 2) / 60
    edges = np.stack([middle - half, middle + half], axis=-1)
    noise = rng.normal(0, sigma, (4000, 2, 1, 8, 2))
    board_passages = passages(BoardRecord(times=edges + noise), lowest=LOWEST, pitch=PITCH)
    assert np.mean((board_passages.misfit / sigma) ** 2) == pytest.approx(1 / 2, rel=0.03)
