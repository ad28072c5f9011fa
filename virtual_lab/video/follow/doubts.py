"""What a clip's rulers say against each other: lengths, gravity and the frame rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.follow.contacts import Note
from virtual_lab.video.follow.known import BALL, GIVEN, ClipKnowledge
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.ruler import SAID, Ruler, off_u


@dataclass(frozen=True, slots=True, kw_only=True)
class DoubtSettings:
    """How far off g, or one ruler off another, is no chance: u of it, and a share of it."""

    apart: tuple[float, float] = (3.0, 0.04)  # all flights together
    apart_alone: tuple[float, float] = (5.0, 0.1)  # one flight
    absurd: float = 3.0  # times g: no ball's size is so far off, the frame rate is
    bent: float = 0.05  # radii that no gravity bends a short way by


DOUBTS = DoubtSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Falls:
    """How the flights fall by a ruler other than gravity."""

    known: ClipKnowledge
    ways: Sequence[Piece]
    pulls: Sequence[Estimate]  # of each flight [m/s²]
    shared: Estimate  # of all
    scale: Ruler
    step: float  # seconds of a frame

    def sag(self, way: Piece) -> float:
        """Return by how many radii 1 m/s² bends a flight."""
        length = self.scale.metres_per_pixel * way.radius
        return float((self.step * np.ptp(way.t)) ** 2 / 8 / length)

    def shown(self, way: Piece, pull: Estimate) -> bool:
        """Return whether gravity, or what a flight falls with, bends it by more than a radius."""
        return self.sag(way) * max(self.known.gravity, pull.value) > 1

    @property
    def rate(self) -> float:
        """The frame rate at which flights fall with g [1/s]."""
        return self.known.rate * float(np.sqrt(self.known.gravity / self.shared.value))

    def require_rate(self, where: str) -> None:
        """Raise `InputError` where balls fall so fast that the frame rate must be another."""
        least = self.shared.value - DOUBTS.apart[0] * self.shared.u
        if least < DOUBTS.absurd * self.known.gravity:
            return
        if any(self.shown(way, self.shared) for way in self.ways):
            allowed = (
                f"by {SAID[self.scale.source]} the ball would fall with {self.shared.value:.4g} "
                f"m/s²; --fps {self.rate:.3g} makes that {self.known.gravity:.3g}"
            )
            raise InputError(where, "frames per second", f"{self.known.rate:.6g}", allowed)

    def against(self) -> list[Note]:
        """Return what speaks against length and frame rate."""
        g, judged = self.known.gravity, []
        for way, pull in zip(self.ways, self.pulls, strict=True):
            if self.shown(way, pull) or self.sag(way) * abs(pull.value - g) > DOUBTS.bent:
                judged.append((pull, *DOUBTS.apart_alone))
        if judged:
            judged.append((self.shared, *DOUBTS.apart))
        for each, coverage, share in judged:
            if abs(each.value - g) > max(coverage * each.u, share * g):
                words = (
                    f"by {SAID[self.scale.source]} the ball falls with {each.value:.3g} m/s², not "
                    f"{g:.3g}: that length is wrong, or the frame rate and with it every speed "
                    f"(slow motion declares the rate it plays at; --fps {self.rate:.3g} would fit)"
                )
                return [("GRAVITY", words)]
        return []


def against_size(rulers: Sequence[Ruler]) -> list[Note]:
    """Return what speaks against a ball's size where another length is given."""
    by = {each.source: each for each in rulers}
    if not {GIVEN, BALL} <= set(by):
        return []
    given, ball = by[GIVEN], by[BALL]
    ratio, apart = given.metres_per_pixel / ball.metres_per_pixel, abs(off_u(given, ball))
    coverage, share = DOUBTS.apart
    if apart < coverage or abs(ratio - 1) < share:
        return []
    words = (
        f"by the length given the ball is {ratio:.3g} times as large as --ball says ({apart:.2g} "
        "standard uncertainties off): one of the two is wrong"
    )
    return [("BALL_SIZE", words)]
