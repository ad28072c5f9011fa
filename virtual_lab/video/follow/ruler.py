"""The scale [m/pixel] from a length in the picture, from the ball's size, or from gravity.

Each source of the scale is called a ruler. A stated length in the picture has priority. Otherwise
the ruler is the ball's size or gravity, whichever has the smaller u; the other one is compared with
it.

**The ball's size** is measured in its roundest pictures. Its u includes the u of the diameter, the
width of the edge, and the shade on the ball.

**Gravity** gives a scale of g T²/a [m/pixel]. The acceleration a [px/frame²] is fitted to all
flights, together with drag and a perspective, and T is the frame time. The u depends on the angle θ
of the camera off level, and off square to the flight, on the air, and on the location. The u of θ
is 2.5° (`knowledge.LEVEL_U`), or 0.5° with `--level`.

* A camera that looks up or down by θ has a perspective tan θ/f, with the focal length f. It bends a
  flight like a change of g by the fraction 2 tan θ/f (v²/a + y), a few percent at 5°. The
  perspective is therefore a parameter of the fit, with this u as prior knowledge (`follow.joint`).
* Lengths along the tilt, and so g, look shorter by the factor cos θ. A horizontal length is then
  measured too long by the share 1/cos θ - 1, which is 0.1 % at 2.5°. This whole share is u.
* Because of buoyancy and the moved air, the ball falls with g (1 - 3/2 ρ/ρ_b). The drag is k v²
  with k = 3/8 C_d ρ/(ρ_b r), so ρ/ρ_b follows from the fitted k. The reduction of g is 0.2 % for a
  baseball and 0.5 % for a tennis ball. It is the limit of a uniform distribution, from which u
  follows.
* g is 9.78 to 9.83 m/s² on the Earth; with `--gravity` it is known.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.follow.joint import Fit, estimate_of
from virtual_lab.video.follow.knowledge import BALL, GIVEN, GRAVITY, ClipKnowledge
from virtual_lab.video.follow.models import FittedFlights

SAID = {GIVEN: "the length given", BALL: "the ball's size", GRAVITY: "gravity"}
SAID |= {"camera": "the calibrated camera"}


# share of the positions, those with the least blur, that are used for the size of the ball
ROUNDEST = 0.34
# relative u of the size per relative width of the edge, and per relative difference of the axes of
# a ball lit from the side. In synthetic clips with even, soft and hard light the measured size is
# 1 to 4, 5 to 7 and 30 to 40 % too small.
EDGE_U, OVAL_U = 0.14, 0.6
# radius of a small ball [pixels]. The sixth power of its ratio to a ball's radius is the relative
# u. Blur reduces the contrast of a small ball, so its outline at half of the contrast is outside
# the ball: in H.264, balls with a radius of 5 pixels are measured 10 to 28 % too large, unlike
# balls of 8.5 pixels.
SMALL = 4.6
DRAG_COEFFICIENT = 0.45  # drag coefficient of a ball
# largest relative u of a length, and largest u of a restitution, with which they are stated
VAGUE = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Ruler(PixelScale):
    """A scale that converts speeds of a fit to meters per second."""

    fall: float | None = None  # g [m/frame²] if gravity is the ruler, otherwise None
    rest_u: float  # relative u that is not part of the u of the fit's parameters

    @classmethod
    def of(cls, scale: PixelScale, knowledge: ClipKnowledge) -> Ruler:
        """Return the ruler of a scale that does not come from gravity.

        The relative u of speeds combines the u of the scale and of the frame rate. A frame rate
        from gravity is proportional to 1/√length, so speeds are proportional to √length. Their
        relative u is then that of the rate, half the relative u of length and fitted acceleration.
        """
        length_u = 0.0 if knowledge.rate_of == GRAVITY else scale.relative_u
        values = {each.name: getattr(scale, each.name) for each in fields(PixelScale)}
        return cls(**values, rest_u=float(np.hypot(length_u, knowledge.rate_u)))

    def unit(self, fit: Fit) -> Any:
        """Return the scale [m/pixel]. It depends on the fit only if gravity is the ruler."""
        return self.fall / fit.size if self.fall else self.metres_per_pixel


def off_u(one: PixelScale, other: PixelScale) -> float:
    """Return the log ratio of two scales, ln(other / one), in units of its standard uncertainty.

    The standard uncertainty combines the relative standard uncertainties of both scales.
    """
    apart = float(np.log(other.metres_per_pixel / one.metres_per_pixel))
    return apart / float(np.hypot(one.relative_u, other.relative_u))


def rulers_of(
    knowledge: ClipKnowledge, blobs: Blobs, model: FittedFlights | None, step: float, where: str
) -> list[Ruler]:
    """Return the available rulers (sources of the scale), the preferred one first.

    A stated scale is preferred, then the requested ruler, then the ruler with the smallest u. The
    list is empty if there is no ruler.

    Parameters
    ----------
    knowledge
        Stated scale, ball size and g, and the requested ruler.
    blobs
        Blobs of the ball, an array of `find.blobs.BLOB`.
    model
        Flights of the ball and their fit; None without flights.
    step
        Duration of a time step [s].
    where
        Name of the clip in an error message.

    Raises
    ------
    InputError
        Gravity was requested, but no flight measures it to 25 %, the camera is tilted by 10 degrees
        or more, or g was already used for the frame rate.
    """
    rulers = []
    if knowledge.ball and len(blobs):
        ball = _by_ball(blobs, knowledge.ball, knowledge.ball_u, model.fit if model else None)
        rulers.append(Ruler.of(ball, knowledge))
    if model and not model.tilted and knowledge.rate_of != GRAVITY:
        by_gravity = _by_gravity(model, knowledge, step)
        rulers += [by_gravity] if by_gravity else []
    if knowledge.ruler == GRAVITY and not any(each.source == GRAVITY for each in rulers):
        why = "no flight measures gravity to 25 %, or the camera is tilted"
        cure = "give {ball}, and {fps} if the clip is in slow motion"
        raise InputError(where, "{ruler}", GRAVITY, f"{why}; {cure}")
    rulers.sort(key=lambda each: (each.source != knowledge.ruler, each.relative_u))
    if unit := knowledge.metres_per_pixel:
        relative = knowledge.metres_per_pixel_u / unit
        scale = PixelScale(metres_per_pixel=unit, relative_u=relative, source=GIVEN)
        rulers.insert(0, Ruler.of(scale, knowledge))
    return rulers


def _by_ball(blobs: Blobs, diameter: float, diameter_u: float, fit: Fit | None) -> PixelScale:
    """Return the scale from the ball's size in its roundest pictures.

    At half of the contrast, blur lengthens a hull by about as much as it narrows it, so the mean of
    the axes has no bias. Shade widens the edge or makes the picture less circular, and the ball is
    then measured too small by a share of this deviation. Because of the perspective, a ball looks
    larger or smaller than in the middle of the picture, to which the scale refers.
    """
    ratio, size = blobs["length"] / blobs["radius"], (blobs["radius"] + blobs["length"]) / 2
    if fit:
        size = size / (1 - (np.stack([blobs["x"], blobs["y"]], axis=1) - fit.centre) @ fit.tilt)
    round_ = ratio <= np.quantile(ratio, ROUNDEST)
    radius = float(np.median(size[round_]))
    scatter = 1.4826 * float(np.median(np.abs(size[round_] - radius)))
    edge = EDGE_U * float(np.median(blobs["edge"][round_])) / radius
    oval = OVAL_U * (float(np.median(ratio[round_])) - 1)
    small = min((SMALL / radius) ** 6, VAGUE)
    scattered = 0.5 * scatter / radius
    relative = float(np.linalg.norm([diameter_u / diameter, edge, oval, small, scattered]))
    return PixelScale(metres_per_pixel=diameter / (2 * radius), relative_u=relative, source=BALL)


def _by_gravity(model: FittedFlights, knowledge: ClipKnowledge, step: float) -> Ruler | None:
    """Return the ruler from gravity; None if g is not fitted or hardly visible."""
    if not model.fit.covariance[0, 0]:
        return None
    radius = float(np.median([each.radius for each in model.ways]))
    # ratio of the density of the air to that of the ball
    air = 8 / 3 / DRAG_COEFFICIENT * model.fit.drag * radius
    tilt = 1 / np.cos(knowledge.level_u) - 1
    rest = [knowledge.gravity_u / knowledge.gravity, tilt, 1.5 * air / np.sqrt(3)]
    rest_u = float(np.linalg.norm(rest))
    fall = knowledge.gravity * step**2
    length = estimate_of(lambda fit: fall / fit.size, model.fit, model.rest, relative_u=rest_u)
    scale, u = length.value, length.u / length.value
    if u > VAGUE:
        return None
    return Ruler(metres_per_pixel=scale, relative_u=u, source=GRAVITY, fall=fall, rest_u=rest_u)
