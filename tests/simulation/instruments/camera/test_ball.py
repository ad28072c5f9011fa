"""Rendered balls against exact spectra and against sums over a fine raster."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import j1

from virtual_lab.simulation.instruments.camera.ball import Light, axes_of, render_balls
from virtual_lab.simulation.instruments.camera.ball_kernel import _albedo
from virtual_lab.simulation.instruments.camera.spec import BallLook
from virtual_lab.streams import Streams

Array = NDArray[np.float64]
PLAIN = BallLook(albedo=0.9, seam_contrast=0.0)
STITCHED = BallLook(albedo=0.9, seam_contrast=0.6)
MOTIONS = ((0.0, 0.0), (6.0, 1.0), (-20.0, 9.0))
CONTRAST = 8e-4  # largest error, as a share of the contrast of ball and background


def folded_spectrum(centre: Array, motion: Array, radius: float, sigma: float, size: int) -> Array:
    """Return the exact blurred disk at pixel centers, shape (size, size).

    The spectrum is a jinc times a Gaussian, the two sincs of a pixel and the sinc of the motion.
    The picture is periodic, so its spectrum is a sum of lines; it is summed up to three times the
    sampling frequency.
    """
    period = 128 if size < 110 else 256
    lines = np.arange(-3 * period, 3 * period) / period
    fx, fy = np.meshgrid(lines, lines)
    q = np.hypot(fx, fy)
    safe = np.where(q > 0, q, 1.0)
    disc = np.where(q > 0, radius * j1(2 * np.pi * radius * safe) / safe, np.pi * radius**2)
    blur = np.exp(-2 * np.pi**2 * sigma**2 * q**2) * np.sinc(fx) * np.sinc(fy)
    blur = blur * np.sinc(fx * motion[0] + fy * motion[1])
    shift = np.exp(-2j * np.pi * (fx * centre[0] + fy * centre[1]))
    wave = np.exp(2j * np.pi * np.outer(np.arange(size), lines))
    return np.asarray((wave @ (disc * blur * shift / period**2) @ wave.T).real)


@pytest.mark.parametrize(
    ("radius", "sigma", "motion"),
    [
        *((15.0, sigma, motion) for sigma in (0.5, 0.65, 1.2) for motion in MOTIONS),
        (60.0, 0.5, (0.0, 0.0)),
        (60.0, 0.65, (-40.0, 12.0)),
    ],
)
def test_a_plain_ball_has_the_exact_spectrum(
    radius: float, sigma: float, motion: tuple[float, float]
) -> None:
    """Every pixel, at any blur and motion, with the center between pixels."""
    size = 2 * int(radius) + 48
    centre, travel = np.array([size / 2 + 0.31, size / 2 - 0.17]), np.array(motion)
    path = [[centre - travel / 2, centre + travel / 2]]
    ball = render_balls(path, radius, [[0, 0]], (size, size), sigma=sigma, look=PLAIN)
    exact = folded_spectrum(centre, travel, radius, sigma, size)
    assert np.abs(ball.cover[0] - exact).max() < CONTRAST
    assert np.abs(ball.radiance[0] / 0.9 - exact).max() < CONTRAST


def test_the_centre_is_true_at_every_phase() -> None:
    """The centroid of the cover is right to 0.001 px at 16 x 16 phases; the area to 1e-4."""
    steps = np.arange(16) / 16
    centres = 30 + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 1, 2)
    corners = np.zeros((len(centres), 2))
    ball = render_balls(centres, 20.0, corners, (61, 61), sigma=0.6, look=PLAIN)
    cover = ball.cover.astype(float)
    area = cover.sum(axis=(1, 2))
    x = (cover.sum(axis=1) @ np.arange(61)) / area
    y = (cover.sum(axis=2) @ np.arange(61)) / area
    assert np.abs(np.stack([x, y], axis=1) - centres[:, 0]).max() < 1e-3
    assert area == pytest.approx(np.pi * 20.0**2, rel=1e-4)


def raster(
    body: Array, centre: Array, motion: Array, radius: float, sigma: float, light: Light, size: int
) -> Array:
    """Return the radiance of a ball from 24 x 24 samples per pixel, blurred in its spectrum.

    The albedo is the tested one; the picture is computed here.
    """
    fine = 24
    place = (np.arange(size * fine) + 0.5) / fine - 0.5
    x, y = np.meshgrid((place - centre[0]) / radius, (place - centre[1]) / radius)
    inside = x**2 + y**2 < 1
    normal = np.stack([x, y, -np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)[inside]
    neck = STITCHED.neck**2 / np.sqrt(1 - STITCHED.neck**2)
    look = np.array([STITCHED.albedo, STITCHED.seam_contrast, STITCHED.seam_width, neck])
    lit = np.maximum(normal @ np.array(light.toward) + light.softness, 0) / (1 + light.softness)
    painted = np.array([_albedo(*axes, look) for axes in normal @ body.T])
    picture = np.zeros(inside.shape)
    picture[inside] = painted * (light.ambient + (1 - light.ambient) * lit)
    # blur by the square of a pixel, which includes that of a sample
    f = np.fft.fftfreq(size * fine, 1 / fine)
    fx, fy = np.meshgrid(f, f)
    blur = np.exp(-2 * np.pi**2 * sigma**2 * (fx**2 + fy**2)) * np.sinc(fx) * np.sinc(fy)
    blur = blur * np.sinc(fx * motion[0] + fy * motion[1])
    # shift of half a sample, from a sample to the pixel center
    shift = np.exp(-1j * np.pi * (fx + fy) / fine)
    image = np.fft.ifft2(np.fft.fft2(picture) * blur * shift).real
    return np.asarray(image[fine // 2 :: fine, fine // 2 :: fine])


SOFT = Light(ambient=0.5, softness=0.4)
HARD = Light(ambient=0.1, toward=(0.6, 0.0, -0.8))


@pytest.mark.parametrize("light", [SOFT, HARD])
def test_a_stitched_ball_is_the_sum_of_its_samples(light: Light) -> None:
    """Seams and shading are anti-aliased and not displaced; the worst pixel is off by 2e-3."""
    centre, motion, size = np.array([20.3, 19.6]), np.array([3.0, -1.0]), 40
    for seed in range(2):
        body = axes_of(2 * Streams(seed).normal("axes", 3))
        path = [[centre - motion / 2, centre + motion / 2]]
        ball = render_balls(
            path,
            14.0,
            [[0, 0]],
            (size, size),
            sigma=0.6,
            look=STITCHED,
            light=light,
            orientation=body,
        )
        exact = raster(body, centre, motion, 14.0, 0.6, light, size)
        deviation = ball.radiance[0] - exact
        assert np.abs(deviation).max() < 2e-3
        assert np.sqrt((deviation**2).mean()) < 3e-4
        assert exact[12:28, 12:28].std() > 0.02  # contrast of the seams


def test_a_contact_within_the_exposure_is_two_legs() -> None:
    """The picture is the mean of both legs, weighted by their exposures, 0.3 and 0.7."""
    legs = np.array([[20.0, 25.0], [27.0, 26.0], [24.0, 24.0]])
    common = {"sigma": 0.6, "look": PLAIN}
    both = render_balls([legs], 12.0, [[0, 0]], (50, 50), times=[[0, 0.3, 1]], **common)
    each = [render_balls([leg], 12.0, [[0, 0]], (50, 50), **common) for leg in pairwise(legs)]
    mean = 0.3 * each[0].cover + 0.7 * each[1].cover
    assert np.abs(both.cover - mean).max() < 1e-5


def test_a_turning_ball_is_the_mean_of_its_orientations() -> None:
    """A fifth of a turn per frame against the mean of 64 balls at rest."""
    turn = np.array([0.2, -1.1, 0.4])
    body = axes_of([0.3, 0.5, -0.2])
    args = ([[[25.0, 25.0]]], 18.0, [[0, 0]], (50, 50))
    common = {"sigma": 0.6, "look": STITCHED}
    turned = render_balls(*args, orientation=body, turn=turn, **common).radiance
    parts = [
        render_balls(*args, orientation=body @ axes_of((k / 64 - 63 / 128) * turn), **common)
        for k in range(64)
    ]
    mean = np.mean([part.radiance for part in parts], axis=0)
    still = render_balls(*args, orientation=body, **common).radiance
    assert np.abs(turned - mean).max() < 0.005
    assert np.abs(still - mean).max() > 0.1


def test_regions_are_windows_on_one_frame() -> None:
    """A ball half outside its region is the same ball, clipped."""
    path = [[[31.2, 40.7], [33.0, 40.0]]]
    common = {"sigma": 0.6, "look": STITCHED}
    whole = render_balls(path, 15.0, [[0, 0]], (80, 80), **common)
    part = render_balls(path, 15.0, [[30, 35]], (20, 24), **common)
    assert np.array_equal(part.radiance[0], whole.radiance[0, 35:55, 30:54])


def test_an_outline_may_be_an_ellipse() -> None:
    """A disk is sheared: area and second moments, less the blur, are those of an ellipse."""
    warp = np.zeros((1, 2, 5))
    warp[0, :, :2] = [[20.0, 3.0], [-1.0, 16.0]]
    ball = render_balls([[[40.0, 40.0]]], 1.0, [[0, 0]], (81, 81), sigma=0.6, look=PLAIN, warp=warp)
    cover = ball.cover[0].astype(float)
    offset = np.arange(81) - 40
    area = cover.sum()
    assert area == pytest.approx(np.pi * (20 * 16 + 3), rel=1e-4)
    moments = [
        (cover.sum(axis=0) @ offset**2) / area,
        (cover.sum(axis=1) @ offset**2) / area,
        offset @ cover @ offset / area,
    ]
    blur = 0.6**2 + 1 / 12
    wanted = [(20**2 + 3**2) / 4 + blur, (16**2 + 1) / 4 + blur, (-20 + 3 * 16) / 4]
    assert moments == pytest.approx(wanted, rel=1e-3)


def test_a_sharper_lens_than_can_be_rendered_is_refused() -> None:
    """The smallest blur is half a pixel; below it, the sampling grid would be visible."""
    with pytest.raises(ValueError, match=r"0\.5 to 3"):
        render_balls([[[5.0, 5.0]]], 3.0, [[0, 0]], (10, 10), sigma=0.3, look=PLAIN)
