"""Slow motion of a shot: a top view of ball and bat as a drawing and as frames.

Before the hand-in it shows the sketch of the shot: the ball has the nominal speed and hits the
position that was set, and its rebound is blurred. Axes: x along the line of fire, z along the bat
at rest from its tip. Time is 0 at the first contact.
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
    """Dimensions of the drawing."""

    frames: int = 121
    strobe: int = 6  # frames from one outline of the ball to the next
    after: float = 0.15  # duration after the contact, as in the encoder record [s]
    left: int = -950  # limits of the picture along x [mm]
    right: int = 760
    top: int = -130  # limits of the picture along z [mm]
    bottom: int = 1000
    ball: float = 36.5  # radius of a ball [mm]
    barrel: float = 0.033  # radius of a barrel [m]


FILM = Film()


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Motion of ball and bat: time [s], ball x and z [m], bat angle [rad], shape (time,)."""

    time: NDArray[np.float64]
    x: NDArray[np.float64]
    z: NDArray[np.float64]
    angle: NDArray[np.float64]
    words: str  # events, as a sentence
    true: bool = False  # True for the true motion, False for a sketch


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowMotion:
    """Data of the drawing of a motion; lengths in mm, angles in degrees."""

    shot: int  # from 1
    frames: str  # JSON list of [time in ms, x, z, angle]
    words: str
    true: bool
    axis: float  # pivot axis, from the tip
    bat: str  # points of the outline of the bat
    gates: tuple[tuple[int, float], ...]  # number and x of each gate
    coming: tuple[tuple[float, float], ...]  # (x, z) of the ball before the contact
    going: tuple[tuple[float, float], ...]  # (x, z) of the ball after the contact
    turned: tuple[float, ...]  # angles of the bat at equal time steps
    view: str = f"{FILM.left} {FILM.top} {FILM.right - FILM.left} {FILM.bottom - FILM.top}"
    ball: float = FILM.ball


def motion_of_sketch(event: DayEvent, rules: Procedure, place: float) -> Motion:
    """Return an approximate motion of ball and bat that agrees with the sketch of a shot.

    A trainee may see the sketch, a top view of the shot. The log entry `event` contains it. Whether
    ball and bat touch in the sketch is true, but the numbers of the sketch have random errors.
    Times are in s, lengths in m and angles in rad. If no ball
    reached the bat, the x of the ball is NaN.

    Parameters
    ----------
    event
        Entry of the shot in the log of the day.
    place
        Impact position of the shot from the tip [m].
    """
    sketch = event.sketch
    touching = -FILM.barrel - FILM.ball / 1e3
    begin = (FILM.left / 1e3 - touching) / rules.ball_speed
    time = np.linspace(begin, FILM.after, FILM.frames)
    speed, bat_speed = rules.ball_speed, rules.bat_speed or 0.0
    before = np.minimum(time, 0.0)
    lever = 0.55  # typical distance from the axis to the point of the nominal bat speed [m]
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
        angle = np.minimum(angle, np.radians(170.0))  # angle of its stop
    words = contact_words(struck, sketch.get("way", ""), sketch.get("side", "straight"))
    return Motion(time=time, x=x, z=np.full(time.shape, place), angle=angle, words=words)


def clear_rebound(sketch: Mapping[str, Any]) -> float:
    """Return the e_A to draw for a sketch, at least 0.03 away from zero.

    It is positive if the ball flies back and negative if it flies on. The distance from zero keeps
    the direction of the ball visible. Raises `KeyError` for a sketch in which the ball missed the
    bat.
    """
    rebound, least = float(sketch["rebound"]), 0.03
    return max(rebound, least) if sketch["way"] == "back" else min(rebound, -least)


def contact_words(struck: Sequence[str], direction: str = "", side: str = "straight") -> str:
    """Return a sentence on the contacts of a shot and the direction of the ball after them.

    The sentence is "No ball reached the bat." if there is no contact.

    Parameters
    ----------
    struck
        Contacts in order: "bat", "bat again", "stop" or "frame".
    direction
        "back" if the ball flies back, "on" if it flies on. If empty, the sentence does not state
        the direction.
    side
        Direction of the rebound: "straight", "up" or "down".
    """
    words = {
        "bat": "the ball hits the bat",
        "bat again": "bat and ball touch a second time",
        "stop": "the bat hits its stop",
        "frame": "the ball hits the frame of a gate",
    }
    aside = {"straight": "", "up": " upward", "down": " downward"}[side]
    ends = {"back": f"the ball rebounds{aside}", "on": "the ball does not rebound"}
    text = "; ".join([*(words[each] for each in struck), *([ends[direction]] if direction else [])])
    return f"{text[0].upper()}{text[1:]}." if text else "No ball reached the bat."


def slow_motion(shot: int, motion: Motion, day: Day, rules: Procedure) -> SlowMotion:
    """Return the data with which the page draws the motion of a shot.

    Lengths are in mm, times in ms and angles in degrees. `shot` is counted from 1.
    """
    z, diameter = _outline(day.morning.bat)
    axis = z[-1] - rules.pivot_from_knob * 1e3
    upper = [f"{d / 2:.0f},{at:.0f}" for at, d in zip(z, diameter, strict=True)]
    lower = [f"{-d / 2:.0f},{at:.0f}" for at, d in zip(z, diameter, strict=True)]
    touching = -1e3 * FILM.barrel - FILM.ball
    calibration = day.morning.calibration
    gates: list[tuple[int, float]] = []
    while (name := f"impact.gates.distance_{len(gates)}") in calibration:
        gates.append((len(gates) + 1, float(round(touching - calibration[name].value * 1e3))))
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
        bat=" ".join(upper + lower[::-1]),
        gates=tuple(each for each in gates if each[1] > FILM.left),
        coming=tuple(place for before, place in ball if before),
        going=tuple(place for before, place in ball if not before),
        turned=tuple(float(each) for each in angle[:: 4 * FILM.strobe] if abs(each) > 1),
    )


def _mm(metres: ArrayLike) -> Sequence[float]:
    return [float(each) for each in np.round(np.asarray(metres) * 1e3)]


@cache
def _outline(bat: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the profile of a bat: positions from the tip and diameters [mm], shape (point,).

    A bat without a data sheet in the catalog gets a typical profile.
    """
    try:
        profile = catalog.load("bats", bat, BatSpec).spec.body.profile
    except InputError:  # the sheet of a user's bat is not in the catalog
        return np.array([0.0, 350.0, 600.0, 860.0]), np.array([66.0, 60.0, 25.0, 30.0])
    return np.array(profile.z) * 1e3, np.array(profile.outer_diameter) * 1e3
