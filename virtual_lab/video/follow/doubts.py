"""Doubts about a clip's flights: by its rulers, frames, camera, and other moving things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.contacts import Contact
from virtual_lab.video.follow.flights import beside, explained_share
from virtual_lab.video.follow.knowledge import BALL, GIVEN, GRAVITY, ClipKnowledge, Note
from virtual_lab.video.follow.models import FittedFlights
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.ruler import SAID, Ruler, off_u
from virtual_lab.video.follow.scene import FlightScene


@dataclass(frozen=True, slots=True, kw_only=True)
class DoubtSettings:
    """Limits beyond which a difference is flagged."""

    # motion per frame [ball radii]: a ball that moves less may look the same in two frames
    moved: float = 0.1
    drift_matters: float = 0.002  # largest hidden drift of the camera [share of a flight's speed]
    # difference from g, or between two rulers, that is allowed: in standard uncertainties, and as a
    # share; the larger one counts
    apart: tuple[float, float] = (3.0, 0.04)
    explained: float = 0.9  # share of a moving ball's frames that flights span, at least
    # acceleration beyond which the frame rate must be wrong [g]: no ball's size is so far off
    absurd: float = 3.0


FALLS = DoubtSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Falls:
    """Fall of the flights, measured by a ruler other than gravity."""

    knowledge: ClipKnowledge
    shared: Estimate  # acceleration that all flights share [m/s²]
    scale: Ruler

    @property
    def rate(self) -> float:
        """The frame rate at which flights fall with g [1/s]."""
        return self.knowledge.rate * float(np.sqrt(self.knowledge.gravity / self.shared.value))

    @property
    def rate_u(self) -> float:
        """Relative u of `rate`: half that of the acceleration, which includes the length's."""
        return self.shared.u / self.shared.value / 2

    def with_fitted_rate(self) -> ClipKnowledge:
        """Return the knowledge of the clip with `rate` from gravity, which is then no ruler."""
        return replace(
            self.knowledge, rate=self.rate, rate_u=self.rate_u, rate_of=GRAVITY, ruler=BALL
        )

    def of_rate(self) -> Note:
        """Note of a rate that was fitted."""
        words = (
            f"no frame rate is given: by the file's own, {self.knowledge.rate:.4g} a second, and "
            f"{SAID[self.scale.source]} the ball would fall with {self.shared.value:.3g} m/s²; "
            f"{with_uncertainty(self.rate, self.rate * self.rate_u)} a second make that "
            f"{self.knowledge.gravity:.3g}, and are taken, if that length is right "
            "(--fps says better)"
        )
        return "RATE_FITTED", words

    def require_rate(self, where: str) -> None:
        """Raise `InputError` where balls fall so fast that the frame rate must be another."""
        least = self.shared.value - FALLS.apart[0] * self.shared.u
        if least > FALLS.absurd * self.knowledge.gravity:
            allowed = (
                f"by {SAID[self.scale.source]} the ball would fall with {self.shared.value:.4g} "
                f"m/s²; --fps {self.rate:.3g} makes that {self.knowledge.gravity:.3g}"
            )
            raise InputError(where, "frames per second", f"{self.knowledge.rate:.6g}", allowed)

    def against(self) -> list[Note]:
        """Return notes against length and frame rate, if the flights do not fall with g."""
        g, (coverage, share) = self.knowledge.gravity, FALLS.apart
        if abs(self.shared.value - g) <= max(coverage * self.shared.u, share * g):
            return []
        words = (
            f"by {SAID[self.scale.source]} the ball falls with {self.shared.value:.3g} m/s², not "
            f"{g:.3g}: that length is wrong, or the frame rate and with it every speed (slow "
            f"motion declares the rate it plays at; --fps {self.rate:.3g} would fit)"
        )
        return [("GRAVITY", words)]


def against_size(rulers: Sequence[Ruler]) -> list[Note]:
    """Return notes against a ball's size, if another length is given that contradicts it."""
    by = {each.source: each for each in rulers}
    if not {GIVEN, BALL} <= set(by):
        return []
    length, ball = by[GIVEN], by[BALL]
    ratio, apart = length.metres_per_pixel / ball.metres_per_pixel, abs(off_u(length, ball))
    coverage, share = FALLS.apart
    if apart < coverage or abs(ratio - 1) < share:
        return []
    words = (
        f"by the length given the ball is {ratio:.3g} times as large as --ball says ({apart:.2g} "
        "standard uncertainties off): one of the two is wrong"
    )
    return [("BALL_SIZE", words)]


def against_flights(
    scene: FlightScene, watched: Watched, pieces: Sequence[Piece], ways: Sequence[Piece]
) -> list[Note]:
    """Return notes on a second ball, leaps of the background, and frames left out."""
    if not ways:
        return []
    notes = []
    if more := beside(scene, ways, pieces):
        first = min(int(each.frames[0]) for each in more)
        words = (
            f"another ball flies beside the one followed, from frame {first} on: --ball-at says "
            "which is meant; where they are alike flights may be mixed up"
        )
        notes.append(("SECOND_BALL", words))
    share = explained_share(scene, ways, pieces)
    if share < FALLS.explained and ways[0].u is None:  # near a bat sharp places are left out
        words = (
            f"flights explain {100 * share:.0f} % of the frames in which the ball is seen to move: "
            "in the others it is carried, rolls or is struck, or a flight was missed"
        )
        notes.append(("UNEXPLAINED", words))
    frames = np.concatenate([way.frames for way in ways])
    leaps = {k: by for k, by in watched.leaps.items() if frames.min() < k <= frames.max()}
    if leaps:
        words = (
            f"the background leaps by {max(leaps.values()):.2g} pixels (before frame "
            f"{min(leaps)}): the camera's drift was lost there, and flights about it may be "
            "bent or broken; --tripod says that the camera stands"
        )
        notes.append(("DRIFT_LEAPS", words))
    if watched.interlaced:
        words = (
            "each frame holds two fields of different moments (interlaced), so a moving ball is "
            "seen between them: one frame per field is better, e.g. ffmpeg -i CLIP -vf bwdif=1 "
            "NEW, with twice the rate"
        )
        notes.append(("INTERLACED", words))
    if lost := scene.lost(ways):
        where = ", ".join(f"{n} before frame {frame}" for frame, n in sorted(lost.items())[:6])
        words = f"frames are missing though time stamps are even ({where}): time was mended"
        notes.append(("LOST_FRAMES", words))
    return notes


def without_flight(pieces: Sequence[Piece]) -> str:
    """Return the reason why there is no flight, and advice."""
    if not pieces:
        return (
            "nothing round was seen to move smoothly through five frames: --ball-at X,Y@FRAME "
            "points at the ball, --frames and --region leave out what else moves"
        )
    places = sum(len(each.t) for each in pieces)
    return (
        f"nothing falls as gravity lets a ball: what moves ({places} places) is carried, hangs, "
        "rolls, or is no ball; --ball-at X,Y@FRAME points at it, and the rate (--fps) must be true"
    )


def of_camera(model: FittedFlights, drift: float) -> list[Note]:
    """Return notes on the camera from the flights; `drift`: drift that may be hidden [px/frame]."""
    notes, fit = [], model.fit
    if model.tilted:
        words = (
            "the acceleration changes over the picture as before a camera that looks up or down by "
            "ten degrees or more: scale and speeds are those of its middle, by a fitted perspective"
        )
        notes.append(("TILTED", words))
    if fit.readout and model.longest:
        words = (
            f"the shutter rolls: the flights fit a readout of about {fit.readout:.2g} of a "
            "frame, and the speeds' u covers any up to a frame; --readout says how long it is"
        )
        notes.append(("ROLLING_SHUTTER", words))
    if drift > FALLS.drift_matters * np.hypot(*fit.states[:, 2:].T).min():
        words = (
            "the background has too few edges to show whether the camera moves: the u of "
            "speeds and restitutions covers a hand's usual drift; --tripod says that the "
            "camera stands"
        )
        notes.append(("DRIFT_UNSEEN", words))
    return notes


def of_readout(contacts: Sequence[Contact], rolled: Sequence[Contact]) -> Note:
    """Note of an unknown readout, by comparison with contacts for a readout of half a frame."""
    by = {each.before: each.restitution for each in rolled}
    pairs = [(each.restitution, by.get(each.before)) for each in contacts]
    most = max((abs(one.value - other.value) for one, other in pairs if one and other), default=0.0)
    words = (
        "neither --readout nor --global-shutter is given: a shutter may roll for up to a "
        "frame, and the speeds' u covers that"
    )
    if any(one for one, _ in pairs):
        words += f"; a restitution's does not: half a frame would change one by {most:.2g}"
    return "READOUT_UNKNOWN", words
