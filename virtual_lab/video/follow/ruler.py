"""Metres of a pixel: by a length in the picture, by the ball's size, or by gravity.

A length in the picture comes first. Of the ball's size and gravity the one of smaller stated u is
the ruler, and the other checks it.

**The ball's size** is that of its roundest pictures; in its u stand the diameter's, its edge's
width, and the shade on it (`find.outline`).

**Gravity** pulls by g T²/a metres a pixel, where a [px/frame²] is fitted to all flights together
with drag and a perspective, and T is the time of a frame. It rests on a camera that is level, and
square to the flight, to θ = 5° (`LEVEL_U`), on air and on the place:

* The perspective of a camera that looks up or down by θ, tan θ/f by its focal length, bends a
  flight as more or less g would: by 2 tan θ/f (v²/a + y) of it, some per cent at 5°. So the fit
  has the perspective as a parameter, known to that before.
* Lengths along the tilt look shorter by cos θ, and so does g: a length across reads 1/cos θ - 1
  too long by it, .4 % at 5°. All of it is u.
* Air bears the ball and is moved by it: it falls with g (1 - 3/2 ρ/ρ_b). Drag takes k v² with
  k = 3/8 C_d ρ/(ρ_b r), so that the fitted k shows ρ/ρ_b: a baseball's g lacks .2 %, a tennis
  ball's .5 %. All of it is a limit, u its share.
* g is 9.78 to 9.83 m/s² over the Earth; `--gravity` says which, and then it is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.units import DEGREE
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.follow.joint import Fit, estimate_of
from virtual_lab.video.follow.known import BALL, GIVEN, GRAVITY, ClipKnowledge
from virtual_lab.video.follow.models import EVEN_SHARE, FittedFlights
from virtual_lab.video.follow.pieces import Piece

SAID = {
    GIVEN: "the length given",
    BALL: "the ball's size",
    GRAVITY: "gravity",
    "camera": "the calibrated camera",
}
LEVEL_U = 5 * DEGREE  # of the camera, off level and off square to the flight


@dataclass(frozen=True, slots=True, kw_only=True)
class RulerSettings:
    """What u a ruler has beside its pictures', and when it is none."""

    roundest: float = 0.34  # of the places: those with the least blur show the ball's size
    focal: float = 0.8  # length over the picture's longer side, of a phone: a shorter tilts more
    steepest: float = 2.0  # LEVEL_U: a perspective that is fitted larger is no level camera's
    drag_coefficient: float = 0.45  # of a ball
    vague: float = 0.25  # of a length: more says nothing


RULER = RulerSettings()
TILT_U = float(np.tan(LEVEL_U)) / RULER.focal  # of a perspective over the picture's longer side


@dataclass(frozen=True, slots=True, kw_only=True)
class Ruler(PixelScale):
    """A scale by which speeds of a fit become metres a second."""

    fall: float | None = None  # g [m/frame²], of gravity's
    rest_u: float  # relative u beside what the fit's own parameters leave open

    def unit(self, fit: Fit) -> float:
        """Return the metres of a pixel by a fit."""
        if self.fall is None:
            return self.metres_per_pixel
        return self.fall / float(np.hypot(*fit.pull[0]))


def off_u(one: PixelScale, other: PixelScale) -> float:
    """Return how much larger another scale is, in the u of both: of their ratio's logarithm."""
    apart = float(np.log(other.metres_per_pixel / one.metres_per_pixel))
    return apart / float(np.hypot(one.relative_u, other.relative_u))


def level_tilt(tilt: float) -> bool:
    """Return whether a perspective over the picture's longer side is a level camera's."""
    return tilt <= RULER.steepest * TILT_U


def rulers_of(
    known: ClipKnowledge,
    blobs: Blobs,
    fit: Fit | None,
    level: FittedFlights | None,
    ways: Sequence[Piece],
    longer_side: int,
    step: float,
    where: str,
    *,
    mended: bool,
) -> list[Ruler]:
    """Return the rulers that there are, first the one to be used.

    Parameters
    ----------
    blobs
        The ball's, `find.blobs.BLOB`.
    fit
        Of its flights, None: it does not fly.
    level
        The same before a camera that is level to `LEVEL_U`.
    longer_side
        Of the picture [pixels].
    step
        Seconds of a frame.
    mended
        Whether lost frames were found by the motion itself: gravity, in which time enters squared,
        then comes after the ball's size.
    where
        The clip, for an `InputError`: gravity was asked for, and shows nowhere.
    """
    given = ball = gravity = None
    if known.metres_per_pixel:
        relative = known.metres_per_pixel_u / known.metres_per_pixel
        given = Ruler(
            metres_per_pixel=known.metres_per_pixel,
            relative_u=relative,
            source=GIVEN,
            rest_u=relative,
        )
    if known.ball and len(blobs):
        ball = _by_ball(blobs, known.ball, known.ball_u, fit)
    if level and level_tilt(float(np.hypot(*level.fit.tilt)) * longer_side):
        radius = float(np.median([each.radius for each in ways]))
        gravity = _by_gravity(level, radius, known.gravity, known.gravity_u, step)
    if known.ruler == GRAVITY and not gravity:
        allowed = (
            "no flight shows gravity to a quarter, or the camera is tilted by 10 degrees and more: "
            "give --ball or --scale"
        )
        raise InputError(where, "--ruler", GRAVITY, allowed)
    found = sorted(
        (each for each in (ball, gravity) if each),
        key=lambda each: (mended and each is gravity, each.relative_u),
    )
    found.sort(key=lambda each: each.source != known.ruler)
    return [*([given] if given else []), *found]


def _by_ball(blobs: Blobs, diameter: float, diameter_u: float, fit: Fit | None) -> Ruler | None:
    """Return the ruler of a ball's size in its roundest pictures, None where none shows it.

    Blur draws an outline out by as much as it narrows it at half of the contrast, or little more:
    the mean of the axes is not biased. A perspective makes balls larger or smaller than in the
    middle of the picture, where the scale is taken.
    """
    some = blobs[np.isfinite(blobs["radius_u"])]
    if not len(some):
        return None
    ratio, size = some["length"] / some["radius"], (some["radius"] + some["length"]) / 2
    if fit:
        size = size / (1 - (np.stack([some["x"], some["y"]], axis=1) - fit.centre) @ fit.tilt)
    round_ = ratio <= np.quantile(ratio, RULER.roundest)
    radius = float(np.median(size[round_]))
    scatter = 1.4826 * float(np.median(np.abs(size[round_] - radius)))
    edge, shade = (float(np.median(some[name][round_])) for name in ("radius_u", "shade_u"))
    own = [diameter_u / diameter, edge / radius, shade / radius, 0.5 * scatter / radius]
    relative = float(np.linalg.norm(own))
    return Ruler(
        metres_per_pixel=diameter / (2 * radius), relative_u=relative, source=BALL, rest_u=relative
    )


def _by_gravity(
    level: FittedFlights, radius: float, gravity: float, gravity_u: float, step: float
) -> Ruler | None:
    """Return gravity's ruler, None where flights show too little of it; `radius` in pixels."""
    if not level.fit.pull.any():
        return None
    air = 8 / 3 / RULER.drag_coefficient * level.fit.drag * radius  # its density over the ball's
    rest = [gravity_u / gravity, 1 / np.cos(LEVEL_U) - 1, 1.5 * air * EVEN_SHARE]
    rest_u = float(np.linalg.norm(rest))
    fall = gravity * step**2
    found = estimate_of(
        lambda f: fall / float(np.hypot(*f.pull[0])),
        level.fit,
        [*level.others, *level.longest],
        relative_u=rest_u,
    )
    relative = found.u / found.value
    if relative > RULER.vague:
        return None
    return Ruler(
        metres_per_pixel=found.value,
        relative_u=relative,
        source=GRAVITY,
        fall=fall,
        rest_u=rest_u,
    )
