"""Gates and camera on the same hits: they agree if both are right, and disagree otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from tests.laboratories import certify
from tests.one_laboratory import reduce_session
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.tables import shots_as_columns
from virtual_lab.certificate.text import certificate_text
from virtual_lab.measurement import certification as certifying
from virtual_lab.measurement.camera.comparison import COMPARED, CameraComparison, compare_camera
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import Reality
from virtual_lab.streams import Streams
from virtual_lab.uncertainty.budget import Budget
from virtual_lab.uncertainty.estimate import Estimate

LABORATORIES = 10


def filmed(seed: int, *, faults: tuple[str, ...] = (), reality: Reality = Reality.REAL):
    """Return a test at the filmed cannon, whose camera tracks the ball itself."""
    return certify(
        "r161",
        procedure="bbcor",
        rig="filmed-cannon",
        seed=seed,
        faults=faults,
        reality=reality,
        detail=RecordDetail.SUMMED,
    )


def camera_of(seed: int, **changes) -> CameraComparison:
    camera = filmed(seed, **changes).certification.camera
    assert camera is not None
    return camera


@pytest.fixture(scope="module")
def certifications() -> list[Certification]:
    return [filmed(seed).certification for seed in range(LABORATORIES)]


@pytest.fixture(scope="module")
def comparisons(certifications: list[Certification]) -> list[CameraComparison]:
    return [each.camera for each in certifications if each.camera]


@pytest.mark.parametrize("name", COMPARED)
def test_sound_gates_and_camera_agree(name: str, comparisons: list[CameraComparison]) -> None:
    """Scores of the difference: mean within 4/√n of 0, and χ² of n within 4 of its deviations."""
    results = [each.quantities[name] for each in comparisons]
    scores = np.array([each.difference.value / each.difference.u for each in results])
    n = len(scores)
    assert abs(scores.mean()) < 4 / np.sqrt(n)
    assert abs(np.sum(scores**2) - n) < 4 * np.sqrt(2 * n)
    assert sum(each.agree for each in results) >= n - 3  # binomial law, 5 %: P(4 or more) = 0.001


@pytest.mark.parametrize("name", COMPARED)
def test_the_combined_result_is_between_both_and_at_least_as_certain(
    name: str, comparisons: list[CameraComparison]
) -> None:
    """The share is from 0 to 1, and the constants contribute no more u than in either method."""
    for each in comparisons:
        comparison = each.quantities[name]
        assert 0 <= comparison.share <= 1
        low, high = sorted([comparison.gates.value, comparison.video.value])
        assert low - 1e-12 <= comparison.joined.value <= high + 1e-12
        shared = min(comparison.gates.u_type_b, comparison.video.u_type_b)
        assert comparison.joined.u_type_b <= shared * 1.05


def test_gates_and_video_agree_on_an_ideal_day() -> None:
    """Without errors and noise, gates and video agree in e_A to 1e-5, for any geometry."""
    comparison = camera_of(1, reality=Reality.IDEAL).quantities["collision_efficiency"]
    assert comparison.video.value == pytest.approx(comparison.gates.value, abs=1e-5)


def test_the_speeds_of_camera_and_gates_agree_within_their_geometry(
    certifications: list[Certification],
) -> None:
    """The ratio of median speeds scatters as plane, height and base of the gates allow.

    The camera contributes 1 mm and 0.2 mm in 2 m and 1e-4 of the lens, 5.2e-4 together; the boards
    0.2 mm each in about 0.6 m.
    """
    ratios = []
    for each in certifications:
        camera = each.camera
        assert camera is not None
        valid = each.judgement.valid
        ratios.append(np.median(camera.filmed.flights.speed_in[valid] / each.shots.speed[valid]))
        u = camera.u["speed_in"][valid] / each.shots.speed[valid]
        assert ((u > 4e-4) & (u < 8e-4)).all()
        off = camera.filmed.place[valid] - each.shots.position[valid]
        assert abs(float(np.median(off))) < 3e-3
    off = np.array(ratios) - 1
    assert abs(off.mean()) < 4 * 6e-4 / np.sqrt(len(off))
    assert 3e-4 < off.std() < 9e-4


def test_the_scatter_due_to_the_heights_is_the_stated_one(
    certifications: list[Certification],
) -> None:
    """Noise of 20 µm in the heights, ten times: χ² of the changes within 5 of its deviations.

    Each shot has three independent errors, so its ten repetitions count as ten.
    """
    certification, sigma, times = certifications[0], 2e-5, 10
    block, measured = certification.block, certification.readings
    reduced, _ = reduce_session(certification.session)
    passages = measured.flights.passages

    def told(noise: np.ndarray, u: float) -> CameraComparison:
        risen = replace(
            passages, heights=passages.heights + noise, heights_u=np.full(noise.shape, u)
        )
        readings = replace(measured, flights=replace(measured.flights, passages=risen))
        camera = compare_camera(block, reduced, readings, certification.hit_weights)
        assert camera is not None
        return camera

    def quantities(camera: CameraComparison) -> dict[str, np.ndarray]:
        flights = camera.filmed.flights
        return {
            "speed_in": flights.speed_in,
            "speed_out": flights.speed_out,
            "efficiency": camera.shots.rebound_efficiency,
            "place": camera.filmed.place,
            "angle": camera.filmed.angle_in,
        }

    level = np.zeros(passages.heights.shape)
    still, unsure = told(level, 0.0), told(level, sigma)
    noisy = [
        quantities(told(sigma * row, 0.0))
        for row in Streams(7).normal("heights", level.shape, np.arange(times))
    ]
    valid = certification.judgement.valid
    for name, best in quantities(still).items():
        added = np.sqrt(unsure.u[name] ** 2 - still.u[name] ** 2)
        scores = np.array([(each[name] - best) / added for each in noisy])[:, valid]
        assert abs(np.sum(scores**2) - scores.size) < 5 * np.sqrt(2 * scores.size), name


def test_a_wrong_frame_rate_shows_in_bpf(
    certifications: list[Certification],
) -> None:
    """A frame rate 2 % off changes both speeds alike, so e_A is unchanged, but not e0 at the speed.

    Gates and camera then disagree in BPF by the slope of e0, and agree in the speed ratio.
    """
    done = certifications[3]
    session = done.session
    clock = session.calibration["impact.camera.clock"]
    wrong = {"impact.camera.clock": Estimate(value=clock.value * 1.02, u=clock.u)}
    again = certify_session(replace(session, calibration={**session.calibration, **wrong}))
    assert again.camera is not None
    sound = done.camera
    assert sound is not None
    ratio = again.camera.filmed.flights.speed_in / sound.filmed.flights.speed_in
    assert ratio == pytest.approx(np.full(len(ratio), 1.02), rel=1e-9, nan_ok=True)
    assert not again.camera.quantities["bat_performance_factor"].agree


def test_the_camera_detects_a_moved_gate(certifications: list[Certification]) -> None:
    """One board has moved by 1 mm after its survey, so gates and camera disagree in speed.

    The ratio of the speeds changes alike in six laboratories.
    """

    def ratio(certification: Certification) -> float:
        camera = certification.camera
        assert camera is not None
        return float(np.nanmedian(camera.filmed.flights.speed_in / certification.shots.speed))

    off = [ratio(filmed(seed, faults=("gate-moved",)).certification) for seed in range(6)]
    sound = [ratio(each) for each in certifications[:6]]
    # change due to the fault alone, in the same laboratories: 1 mm in a base of 0.4 to 0.9 m
    change = np.array(off) - np.array(sound)
    assert np.abs(change).min() > 5e-4
    assert np.ptp(change) < 0.1 * np.abs(change).mean()


def test_the_certificate_states_both_results(
    certifications: list[Certification], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Document, text and shot table of a filmed test state the video results."""
    certification = certifications[3]
    document = certificate(certification)
    camera = document.second_witness
    assert camera is not None
    assert camera.hits + camera.missed == int(certification.hit_weights.used.sum())
    assert camera.collision_efficiency is not None
    assert camera.collision_efficiency.agree
    gates, stated = camera.collision_efficiency.gates, document.collision_efficiency
    assert stated is not None
    assert gates.value == pytest.approx(stated.value, rel=1e-12)
    # the stated u leans on hits of other positions too, the comparison on those of the result
    monkeypatch.setattr(certifying, "nearby_variances", lambda *_: {})
    alone = certify_session(certification.session).quantities["collision_efficiency"]
    assert gates.u == pytest.approx(alone.u, rel=1e-12)
    assert gates.u != pytest.approx(stated.u, rel=1e-12)
    text = certificate_text(document)
    assert "gates and video for" in text
    assert "agree" in text
    table = shots_as_columns(certification)
    flown, u = certification.camera.filmed, certification.camera.u
    for column, values in {
        "video_speed_mph": flown.flights.speed_in / 0.44704,
        "video_speed_u_mph": u["speed_in"] / 0.44704,
        "video_rebound_speed_mph": flown.flights.speed_out / 0.44704,
        "video_rebound_speed_u_mph": u["speed_out"] / 0.44704,
        "video_impact_position_in": flown.place / 0.0254,
        "video_impact_position_u_in": u["place"] / 0.0254,
        "video_angle_deg": np.degrees(flown.angle_in),
        "video_angle_u_deg": np.degrees(u["angle"]),
        "video_collision_efficiency": certification.camera.shots.rebound_efficiency,
        "video_collision_efficiency_u": u["efficiency"],
    }.items():
        assert table[column] == pytest.approx(values, rel=1e-12, nan_ok=True), column
    plain = certify("r161", procedure="bbcor", seed=3, detail=RecordDetail.SUMMED).certification
    assert certificate(plain).second_witness is None
    assert "video" not in certificate_text(certificate(plain))


@pytest.mark.parametrize("name", COMPARED)
def test_the_combined_result_has_the_smallest_variance(
    name: str, comparisons: list[CameraComparison]
) -> None:
    """The oracle is a grid of shares: constants add with their signs, noise is independent.

    The noise of each method is half of the difference's variance; the scatter of the hits is common
    to both.
    """

    def constants(budget: Budget) -> dict[str, float]:
        parts = [part for line in budget.components for part in line.parts or (line,)]
        return {part.name: part.sensitivity * part.u for part in parts if part.name != "hits"}

    shares = np.linspace(0, 1, 1001)[:, None]
    for each in comparisons:
        comparison = each.quantities[name]
        gates, video = constants(comparison.gates), constants(comparison.video)
        names = sorted(gates | video)
        one, other = (np.array([part.get(n, 0.0) for n in names]) for part in (gates, video))
        noise = next(c.u for c in comparison.difference.components if c.name == "hits") ** 2 / 2
        variance = ((1 - shares) * one + shares * other) ** 2
        total = variance.sum(axis=1) + ((1 - shares) ** 2 + shares**2)[:, 0] * noise
        assert comparison.share == pytest.approx(shares[np.argmin(total), 0], abs=2e-3)
