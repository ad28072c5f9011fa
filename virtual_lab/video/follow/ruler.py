"""Metres of a pixel: by a length in the picture, by the ball's size, or by gravity.

A length in the picture comes first. Of the ball's size and gravity the one of smaller stated u is
the ruler, and the other checks it.

**The ball's size** is that of its roundest pictures; in its u stand the diameter's, its edge's
width, and the shade on it.

**Gravity** pulls by g T²/a metres a pixel, where a [px/frame²] is fitted to all flights together
with drag and a perspective, and T is the time of a frame. It rests on a camera that is level, and
square to the flight, to θ = 2.5° (`known.LEVEL_U`; .5° with `--level`), on air and on the place:

* The perspective of a camera that looks up or down by θ, tan θ/f by its focal length, bends a
  flight as more or less g would: by 2 tan θ/f (v²/a + y) of it, some per cent at 5°. So the fit
  has the perspective as a parameter, known to that before (`follow.joint`).
* Lengths along the tilt look shorter by cos θ, and so does g: a length across reads 1/cos θ - 1
  too long by it, .1 % at 2.5°. All of it is u.
* Air bears the ball and is moved by it: it falls with g (1 - 3/2 ρ/ρ_b). Drag takes k v² with
  k = 3/8 C_d ρ/(ρ_b r), so that the fitted k shows ρ/ρ_b: a baseball's g lacks .2 %, a tennis
  ball's .5 %. All of it is a limit, u its share.
* g is 9.78 to 9.83 m/s² over the Earth; `--gravity` says which, and then it is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.follow.joint import Fit, estimate_of
from virtual_lab.video.follow.knowledge import BALL, GIVEN, GRAVITY, ClipKnowledge
from virtual_lab.video.follow.models import EVEN_SHARE, FittedFlights
from virtual_lab.video.follow.pieces import Piece

SAID = {
    GIVEN: "the length given",
    BALL: "the ball's size",
    GRAVITY: "gravity",
    "camera": "the calibrated camera",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RulerSettings:
    """Uncertainties of a ruler beside its pictures', and thresholds beyond which it is none."""

    # share of the places, those with the least blur, that show the ball's size
    roundest: float = 0.34
    # relative u of the size per relative width of the edge, and per relative difference of the
    # axes, as in a ball lit from the side: synthetic clips in even, soft and hard light read 1 to
    # 4, 5 to 7 and 30 to 40 % too small
    edge_u: float = 0.14
    oval_u: float = 0.6
    # radius of a small ball [pixels]. The sixth power of its ratio to a ball's radius is the
    # relative u. The outline at half of the contrast that blur leaves of a small ball is outside
    # the ball: in H.264 balls of 5 pixels read 10 to 28 % too large, balls of 8.5 pixels do not
    small: float = 4.6
    drag_coefficient: float = 0.45  # drag coefficient of a ball
    # largest relative u of a length, and largest u of a restitution, that is stated
    vague: float = 0.25


RULER = RulerSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Ruler(PixelScale):
    """A scale that converts speeds of a fit to metres per second."""

    fall: float | None = None  # g of a ruler by gravity [m/frame²]; None: another ruler
    rest_u: float  # relative u that the u of the fit's own parameters does not cover

    @classmethod
    def of_plane(cls, plane: PixelScale, rate_u: float) -> Ruler:
        """Return the ruler of a calibrated plane; `rate_u`: relative u of the frame rate."""
        return cls(
            metres_per_pixel=plane.metres_per_pixel,
            relative_u=plane.relative_u,
            source=plane.source,
            rest_u=float(np.hypot(plane.relative_u, rate_u)),
        )

    def unit(self, fit: Fit) -> float:
        """Return the scale [m/pixel]. Only that of a ruler by gravity depends on the fit."""
        if self.fall is None:
            return self.metres_per_pixel
        return self.fall / fit.size


def off_u(one: PixelScale, other: PixelScale) -> float:
    """Return ln(`other` / `one`) of two scales, divided by its standard uncertainty."""
    apart = float(np.log(other.metres_per_pixel / one.metres_per_pixel))
    return apart / float(np.hypot(one.relative_u, other.relative_u))


def rulers_of(
    knowledge: ClipKnowledge,
    blobs: Blobs,
    model: FittedFlights | None,
    ways: Sequence[Piece],
    step: float,
    where: str,
) -> list[Ruler]:
    """Return the available rulers, of which the first one is used; none if nothing sets the scale.

    A given scale is first, then the requested ruler, then the one with the smallest u.

    Parameters
    ----------
    blobs
        Blobs of the ball, `find.blobs.BLOB`.
    model
        Fit of the ball's flights; None: it does not fly.
    step
        Duration of a frame [s].
    where
        Name of the clip for an `InputError`, raised if gravity was requested but shows nowhere.
    """
    rulers = []
    if knowledge.ball and len(blobs):
        ball = _by_ball(blobs, knowledge.ball, knowledge.ball_u, model.fit if model else None)
        rulers.append(_with_rate(ball, knowledge))
    if model and not model.tilted and knowledge.rate_of != GRAVITY:
        radius = float(np.median([each.radius for each in ways]))
        by_gravity = _by_gravity(model, radius, knowledge, step)
        rulers += [by_gravity] if by_gravity else []
    if knowledge.ruler == GRAVITY and not any(each.source == GRAVITY for each in rulers):
        allowed = (
            "no flight measures gravity to 25 %, or the camera is tilted by 10 degrees or more; "
            "give --ball or --scale"
        )
        raise InputError(where, "--ruler", GRAVITY, allowed)
    rulers.sort(key=lambda each: each.relative_u)
    rulers.sort(key=lambda each: each.source != knowledge.ruler)
    if knowledge.metres_per_pixel:
        relative = knowledge.metres_per_pixel_u / knowledge.metres_per_pixel
        scale = PixelScale(
            metres_per_pixel=knowledge.metres_per_pixel, relative_u=relative, source=GIVEN
        )
        rulers.insert(0, _with_rate(Ruler.of_plane(scale, 0.0), knowledge))
    return rulers


def _with_rate(ruler: Ruler, knowledge: ClipKnowledge) -> Ruler:
    """Return the ruler with the u of the frame rate in that of speeds.

    A rate by gravity goes with 1/√(a length), so that speeds go with its root: the rate's u, half
    of the length's and of the fitted pull's, is all of theirs.
    """
    whole = knowledge.rate_of == GRAVITY
    return replace(ruler, rest_u=float(np.hypot(0.0 if whole else ruler.rest_u, knowledge.rate_u)))


def _by_ball(blobs: Blobs, diameter: float, diameter_u: float, fit: Fit | None) -> Ruler:
    """Return the ruler by a ball's size in its roundest pictures.

    Blur draws a hull out by as much as it narrows it at half of the contrast, or little more: the
    mean of the axes is not biased. Shade makes the edge wide or the picture no circle, and the ball
    then reads too small by a share of that. A perspective makes balls larger or smaller than in the
    middle of the picture, where the scale is taken.
    """
    ratio, size = blobs["length"] / blobs["radius"], (blobs["radius"] + blobs["length"]) / 2
    if fit:
        size = size / (1 - (np.stack([blobs["x"], blobs["y"]], axis=1) - fit.centre) @ fit.tilt)
    round_ = ratio <= np.quantile(ratio, RULER.roundest)
    radius = float(np.median(size[round_]))
    scatter = 1.4826 * float(np.median(np.abs(size[round_] - radius)))
    edge = RULER.edge_u * float(np.median(blobs["edge"][round_])) / radius
    oval = RULER.oval_u * (float(np.median(ratio[round_])) - 1)
    small = min((RULER.small / radius) ** 6, RULER.vague)
    scattered = 0.5 * scatter / radius
    relative = float(np.linalg.norm([diameter_u / diameter, edge, oval, small, scattered]))
    return Ruler(
        metres_per_pixel=diameter / (2 * radius), relative_u=relative, source=BALL, rest_u=relative
    )


def _by_gravity(
    model: FittedFlights, radius: float, knowledge: ClipKnowledge, step: float
) -> Ruler | None:
    """Return the ruler by gravity, None if not fitted or hardly visible; `radius` in pixels."""
    if not model.fit.covariance[0, 0]:
        return None
    # ratio of the air's density to the ball's
    air = 8 / 3 / RULER.drag_coefficient * model.fit.drag * radius
    tilt = 1 / np.cos(knowledge.level_u) - 1
    rest = [knowledge.gravity_u / knowledge.gravity, tilt, 1.5 * air * EVEN_SHARE]
    rest_u = float(np.linalg.norm(rest))
    fall = knowledge.gravity * step**2
    length = estimate_of(
        lambda f: fall / f.size,
        model.fit,
        [*model.rest, *model.longest],
        relative_u=rest_u,
    )
    relative = length.u / length.value
    if relative > RULER.vague:
        return None
    return Ruler(
        metres_per_pixel=length.value,
        relative_u=relative,
        source=GRAVITY,
        fall=fall,
        rest_u=rest_u,
    )
