"""The edge fit against rendered stitched balls; its tables and solver against closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtr

from tests.video.stitched import LENS, Array, Scene, scene
from virtual_lab.errors import InputError
from virtual_lab.video.locate.located import Flag
from virtual_lab.video.locate.plain_ball.refining import Optics, refine
from virtual_lab.video.locate.stitched_ball.cover import covered
from virtual_lab.video.locate.stitched_ball.edge import Edged, fit_edge
from virtual_lab.video.locate.stitched_ball.profiles import FIRST, PER, profiles


def fitted(seen: Scene, **known: object) -> Edged:
    """Return the fit of balls whose outlines are known to be circles, unless told otherwise."""
    given = {"regions": seen.regions, "corners": seen.corners, "start": seen.start()}
    return fit_edge(**(given | {"oval_u": 0.0} | known), noise=seen.noise, lens=LENS)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def errors(seen: Scene, found: Edged) -> tuple[Array, Array]:
    """Return errors (2, region) [pixel], and the same over their uncertainties."""
    located = found.located
    off = np.stack([located.x - seen.x, located.y - seen.y])
    u = np.stack([located.x_u, located.y_u])
    return off, off / np.hypot(u, [found.x_pattern_u, found.y_pattern_u])


@pytest.mark.parametrize(
    ("light", "blur", "worst", "least"),
    [
        # seams that hide at the rim are rare, and reckoned with in every place
        ("soft", 0, 0.010, 0.5),
        ("soft", 2, 0.010, 0.5),
        ("soft", 6, 0.020, 0.6),
        ("back", 2, 0.005, 0.6),
        ("side", 0, 0.08, 0.6),
        ("side", 6, 0.10, 0.6),
    ],
)
def test_a_stitched_ball_is_placed(light: str, blur: float, worst: float, least: float) -> None:
    """Root mean squares over 100 balls, and errors as large as they are said to be."""
    seen = scene(light, blur)
    found = fitted(seen)
    assert not found.located.flags.any()
    off, pulls = errors(seen, found)
    assert max(map(rms, off)) < worst
    assert least < rms(pulls) < 1.5
    assert np.median(np.abs(pulls)) < 1.2


@pytest.mark.parametrize("hidden", [0.0, 0.3, 0.5])
def test_a_rim_that_is_not_seen_is_told(hidden: float) -> None:
    """What stands before a ball stood before its background too: the share of a thin ring."""
    side, radius, middle = 101, 36.0, 50.0
    rows, columns = np.mgrid[:side, :side]
    back = np.where(columns > middle + radius * np.cos(np.pi * hidden), 110.0, 40.0)
    away = np.hypot(columns - middle, rows - middle)
    region = np.where((away < radius) & (back < 100), 190.0, back)
    use, noise = np.ones((side, side), np.uint8), np.array([0.0, 4.0, 0.0, 0.0, 255.0])
    told = covered(region, use, back, middle, middle, radius, 1.0, np.zeros(2), noise)
    # the chord cuts the ring's middle, 3 pixels inside the rim, a little later
    ring = np.arccos(np.cos(np.pi * hidden) * radius / (radius - 3)) / np.pi if hidden else 0.0
    assert told == pytest.approx(ring, abs=0.01)
    dim = np.where(region > 180, 40.0 + 10 * 2, region)  # 10 sigma over what is behind
    assert covered(dim, use, back, middle, middle, radius, 1.0, np.zeros(2), noise) == 0.0


def test_a_plain_ball_costs_no_more_than_twice_its_bound() -> None:
    """The pattern's strength is found to be none."""
    seen = scene("soft", seams=0.0)
    off, pulls = errors(seen, fitted(seen))
    assert max(map(rms, off)) < 2 * 0.0023  # the occlusion model's bound
    assert rms(pulls) < 1.2


def test_a_shadow_is_the_occlusion_models_own() -> None:
    """Before a bright panel seams do not show: both fits are good, and agree."""
    seen = scene("back")
    other = refine(
        seen.regions, seen.corners, seen.start(), noise=seen.noise, optics=Optics(lens=LENS)
    ).located
    assert (other.flags > 0).mean() < 0.05
    assert max(rms(other.x - seen.x), rms(other.y - seen.y)) < 0.005
    found = fitted(seen).located
    assert rms(found.x - other.x) < 0.003


def test_a_radius_that_is_known_helps_where_half_the_rim_is_dark() -> None:
    """Along the light, place and radius go together: the ball's other frames may tell the one."""
    seen = scene("side")
    start = seen.start()
    start.radius[:] = seen.radius + 0.01
    off, pulls = errors(seen, fitted(seen, start=start, radius_u=0.02))
    assert rms(off[1]) < 0.03
    assert rms(pulls) < 1.3


def test_outlines_that_are_ellipses() -> None:
    """4 % longer along one way, as 600 px off a camera's axis: known, or found in the picture."""
    seen = scene("soft", stretch=1.04)
    oval = (1.04 - 1) / (1.04 + 1) * np.array([np.cos(np.pi / 3), np.sin(np.pi / 3)])
    off, _ = errors(seen, fitted(seen, oval=oval))
    assert max(map(rms, off)) < 0.010
    found = fitted(seen, oval_u=0.02)
    assert np.median(found.oval, axis=0) == pytest.approx(oval, abs=3e-4)
    assert max(map(rms, errors(seen, found)[0])) < 0.016
    seen = scene("soft", stretch=1.01)
    start = seen.start()
    found = fit_edge(seen.regions, seen.corners, start, noise=seen.noise, lens=LENS)
    off, pulls = errors(seen, found)
    assert max(map(rms, off)) < 0.015
    assert rms(pulls) < 1.5


def test_what_is_cut_or_covered_is_flagged_and_placed() -> None:
    """A quarter of the ball beyond the frame, or behind a mask; half its errors within 0.01 px."""
    seen = scene("soft")
    end = int(seen.x.mean() + 15)
    for flag, regions, mask in (
        (Flag.CLIPPED, seen.regions[:, :, :end], None),
        (Flag.OVERLAP, seen.regions, np.arange(seen.regions.shape[2]) < end),
    ):
        shape = (1, *regions.shape[1:])
        cover = None if mask is None else np.broadcast_to(mask, shape)
        found = fitted(seen, regions=regions, mask=cover)
        assert (found.located.flags == flag).all()
        off, pulls = errors(seen, found)
        assert np.median(np.abs(off[0])) < 0.010
        assert rms(pulls) < 1.6


def test_no_ball_is_not_found() -> None:
    """Noise alone, a start that is not known."""
    seen = scene("soft", count=20)
    empty = np.random.default_rng(2).normal(40.0, 1.5, seen.regions.shape)
    found = fitted(seen, regions=empty).located
    assert (found.flags > 0).all()
    assert np.isnan(found.x).mean() > 0.9
    start = seen.start()
    start.x[3] = np.nan
    assert fitted(seen, start=start).located.flags.tolist() == [
        int(Flag.NOT_FOUND) if k == 3 else 0 for k in range(20)
    ]


def test_tables_have_closed_forms() -> None:
    """A level's edge is the normal distribution, a level that falls with depth its integral."""
    radius, width = 20.0, 0.8
    table = profiles(radius, width, 6.0, 0.0).table
    t = FIRST + np.arange(len(table)) / PER
    density = np.exp(-(t**2) / 2) / np.sqrt(2 * np.pi)
    columns = table.shape[1] // 2
    near = t < 8
    level, falls = ndtr(t), ndtr(t) - width / radius * (t * ndtr(t) + density)
    assert np.abs(table[:, 0] - level)[near].max() < 3e-4
    assert np.abs(table[:, columns] - density)[near].max() < 1e-3
    assert np.abs(table[:, 1] - falls)[near].max() < 3e-4
    # the pattern's knots share the ball among them
    assert np.abs(table[:, 3:columns].sum(axis=1) - table[:, 0]).max() < 1e-9
    # the facing of a sphere's surface, blurred
    for entry in (130, 180, 300):

        def facing(d: float, at: float = t[entry]) -> float:
            weight = np.exp(-((at - d / width) ** 2) / 2) / np.sqrt(2 * np.pi) / width
            return float(np.sqrt(1 - (1 - d / radius) ** 2) * weight)

        blurred = quad(facing, 0, 0.2)[0] + quad(facing, 0.2, 12)[0]
        assert table[entry, 2] == pytest.approx(blurred, abs=3e-4)


def test_the_ring_is_solved_as_a_whole_matrix_is() -> None:
    """Solution and inverse against numpy's, of a random system of the same shape."""
    from virtual_lab.video.locate.stitched_ball.solve import eliminate, substitute

    random = np.random.default_rng(4)
    count, n, m = 6, 3, 4
    total = count * n + m
    rows = []
    for k in range(count):
        part = np.zeros((12, total))
        near = [k * n + i for i in range(n)] + [(k + 1) % count * n + i for i in range(n)]
        part[:, near + list(range(count * n, total))] = random.normal(size=(12, 2 * n + m))
        rows.append(part)
    design = np.concatenate(rows)
    whole, right = design.T @ design, random.normal(size=total)
    ring = range(count)
    blocks = np.array([whole[k * n : k * n + n, k * n : k * n + n] for k in ring])
    links = np.array([whole[k * n : k * n + n][:, near_of(k, count, n)] for k in ring])
    border = np.zeros((count, n, n + m + 1))
    shared = np.zeros((n + m, n + m + 1))
    for k in ring:
        border[k, :, n:-1] = whole[k * n : k * n + n, count * n :]
        border[k, :, -1] = right[k * n : k * n + n]
    shared[n:, n:-1], shared[n:, -1] = whole[count * n :, count * n :], right[count * n :]
    assert eliminate(blocks, links, border, shared)
    out = np.empty((count, n))
    last = substitute(blocks, links, border, shared, -1, out)
    exact = np.linalg.solve(whole, right)
    assert np.concatenate([out.ravel(), last]) == pytest.approx(exact, rel=1e-9, abs=1e-9)
    last = substitute(blocks, links, border, shared, 1, out)
    exact = np.linalg.inv(whole)[:, count * n + 1]
    assert np.concatenate([out.ravel(), last]) == pytest.approx(exact, rel=1e-9, abs=1e-9)


def near_of(k: int, count: int, n: int) -> list[int]:
    return [(k + 1) % count * n + i for i in range(n)]


def test_bad_input() -> None:
    """Arrays that do not fit, a radius or a lens of nothing."""
    seen = scene("soft", count=2)
    for bad in ({"corners": np.zeros((1, 2))}, {"radius_u": 0.0}):
        with pytest.raises(InputError, match="allowed"):
            fitted(seen, **bad)
    with pytest.raises(InputError, match="lens"):
        fit_edge(seen.regions, seen.corners, seen.start(), noise=seen.noise, lens=0.0)
