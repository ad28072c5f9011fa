"""Slow motion of a shot from above: where ball and bat are, as a picture and as frames.

Before the day is handed in the frames are made of the shot's sketch: the ball comes in at the
procedure's speed at the place that was set, and leaves as an eye had it. Axes as the rig's: x
along the line of fire, z along the resting bat from its tip; time 0 is the first contact.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab import catalog
from virtual_lab.catalog.specs import BatSpec
from virtual_lab.errors import InputError

if TYPE_CHECKING:
    from virtual_lab.bench.day.day import Day, DayEvent
    from virtual_lab.measurement.procedure import Procedure


@dataclass(frozen=True, slots=True)
class Film:
    """How every motion is drawn."""

    frames: int = 121
    strobe: int = 6  # frames from one outline of the ball to the next
    after: float = 0.15  # s that it goes on from the contact, as long as an encoder writes
    left: int = -950  # mm that are seen: x
    right: int = 760
    top: int = -130  # z
    bottom: int = 1000
    ball: float = 36.5  # mm, its radius
    barrel: float = 0.033  # m, radius of one


FILM = Film()


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Ball and bat over time, arrays (moment,): SI."""

    time: NDArray[np.float64]
    x: NDArray[np.float64]
    z: NDArray[np.float64]
    angle: NDArray[np.float64]
    words: str  # what happened, in words
    true: bool = False  # whether it is what really happened


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowMotion:
    """What a page draws of a motion; lengths in mm, angles in degrees."""

    shot: int  # from 1
    frames: str  # JSON of [time in ms, x, z, angle] each
    words: str
    true: bool
    axis: float  # of the bat, from its tip
    bat: str  # points of its outline
    gates: tuple[tuple[int, float], ...]  # number and x
    coming: tuple[tuple[float, float], ...]  # the ball at some moments, before the contact
    going: tuple[tuple[float, float], ...]  # and after it
    turned: tuple[float, ...]  # angles of the bat at some moments
    view: str = f"{FILM.left} {FILM.top} {FILM.right - FILM.left} {FILM.bottom - FILM.top}"
    ball: float = FILM.ball


def sketched(event: DayEvent, rules: Procedure, place: float) -> Motion:
    """Return the motion of a shot as its sketch has it, `place` [m] from the tip."""
    sketch = event.sketch
    touching = -FILM.barrel - FILM.ball / 1e3
    begin = (FILM.left / 1e3 - touching) / rules.ball_speed
    time = np.linspace(begin, FILM.after, FILM.frames)
    speed, bat_speed = rules.ball_speed, rules.bat_speed or 0.0
    before = np.minimum(time, 0.0)
    lever = 0.55  # m, about: from the axis to where rules state a bat's speed
    angle = -bat_speed / lever * before
    x = touching + speed * before
    struck = tuple(sketch.get("struck", ()))
    if not struck:
        x = np.full(time.shape, np.nan)
    after = np.maximum(time, 0.0)
    if "rebound" in sketch:
        rebound = clear_rebound(sketch)
        x = x - (rebound * (speed + bat_speed) + bat_speed) * after
        angle = angle + (float(sketch["turn"]) - bat_speed / lever) * after
    else:
        x = x - speed / 2 * after
    if "stop" in struck:
        angle = np.minimum(angle, np.radians(170.0))  # there it rests
    words = contact_words(struck, sketch.get("way", ""), sketch.get("side", "straight"))
    return Motion(time=time, x=x, z=np.full(time.shape, place), angle=angle, words=words)


def clear_rebound(sketch: Mapping[str, Any]) -> float:
    """Return e_A as a sketch has it, so far from nothing that the way the ball goes is seen."""
    rebound, least = float(sketch["rebound"]), 0.03
    return max(rebound, least) if sketch["way"] == "back" else min(rebound, -least)


def contact_words(struck: Sequence[str], way: str = "", side: str = "straight") -> str:
    """Return what happened on a shot, in a sentence."""
    words = {
        "bat": "the ball hits the bat",
        "bat again": "bat and ball touch a second time",
        "stop": "the bat hits its stop",
        "frame": "the ball hits the frame of a gate",
    }
    aside = {"straight": "", "up": " upward", "down": " downward"}[side]
    ends = {"back": f"the ball rebounds{aside}", "on": "the ball does not rebound"}
    text = "; ".join([*(words[each] for each in struck), *([ends[way]] if way else [])])
    return f"{text[0].upper()}{text[1:]}." if text else "No ball reached the bat."


def slow_motion(shot: int, motion: Motion, day: Day, rules: Procedure) -> SlowMotion:
    """Return what a page draws of a motion."""
    z, diameter = _outline(day.morning.bat)
    axis = z[-1] - rules.pivot_from_knob * 1e3
    right = [f"{d / 2:.0f},{at:.0f}" for at, d in zip(z, diameter, strict=True)]
    left = [f"{-d / 2:.0f},{at:.0f}" for at, d in zip(z, diameter, strict=True)]
    touching = -1e3 * FILM.barrel - FILM.ball
    known = day.morning.calibration
    gates: list[tuple[int, float]] = []
    while (name := f"impact.gates.distance_{len(gates)}") in known:
        gates.append((len(gates) + 1, float(round(touching - known[name].value * 1e3))))
    angle = np.round(np.degrees(motion.angle), 1)
    times = np.round(motion.time * 1e3, 1)
    rows = list(zip(times, _mm(motion.x), _mm(motion.z), angle, strict=True))
    outlines = zip(motion.time[:: FILM.strobe], rows[:: FILM.strobe], strict=True)
    ball = [(time < 0, (x, z)) for time, (_, x, z, _) in outlines if np.isfinite(x)]
    frames = [[None if not np.isfinite(v) else float(v) for v in row] for row in rows]
    return SlowMotion(
        shot=shot,
        frames=json.dumps(frames, separators=(",", ":")),
        words=motion.words,
        true=motion.true,
        axis=float(axis),
        bat=" ".join(right + left[::-1]),
        gates=tuple(each for each in gates if each[1] > FILM.left),
        coming=tuple(place for before, place in ball if before),
        going=tuple(place for before, place in ball if not before),
        turned=tuple(float(each) for each in angle[:: 4 * FILM.strobe] if abs(each) > 1),
    )


def _mm(metres: ArrayLike) -> Sequence[float]:
    return [float(each) for each in np.round(np.asarray(metres) * 1e3)]


@cache
def _outline(bat: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places from the tip and diameters of the bat of a data sheet [mm]."""
    try:
        profile = catalog.load("bats", bat, BatSpec).spec.body.profile
    except InputError:  # a trainer's own bat, which no data sheet draws
        return np.array([0.0, 350.0, 600.0, 860.0]), np.array([66.0, 60.0, 25.0, 30.0])
    return np.array(profile.z) * 1e3, np.array(profile.outer_diameter) * 1e3
