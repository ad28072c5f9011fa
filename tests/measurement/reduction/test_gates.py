"""The reduction of gate records, against a numerically integrated flight."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from virtual_lab.measurement.reduction.gates import GateReadings, flights, passages
from virtual_lab.records import GateRecord
from virtual_lab.uncertainty.estimate import Estimate

FAR, NEAR, RADIUS = 0.60, 0.25, 0.0366  # distances of the gates, radius of the ball [m]
SURVEYED = {
    "impact.gates.distance_0": np.array(FAR),
    "impact.gates.distance_1": np.array(NEAR),
    "impact.gates.clock": np.array(1.0),
}
DRAG = 0.0345  # drag rate [1/m], five times that of a baseball


def flown(speed: float, places: np.ndarray, *, drag: float, towards: bool) -> np.ndarray:
    """Return times from the target at which x = `places` is passed: dv/dt = -κ v |v|.

    The flight in is integrated backward in time from the speed at the target.
    """

    def motion(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -drag * state[1] * abs(state[1])]

    velocity = -speed if towards else speed
    events = [lambda t, s, place=place: s[0] - place for place in places]
    solution = solve_ivp(
        motion,
        (0, -0.1 if towards else 0.1),
        [0.0, velocity],
        events=events,
        rtol=1e-12,
        atol=1e-14,
    )
    return np.array([times[0] for times in solution.t_events])


def record_of(speed_in: float, speed_out: float, drag: float) -> GateRecord:
    edges = np.array([[FAR + RADIUS, FAR - RADIUS], [NEAR + RADIUS, NEAR - RADIUS]])
    inward = flown(speed_in, edges.ravel(), drag=drag, towards=True).reshape(2, 2)
    outward = flown(speed_out, edges[:, ::-1].ravel(), drag=drag, towards=False).reshape(2, 2)
    return GateRecord(times=0.2 + np.stack([inward, outward])[None])


@pytest.mark.parametrize("drag", [0.0, DRAG])
@pytest.mark.parametrize(("speed_in", "speed_out"), [(26.8224, 7.0), (60.0, 14.0)])
def test_the_speeds_of_a_flight_are_recovered(
    speed_in: float, speed_out: float, drag: float
) -> None:
    """The oracle is solve_ivp; the mean of two edges is off the passage by (κR)²/6 ≈ 3e-7."""
    record = record_of(speed_in, speed_out, drag)
    measured = flights(SURVEYED, "impact", passages(record), np.array([drag]))
    assert measured.speed_in == pytest.approx(speed_in, rel=1e-6)
    assert measured.speed_out == pytest.approx(speed_out, rel=1e-6)


def test_the_reduction_is_exact_in_thick_air() -> None:
    """With κ x = 1.2 at the far gate a series in κ x would not suffice.

    The passages are those of a point, without a radius.
    """
    places, drag = np.array([FAR, NEAR]), 2.0
    directions = ((20, True), (15, False))
    times = [flown(speed, places, drag=drag, towards=direction) for speed, direction in directions]
    record = GateRecord(times=0.2 + np.repeat(np.stack(times)[None, ..., None], 2, axis=3))
    measured = flights(SURVEYED, "impact", passages(record), np.array([drag]))
    assert measured.speed_in == pytest.approx(20, rel=1e-9)
    assert measured.speed_out == pytest.approx(15, rel=1e-9)


def test_gates_need_the_drag() -> None:
    """Without drag the same record is off by κ x, so the test above is sensitive to air."""
    record = record_of(26.8224, 7.0, DRAG)
    still = flights(SURVEYED, "impact", passages(record), np.zeros(1)).speed_in
    middle = (FAR + NEAR) / 2
    assert still / 26.8224 - 1 == pytest.approx(DRAG * middle, rel=0.05)


def test_a_passage_with_a_missing_edge_is_nan() -> None:
    """A missing edge is a missing passage; the other direction is unaffected."""
    times = np.array(record_of(26.8224, 7.0, 0.0).times)
    times[0, 1, 0, 1] = np.nan
    record = GateRecord(times=times)
    constants = {name: Estimate(value=float(value)) for name, value in SURVEYED.items()}
    readings = GateReadings.of(record, constants, "impact")
    assert np.isnan(readings.raw.speed_out[0])
    assert np.isfinite(readings.raw.speed_in[0])
    assert readings.passages.times.shape == (1, 2, 2)


def test_three_gates_show_the_uncertainty_of_a_speed() -> None:
    """Noise σ per time, n = 3: u(v) = v² σ/√Σ(d - d̄)², u(t) = σ √(1/n + d̄²/Σ(d - d̄)²).

    A gate 0.3 mm off shifts all balls alike, so it is no part of this scatter. 4000 balls: 5 %.
    """
    places, sigma, speed, balls = np.array([0.5, 0.35, 0.2]), 2e-6, 30.0, 4000
    rng = np.random.default_rng(5)
    deviation = np.array([0.0, 3e-4, 0.0])
    ways = np.stack([0.1 - (places + deviation) / speed, 0.2 + (places + deviation) / speed])
    noise = sigma * np.sqrt(2) * rng.standard_normal((balls, 2, 3, 2))  # edge noise, two per gate
    constants = {f"impact.gates.distance_{k}": Estimate(value=d) for k, d in enumerate(places)}
    raw_u = GateReadings.of(
        GateRecord(times=ways[None, ..., None] + noise), constants, "impact"
    ).raw_u
    width = np.sum((places - places.mean()) ** 2)
    assert raw_u.speed_in == pytest.approx(speed**2 * sigma / np.sqrt(width), rel=0.05)
    assert raw_u.speed_out == pytest.approx(speed**2 * sigma / np.sqrt(width), rel=0.05)
    at_bat = sigma * np.sqrt(1 / 3 + places.mean() ** 2 / width)
    assert raw_u.contact == pytest.approx(at_bat, rel=0.05)


def test_two_gates_do_not_show_the_uncertainty_of_a_speed() -> None:
    constants = {name: Estimate(value=float(value)) for name, value in SURVEYED.items()}
    raw_u = GateReadings.of(record_of(26.8224, 7.0, 0.0), constants, "impact").raw_u
    assert np.isnan(raw_u.speed_in).all()
