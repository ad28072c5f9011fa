"""Doubts about a clip's flights: scales, frame times, camera, and other moving objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.flights import EXPLAINED, beside, explained_share
from virtual_lab.video.follow.joint import Fit, fit_flights
from virtual_lab.video.follow.knowledge import (
    BALL,
    FILE,
    GIVEN,
    GRAVITY,
    ClipKnowledge,
    Note,
    frames_are,
)
from virtual_lab.video.follow.models import STEEPEST, FittedFlights, positions_off
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.ruler import SAID, Ruler, off_u
from virtual_lab.video.follow.scene import FOCAL, FlightScene

DRIFT_MATTERS = 0.002  # largest tolerated hidden drift [share of a flight's speed]
# largest allowed difference from g, or between two scales: in standard uncertainties, and as a
# share, whichever is larger
APART = (3.0, 0.04)
# acceleration beyond which the frame rate must be wrong [g], because no ball's size is that wrong
ABSURD = 3.0
# limits of a ball's diameter [m]: an error outside the outer two, a doubt outside the inner two,
# between which are the balls of sports
DIAMETERS = (5e-3, 0.025, 0.26, 1.0)


def against_gravity(
    knowledge: ClipKnowledge, shared: Estimate, scale: Ruler, where: str
) -> tuple[list[Note], ClipKnowledge]:
    """Return a list with one note if length and frame rate contradict g, and the facts to use.

    The list is empty if they agree within their u. If the frame rate is only the file's, the facts
    have the rate with which the flights fall with g. The relative u of this rate is half the
    relative u of the acceleration, which includes the u of lengths. Gravity then sets no scale.

    Raises `InputError` if the ball falls so fast that a stated frame rate must be wrong.

    Parameters
    ----------
    shared
        Acceleration that all flights share [m/s²], with a u that includes the u of a fall with g.
    scale
        Scale that does not come from gravity.
    where
        Name of the clip in the error message.
    """
    g, (coverage, share), fall = knowledge.gravity, APART, shared.value
    # the difference of the logarithms, as for any two scales (`off_u`)
    if abs(np.log(fall / g)) * fall <= coverage * shared.u or abs(fall - g) <= share * g:
        return [], knowledge
    rate, relative_u = knowledge.rate * float(np.sqrt(g / fall)), shared.u / fall / 2
    finding = f"with {SAID[scale.source]} as the scale, the ball would fall at {fall:.4g} m/s²"
    if knowledge.rate_of == FILE:
        said = with_uncertainty(rate, rate * relative_u)
        why = f"at the file's own rate of {knowledge.rate:.4g}, {finding}"
        words = f"a rate of {said} per second was fitted: {why}; or state {{fps}}"
        fitted = replace(knowledge, rate=rate, rate_u=relative_u, rate_of=GRAVITY, ruler=BALL)
        return [("RATE_FITTED", words)], fitted
    length = f"a length {g / fall:.3g} times as long"
    if scale.source == BALL and knowledge.ball:
        length = f"{{ball={1e3 * g / fall * knowledge.ball:.3g}mm}}"
    cures = f"{{fps={rate:.3g}}} or {length}"
    if fall - coverage * shared.u > ABSURD * g:
        allowed = f"{finding}; {cures} would give {g:.3g} m/s²"
        raise InputError(where, "frames per second", f"{knowledge.rate:.6g}", allowed)
    words = f"{finding} instead of {g:.3g} m/s²; that length is wrong, or the frame rate"
    why = f"and with it every speed (slow motion?); {cures} would fit"
    return [("GRAVITY", f"{words} {why}")], knowledge


def of_diameter(scale: Ruler, ways: Sequence[Piece], rate: float, where: str) -> list[Note]:
    """Return a note on the diameter of the ball; its flag is set if no ball of a sport has it.

    The diameter follows from the radius in the picture and from `scale`, which was found from
    gravity, so it shows a wrong frame rate `rate` [1/s]. Slow motion is usually slower by a power
    of 2. The note states the rate by which the ball has about the size of a tennis ball.

    Raises `InputError` if no ball at all has this diameter.
    """
    least, small, large, most = DIAMETERS
    diameter = 2 * scale.metres_per_pixel * float(np.median([each.radius for each in ways]))
    words = f"by gravity the ball has a diameter of {1e3 * diameter:.0f} mm"
    if small <= diameter <= large:
        return [("", words)]
    factor = 2.0 ** round(np.log2(diameter / 0.07) / 2)
    size = 1e3 * diameter / factor**2
    cure = f"wrong frame rate (slow motion)? {{fps={factor * rate:.4g}}} gives {size:.0f} mm"
    if not least <= diameter <= most:
        raise InputError(where, "frames per second", f"{rate:.6g}", f"{words}; {cure}")
    return [("BALL_SIZE", f"{words}; {cure}. If the size is right, state {{ball}}")]


def against_size(rulers: Sequence[Ruler]) -> list[Note]:
    """Return a list with one note if the stated size of the ball contradicts the stated length.

    The stated length is a known distance in the picture, such as the distance between two points.
    The list is empty if size and length agree, or if one of them was not stated.
    """
    by = {each.source: each for each in rulers}
    if not {GIVEN, BALL} <= set(by):
        return []
    apart, (coverage, share) = abs(off_u(by[GIVEN], by[BALL])), APART
    ratio = by[GIVEN].metres_per_pixel / by[BALL].metres_per_pixel
    if apart < coverage or abs(ratio - 1) < share:
        return []
    words = f"by the given length the ball is {ratio:.3g} times as large as {{ball}} states"
    return [("BALL_SIZE", f"{words}, a difference of {apart:.2g} u; one of the two is wrong")]


def against_flights(
    scene: FlightScene, watched: Watched, pieces: Sequence[Piece], ways: Sequence[Piece]
) -> list[Note]:
    """Return notes on doubts about the flights, or one note on their absence if `ways` is empty.

    There is a note for each of these findings:

    * a second ball;
    * motion outside the flights;
    * jumps of the background;
    * an interlaced clip (each frame combines two fields recorded at different times);
    * missing frames.

    Parameters
    ----------
    scene
        Bright regions (blobs), frame times, and properties of the camera.
    watched
        Moving blobs and the drift of the picture.
    pieces
        All parts of the clip in which a blob moves smoothly.
    ways
        Flights of the ball.
    """
    if not ways:
        return [("", _without_flight(pieces))]
    notes = []
    if more := beside(scene, ways, pieces):
        first = min(int(each.frames[0]) for each in more)
        words = f"from frame {first} on, a second ball flies beside the one that is followed"
        why = "and may be mistaken for it; select with {ball_at}"
        notes.append(("SECOND_BALL", f"{words}, {why}"))
    share = explained_share(scene, ways)
    if share < 1 and not ways[0].sharp:  # sharp positions near a bat are left out
        words = f"the flights explain {100 * share:.0f} % of the frames in which the ball moves"
        why = "in the others it is carried, rolls or is struck, or a flight was missed"
        notes.append(("UNEXPLAINED" if share < EXPLAINED else "", f"{words}; {why}"))
    frames = np.concatenate([way.frames for way in ways])
    leaps = {k: by for k, by in watched.leaps.items() if frames.min() < k <= frames.max()}
    if leaps:
        words = f"the background jumps by {max(leaps.values()):.2g} pixels before frame"
        why = "flights near it may be wrong. If the camera stands still, use {tripod}"
        notes.append(("DRIFT_LEAPS", f"{words} {min(leaps)}; {why}"))
    if watched.interlaced:
        words = "each frame combines two fields of different times (interlaced); convert the clip"
        advice = "to one frame per field, for example with ffmpeg -i CLIP -vf bwdif=1 NEW"
        notes.append(("INTERLACED", f"{words} {advice}"))
    if lost := scene.missing_frames(ways):
        where = ", ".join(f"{n} before frame {frame}" for frame, n in sorted(lost.items())[:6])
        words = "frames are missing although the time stamps are even"
        notes.append(("LOST_FRAMES", f"{words} ({where}); the times were corrected"))
    return notes


def _without_flight(pieces: Sequence[Piece]) -> str:
    """Return a text for a clip without a flight: the reason, and advice for the user.

    `pieces` are the pieces of smooth motion in the clip. None of them is a flight.
    """
    at = "point at the ball with {ball_at=X,Y@FRAME}"
    if not pieces:
        words = f"no round object moves smoothly through five frames; {at}, or exclude other"
        return f"{words} moving objects with {{frames}} and {{region}}"
    count = sum(len(each.t) for each in pieces)
    words = f"no object falls freely: what moves ({count} positions) is carried, hangs, rolls or is"
    return f"{words} not a ball; {at}, and check the frame rate ({{fps}})"


def of_camera(model: FittedFlights, drift: float, rate: float) -> list[Note]:
    """Return notes on a camera that is tilted, turns, has a rolling shutter, or drifts undetected.

    `drift` is the largest undetected drift [px/frame]; 0 gives no note on drift. `rate` is that of
    the frames [1/s]. There is one note per effect that the flights show or cannot rule out.
    """
    notes, fit = [], model.fit
    ball = model.scene.blobs[np.concatenate([each.blobs for each in model.ways])]
    moved = max(float(np.ptp(ball[f"picture_{axis}"] - ball[axis])) for axis in "xy")
    turn = moved / FOCAL / max(model.scene.size)
    if turn > STEEPEST:
        words = f"the picture moves by {moved:.0f} pixels during the flights; a usual lens that"
        how = f"turned by {turn / DEGREE:.0f} degrees was fitted. Hold another camera still"
        notes.append(("PANNED", f"{words} {how}"))
    if model.tilted:
        words = "the camera looks up or down by ten degrees or more; a perspective was fitted, and"
        notes.append(("TILTED", f"{words} scale and speeds refer to the middle of the picture"))
    free, stated, ms = fit, model.scene.readout, 1e3 / rate
    if stated is not None:
        free = fit_flights(replace(model.scene, readout=None), model.ways, floor=fit.floor)
    value, u = free.readout, np.sqrt(np.diag(free.covariance)[-4 * len(fit.states) - 2])
    words = f"a rolling shutter with a readout time of {with_uncertainty(ms * value, ms * u)} ms"
    if stated is None:
        why = "was fitted, and u covers it; if you know it, state {readout} or {global_shutter}"
        flag = "ROLLING_SHUTTER" if value > APART[0] * u else "READOUT_UNKNOWN"
        notes.append((flag, f"{words} {why}"))
    elif (apart := abs(value - stated) / np.hypot(u, model.scene.readout_u)) > APART[0]:
        why = f"would fit better than {ms * stated:.2g} ms, a difference of {apart:.2g} u"
        notes.append(("READOUT", f"{words} {why}; check {{readout}} and {{global_shutter}}"))
    if drift > DRIFT_MATTERS * np.hypot(*fit.states[:, 2:].T).min():
        words = "the background, which is plain or poorly coded, does not show whether the camera"
        why = "moves; u covers only the drift of a hand-held camera. If it is fixed, use {tripod}"
        notes.append(("DRIFT_UNSEEN", f"{words} {why}"))
    return notes


def of_positions(model: FittedFlights) -> list[Note]:
    """Return a list with one note that names the positions far from the fitted flights, if any."""
    off = np.concatenate(positions_off(model.ways, model.fit))
    if not off.any():
        return []
    frames = np.concatenate([way.frames for way in model.ways])[off]
    most = float(np.hypot(*np.concatenate(model.fit.residuals)[off].T).max())
    up = "up to " * (len(frames) > 1)
    words = f"positions: {frames_are(frames.tolist())} {up}{most:.1f}"
    why = f"pixels off the fitted flights, {most / model.fit.spread:.0f} times the scatter"
    advice = "speeds and restitution may be wrong; use {corrected} for those off the ball's center"
    return [("POSITIONS_OFF", f"{words} {why}; {advice}")]


def of_drag(model: FittedFlights) -> list[Note]:
    """Return a list with one note if the flights contradict the stated drag.

    The list is empty if no drag was stated, or if both agree.
    """
    if model.scene.drag is None:
        return []
    ratio, apart = drag_difference(model.scene, model.ways, model.fit)
    if apart < APART[0]:
        return []
    words = f"the flights show {ratio:.2g} times the drag of the stated ball or mass"
    advice = f"({apart:.2g} u apart), so it was fitted; check {{mass}} and {{ball}}"
    return [("DRAG", f"{words} {advice}")]


def drag_difference(scene: FlightScene, ways: Sequence[Piece], fit: Fit) -> tuple[float, float]:
    """Return the ratio of the flights' drag to the stated drag, and their difference [u].

    The drag of the flights is fitted without the stated drag.
    """
    size = np.median([each.radius for each in ways]) if scene.in_radii else 1.0
    stated, u = np.divide(scene.drag or (np.nan, np.nan), size).tolist()
    free = fit_flights(replace(scene, drag=None), ways, floor=fit.floor)
    free_u = free.drag * float(np.sqrt(free.covariance[2, 2]))  # the parameter is a logarithm
    return free.drag / stated, abs(free.drag - stated) / float(np.hypot(free_u, u))
