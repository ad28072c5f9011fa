"""The occlusion fit against exact images: at the bound, without bias, honest where it is lost."""

import numpy as np
import pytest

from tests.video.plain import FIELD, balls, located, noise_of
from tests.video.spectrum import Floats, disc
from virtual_lab.errors import InputError
from virtual_lab.video.locate.located import Flag
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.plain_ball.bound import bound, bound_of_edge
from virtual_lab.video.locate.plain_ball.refining import Optics, cut, refine

KNOWN = Optics(lens=0.8)


def corners(regions: Floats) -> Floats:
    """Return the corners of regions that are frames."""
    return np.zeros((len(regions), 2))


@pytest.mark.parametrize(
    ("radius", "blur", "snr", "slope"),
    [(15, 0, 96, 0), (30, 2, 96, 0.5), (30, 6, 27, 0.5), (15, 40, 27, 0), (20, 80, 5, 0.1)],
)
def test_at_the_bound(radius: float, blur: float, snr: int, slope: float) -> None:
    """Errors spread as the bound says and no phase has a bias: 100 balls, chi^2 at 99.9 %."""
    scene = balls(radius, blur, snr, slope=slope)
    found = refine(
        scene.regions, corners(scene.regions), scene.start(), noise=scene.noise, optics=KNOWN
    )
    assert not found.located.flags.any()
    for error, least, u in (
        (found.located.x - scene.x, found.x_bound, found.located.x_u),
        (found.located.y - scene.y, found.y_bound, found.located.y_u),
    ):
        assert 0.77 < np.sqrt(np.mean((error / least) ** 2)) < 1.24
        assert u == pytest.approx(least, rel=0.12)
        by_phase = (error / least).reshape(-1, scene.repeats).mean(axis=1)
        assert np.abs(by_phase).max() < 3.5 / np.sqrt(scene.repeats)


@pytest.mark.parametrize("blur", [0, 2, 30])
def test_no_bias_without_noise(blur: float) -> None:
    """At every phase of a pixel, before a slope too: 0.05 of the brightest ball's bound."""
    for slope in (0.0, 0.5):
        scene = balls(15, blur, 96, slope=slope, phases=8, repeats=1, noisy=False)
        found = refine(
            scene.regions, corners(scene.regions), scene.start(), noise=scene.noise, optics=KNOWN
        )
        assert np.abs(found.located.x - scene.x).max() < 0.05 * found.x_bound.min()
        assert np.abs(found.located.y - scene.y).max() < 0.05 * found.y_bound.min()


def test_free_blur_and_lens() -> None:
    """A blur given 20 % short and a lens given 0.1 px sharp are found; the place costs no more."""
    scene = balls(30, 6, 96)
    start = located(scene.x + 0.3, scene.y, 30.5, (0.8 * scene.blur[0], 0.8 * scene.blur[1] + 0.5))
    optics = Optics(lens=0.7, lens_u=0.3, blur_u=3.0)
    found = refine(scene.regions, corners(scene.regions), start, noise=scene.noise, optics=optics)
    pull = (found.located.blur_x - scene.blur[0]) / found.blur_x_u
    assert abs(pull.mean()) < 0.4
    assert found.lens.mean() == pytest.approx(0.8, abs=0.01)
    assert np.std((found.located.x - scene.x) / found.x_bound) < 1.24


def test_the_start_may_be_far() -> None:
    """A quarter of the radius off in place and a tenth in size, the fit still finds the ball."""
    scene = balls(30, 2, 27)
    start = located(scene.x - 7.5, scene.y + 7.5, 33.0, scene.blur)
    found = refine(scene.regions, corners(scene.regions), start, noise=scene.noise, optics=KNOWN)
    assert np.abs((found.located.x - scene.x) / found.x_bound).max() < 4.5


def test_hot_pixels_do_not_pull() -> None:
    """A hundred of them, as bright as can be: errors stay at the bound."""
    scene = balls(30, 2, 96)
    random = np.random.default_rng(3)
    for region in scene.regions:
        region.flat[random.choice(region.size, 100, replace=False)] = 250.0
    found = refine(
        scene.regions, corners(scene.regions), scene.start(), noise=scene.noise, optics=KNOWN
    )
    assert np.sqrt(np.mean(((found.located.x - scene.x) / found.x_bound) ** 2)) < 1.3


def test_out_of_frame_and_behind_the_bat() -> None:
    """A quarter cut off, or masked: flagged, errors as the bound of what is left, 0.005 px."""
    scene = balls(30, 2, 96)
    end = int(scene.x.max() + 15)
    gone = scene.regions[:, :, :end]
    found = refine(gone, corners(gone), scene.start(), noise=scene.noise, optics=KNOWN)
    assert (found.located.flags == Flag.CLIPPED).all()
    assert np.sqrt(np.mean((found.located.x - scene.x) ** 2)) < 0.005
    mask = np.ones((1, *scene.regions.shape[1:]), bool)
    mask[..., end:] = False
    scene.regions[..., end:] = 120.0
    found = refine(
        scene.regions, corners(gone), scene.start(), noise=scene.noise, optics=KNOWN, mask=mask
    )
    assert (found.located.flags == Flag.OVERLAP).all()
    assert np.sqrt(np.mean((found.located.x - scene.x) ** 2)) < 0.005
    assert found.located.x_u == pytest.approx(found.x_bound, rel=0.1)


def test_saturation_is_flagged_and_does_no_harm() -> None:
    """Full scale well below the ball: the outline's lower part still places it."""
    scene = balls(30, 2, 96)
    noise = Noise(gain=scene.noise.gain, read=scene.noise.read, full_scale=150.0)
    found = refine(
        np.minimum(scene.regions, 150.0),
        corners(scene.regions),
        scene.start(),
        noise=noise,
        optics=KNOWN,
    )
    assert (found.located.flags & Flag.SATURATED).all()
    assert np.sqrt(np.mean((found.located.x - scene.x) ** 2)) < 0.006


def test_no_ball_is_not_found() -> None:
    """Noise alone gives no place, or once in a hundred one with a flag."""
    scene = balls(30, 0, 27, repeats=25)
    empty = np.random.default_rng(2).normal(40.0, 2.0, scene.regions.shape)
    found = refine(empty, corners(empty), scene.start(), noise=noise_of(27), optics=KNOWN)
    lost = found.located.flags == Flag.NOT_FOUND
    assert lost.mean() >= 0.95
    assert (found.located.flags > 0).all()
    assert np.isnan(found.located.x[lost]).all()


def test_a_picture_of_something_else_is_a_poor_fit() -> None:
    """A ball whose half is darker is flagged, and said to be less sure."""
    scene = balls(30, 2, 96)
    cols = np.arange(scene.regions.shape[2])
    scene.regions[:, :, cols < scene.regions.shape[2] / 2] *= 0.8
    found = refine(
        scene.regions, corners(scene.regions), scene.start(), noise=scene.noise, optics=KNOWN
    )
    assert (found.located.flags & Flag.POOR_FIT).all()
    assert (found.located.x_u > 5 * found.x_bound).all()


def test_a_given_background() -> None:
    """Behind a pattern that is known and flickers, errors are at the bound of a flat one."""
    scene = balls(30, 2, 96)
    size = scene.regions.shape[1]
    pattern = 1 + 0.4 * np.sin(np.arange(size) / 5.0) * np.cos(np.arange(size) / 7.0)[:, None]
    regions = []
    random = np.random.default_rng(5)
    for x, y in zip(scene.x, scene.y, strict=True):
        off = (FIELD - size) // 2
        m = disc(FIELD, x + off, y + off, 30, 0.8, scene.blur)[off:-off, off:-off][:size, :size]
        mean = 44.0 * pattern * (1 - m) + 190 * m
        regions.append(mean + random.standard_normal(m.shape) * np.sqrt(scene.noise.variance(mean)))
        if len(regions) == 20:
            break
    given = np.array(regions)
    start = located(scene.x[:20] + 0.3, scene.y[:20], 30.2, scene.blur)
    found = refine(
        given, corners(given), start, noise=scene.noise, optics=KNOWN, background=40 * pattern[None]
    )
    assert not found.located.flags.any()
    assert np.sqrt(np.mean(((found.located.x - scene.x[:20]) / found.x_bound) ** 2)) < 1.5
    assert found.background == pytest.approx(1.1, rel=0.01)


@pytest.mark.parametrize(("radius", "blur"), [(15.0, 0.0), (30.0, 6.0), (15.0, 40.0)])
def test_bound_against_differences_of_exact_images(radius: float, blur: float) -> None:
    """Fisher's information from images a step apart; the variance's own part included."""
    size, noise, step = 160, Noise(gain=0.5, read=2.0), 1e-3
    ball, back = 190.0, 40.0
    rows = (np.arange(size) - size / 2) / size

    def mean(x: float, y: float, r: float) -> Floats:
        m = disc(size, x, y, r, 0.8, (blur, 0.0))
        return back * (1 - m) + ball * m

    at = np.array([80.2, 79.7, radius])
    slopes = [(mean(*(at + d)) - mean(*(at - d))) / (2 * step) for d in step * np.eye(3)]
    m = disc(size, *at, 0.8, (blur, 0.0))
    slopes += [m, 1 - m, (1 - m) * rows, (1 - m) * rows[:, None]]
    v = noise.gain * mean(*at) + noise.read
    weight = 1 / v + 0.5 * (noise.gain / v) ** 2
    fisher = np.einsum("jxy,kxy,xy->jk", slopes, slopes, weight)
    exact = np.sqrt(np.diag(np.linalg.inv(fisher)))
    given = bound(
        (size, size),
        x=at[0],
        y=at[1],
        radius=radius,
        lens=0.8,
        ball=ball,
        background=back,
        noise=noise,
        blur_x=blur,
    )
    assert [given.x[0], given.y[0], given.radius[0]] == pytest.approx(exact[:3], rel=2e-3)
    snr = (ball - back) / np.sqrt(noise.variance((ball + back) / 2))
    if blur < radius:
        assert bound_of_edge(radius=radius, lens=0.8, snr=snr, blur=blur) == pytest.approx(
            exact[0], rel=0.15
        )


def test_cut_and_bad_input() -> None:
    """Regions stay inside the frame; arrays that do not fit say so."""
    frames = np.arange(2 * 40 * 60).reshape(2, 40, 60)
    regions, corner = cut(frames, np.array([30.0, 58.0]), np.array([20.0, 1.0]), 16)
    assert regions.shape == (2, 16, 16)
    assert corner.tolist() == [[22, 12], [44, 0]]
    assert regions[1, 3, 5] == frames[1, 3, 49]
    with pytest.raises(InputError, match="size"):
        cut(frames, np.zeros(2), np.zeros(2), 41)
    scene = balls(15, 0, 27, repeats=1)
    for bad in (
        {"corners": np.zeros((1, 2))},
        {"mask": np.ones((1, 3, 3), bool)},
        {"regions": scene.regions[0]},
    ):
        arguments = {
            "regions": scene.regions,
            "corners": corners(scene.regions),
            "start": scene.start(),
            "noise": scene.noise,
        } | bad
        with pytest.raises(InputError, match="allowed"):
            refine(**arguments)
