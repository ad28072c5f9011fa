"""The disc's closed form against its exact spectrum, its derivatives against differences."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from tests.video.spectrum import disc
from virtual_lab.video.locate.plain_ball.disc import disc_image, share

SIZE = 128


@pytest.mark.parametrize("lens", [0.5, 0.8, 1.5])
@pytest.mark.parametrize(("radius", "blur"), [(15, 0), (15, 2), (30, 6), (15, 40), (20, 11)])
def test_against_the_spectrum(lens: float, radius: float, blur: float) -> None:
    """Within 5e-4 of the contrast for a sharp lens, 2e-4 for others, at any place and heading."""
    for x, y, heading in [(60.0, 64.5, 0.0), (63.3, 61.8, 0.7), (64.9, 62.1, 2.4)]:
        way = (blur * cos(heading), blur * sin(heading))
        found = disc_image((SIZE, SIZE), x=x, y=y, radius=radius, lens=lens, blur=way)
        exact = disc(SIZE, x, y, radius, lens, way)
        assert np.abs(found - exact).max() < (5e-4 if lens < 0.6 else 2e-4)
        assert found.sum() == pytest.approx(pi * radius**2, rel=1e-4)


def test_a_point_far_from_the_edge_is_whole() -> None:
    """All ball in the middle, all background at the corner."""
    image = disc_image((SIZE, SIZE), x=64.0, y=64.0, radius=30.0, lens=0.8, blur=(6.0, 0.0))
    assert image[64, 64] == 1.0
    assert image[0, 0] == 0.0


@pytest.mark.parametrize("along", [0.0, 0.5, 6.0, 50.0])
def test_derivatives(along: float) -> None:
    """Each is the change of the share as its parameter changes."""
    step, s, radius, heading = 1e-4, sqrt(0.8**2 + 1 / 12), 20.0, 0.4
    way = along * np.array([cos(heading), sin(heading)])

    def m(change: np.ndarray) -> float:
        x0, y0, more, wx, wy, wider = change
        wx, wy = way[0] + wx, way[1] + wy
        length = float(np.hypot(wx, wy))
        direction = (wx / length, wy / length) if length else (1.0, 0.0)
        return share(x - x0, y - y0, radius + more, length, *direction, s + wider)[0]

    for angle in np.linspace(0, 2 * pi, 9):
        x, y = 20.3 * cos(angle) + 0.3 * way[0], 20.3 * sin(angle) + 0.3 * way[1]
        given = share(x, y, radius, along, cos(heading), sin(heading), s)
        for k in range(6):
            if along == 0 and k in (3, 4):
                continue  # even in the way
            ahead = np.zeros(6)
            ahead[k] = step
            change = (m(ahead) - m(-ahead)) / (2 * step)
            assert given[1 + k] == pytest.approx(change, abs=3e-3)
