"""The rungs of the motion at a rig: flights in closed form, or played shot by shot in pymunk."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BatBody
from virtual_lab.errors import InputError
from virtual_lab.relations.flight import time_before
from virtual_lab.simulation.instruments.calibrated import TrueConstant
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.motion.played import Pieces, Target
from virtual_lab.simulation.motion.pymunk_scene import play_pymunk
from virtual_lab.simulation.motion.scene import (
    FrameSpec,
    GateFrame,
    PivotedBat,
    ShotScene,
    ShotState,
    StopSpec,
)
from virtual_lab.simulation.motion.touch import moved
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.rig import MotionRung, ShotPlan
from virtual_lab.units import Array

AHEAD = 1.0  # m before the contact, where a scene begins
RECORD = 0.5  # s after the contact, for which one is played whose ball meets more than the bat


class Surroundings(NamedTuple):
    """What stands around a bat at rest."""

    frame: FrameSpec
    stop: StopSpec
    gates: Array  # distances of the frames, those of their gates, far first ([shot,] gate) [m]
    # heights between which a gate ever sees a ball's centre [m]
    view: tuple[TrueConstant, TrueConstant]

    def hiding(self, radius: TrueConstant) -> Array:
        """Return the frames that can keep a ball on its way back from being seen.

        The far one does not, where it stops only balls that its own gate does not see.
        """
        low, high = self.frame.bottom + radius, self.frame.top - radius
        unseen = np.all((low <= self.view[0]) & (high >= self.view[1]))
        return self.gates[..., int(unseen) :]

    def at(self, shot: int) -> Surroundings:
        """Return what stands around the bat of one shot."""
        return self._replace(gates=self.gates[shot] if self.gates.ndim > 1 else self.gates)


class RestingBat(NamedTuple):
    """A bat at rest and the blows on it, arrays (shot,)."""

    body: BatBody
    axis: Array  # from the tip [m]
    place: Array  # of the ball's centre, from the tip [m]
    across: Array  # of the ball's centre, above the bat's axis [m]
    efficiency: Array  # e_A
    mass: Array  # of the ball [kg]


class FlownShots(NamedTuple):
    """Flights, and what else became of shots that were played as scenes."""

    passage: Passage
    late: Array | float = 0.0  # from the first contact until ball and target part for good [s]
    met: NDArray[np.bool_] | bool = True  # whether the ball came to the bat
    # shot, time after the contact [s], what a second blow then adds to the bat's rate [rad/s]
    kicks: tuple[tuple[int, float, float], ...] = ()


def flown(passage: Passage, plan: ShotPlan, bat: RestingBat, around: Surroundings) -> FlownShots:
    """Return the flights at a pivoted bat at rest by the plan's rung of the motion.

    Closed form, but pymunk for a shot whose ball may meet a frame on its way in, or whose bat may
    come back from its stop to the ball; for all shots where the plan asks for it. What a scene
    comes to replaces speeds, slopes and places of its flight. The blow is that of a level ball, as
    it is in closed form. A frame on the way back needs no scene: no gate beyond it sees the ball,
    whatever then becomes of it.

    Raises
    ------
    InputError
        A shot that pymunk cannot play.
    """
    beyond, framed = _beyond_closed_form(passage, bat, around)
    asked = plan.motion is MotionRung.PYMUNK
    if not asked:
        passage = _stopped(passage, around, framed & ~beyond)
    shots = np.arange(len(beyond)) if asked else np.flatnonzero(beyond)
    if not shots.size:
        return FlownShots(passage)
    whole, count = _columns(passage, len(beyond)), len(beyond)
    whole |= {"plane_out": whole["plane"].copy(), "height_out": whole["height"].copy()}
    whole.setdefault("reach", np.full(count, np.inf))
    late, met, kicks = np.zeros(count), np.ones(count, dtype=bool), []
    for shot in shots.tolist():
        one = slice(shot, shot + 1)
        blow = RestingBat(bat.body, *(each[one] for each in bat[1:]))
        alone = replace(passage, **_columns(passage, count, one), **_shared(passage, count, shot))
        # on a free way back a millisecond after the contact is enough: the ball has parted
        near = around.at(shot)
        scene = scene_of(alone, blow, near, RECORD if beyond[shot] or framed[shot] else 1e-3)
        pieces = _played(scene, asked)
        if pieces is None:
            continue
        first, back = _contacts(pieces)
        for name, value in _as_flown(scene, pieces, first, back).items():
            whole[name][shot] = value
        late[shot] = pieces.time[back] - pieces.time[first]
        met[shot] = pieces.struck[first] == Target.BAT
        for again in np.flatnonzero(pieces.struck == Target.BAT_AGAIN):
            more = float(np.diff(pieces.state.rate)[again - 1])
            kicks.append((int(shot), float(pieces.time[again] - pieces.time[first]), more))
    if met.all() and np.isinf(whole["reach"]).all():
        whole.pop("reach")
    if not late.any():
        whole = {name: each for name, each in whole.items() if not name.endswith("e_out")}
    return FlownShots(replace(passage, **whole), late, met, tuple(kicks))


def scene_of(passage: Passage, bat: RestingBat, around: Surroundings, after: float) -> ShotScene:
    """Return the scene of one shot: flights and blow of (1,), to `after` [s] past the contact."""
    axis = float(bat.axis[0])
    held = PivotedBat(bat.body.profile, axis, beam_of(bat.body).inertia(axis))
    touching = -np.sqrt((held.radius(bat.place) + passage.radius) ** 2 - bat.across**2)
    span = time_before(AHEAD, passage.speed_in, passage.drag)
    up = float((bat.across - passage.height)[0])
    return ShotScene(
        start=ShotState.of(
            x=touching - AHEAD,
            y=bat.across - passage.gravity / 2 * span**2,
            z=bat.place,
            vx=passage.speed_in * np.exp(passage.drag * AHEAD),
            vy=passage.gravity * span,
        ),
        ball_mass=bat.mass,
        ball_drag=np.broadcast_to(passage.drag, (1,)),
        ball_radius=passage.radius,
        bat=held,
        efficiency=lambda *_: bat.efficiency,
        duration=float(span[0]) + after,
        gravity=passage.gravity,
        stop=around.stop,
        frames=tuple(GateFrame(around.frame, float(touching[0]) - at, up) for at in around.gates),
    )


def _beyond_closed_form(
    passage: Passage, bat: RestingBat, around: Surroundings
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which shots may need a scene, and of which a frame may stop the way back.

    Bounds, so that closed form is right wherever they say no.
    """
    frame, radius, count = around.frame, passage.radius, len(bat.place)

    def framed(
        gate: Any, speed: Any, slope: Any, height: Any, flights: Passage = passage
    ) -> NDArray[np.bool_]:
        far = gate + frame.radius + flights.radius
        slowest = far * np.exp(flights.drag * far) / speed
        rise, fall = slope * far, flights.gravity / 2 * slowest**2
        low = height + np.minimum(rise, 0.0) - fall <= frame.bottom + flights.radius
        high = height + np.maximum(rise, 0.0) >= frame.top - flights.radius
        return np.asarray(low | high)

    # what hardly ever happens is asked of the worst of the batch first
    gate, height, largest = around.gates[..., 0], passage.height, np.max(radius)
    most = {name: np.max(getattr(passage, name)) for name in ("radius", "drag", "gravity")}
    worst = np.array([np.min(height), np.max(height)])
    aside = bat.place.min(), bat.place.max()
    beyond = np.zeros(count, dtype=bool)
    if framed(gate.max(), passage.speed_in.min(), 0.0, worst, replace(passage, **most)).any():
        beyond |= framed(gate, passage.speed_in, 0.0, height)
    if aside[0] <= frame.tip_side + largest or aside[1] >= frame.knob_side - largest:
        beyond |= bat.place <= frame.tip_side + radius
        beyond |= bat.place >= frame.knob_side - radius
    beyond |= _caught(passage, bat, around.stop)
    with np.errstate(divide="ignore", invalid="ignore"):
        gate = around.hiding(radius)[..., 0]
        back = framed(gate, passage.speed_out, passage.slope_out, height)
    return beyond, back & (passage.speed_out > 0)


def _caught(passage: Passage, bat: RestingBat, stop: StopSpec) -> NDArray[np.bool_] | bool:
    """Return which balls a bat that comes back from its stop may meet again, a bound."""
    lever, speed = bat.axis - bat.place, passage.speed_out
    inertia = beam_of(bat.body).inertia(bat.axis)

    def soonest(rate: Any, speed: Any) -> Any:
        """Return when: of a ball that came off the bat, only as that is back."""
        came = 1 + 1 / np.float64(stop.restitution)
        return stop.angle / rate * np.where(speed > 0, came, 1.0)

    with np.errstate(divide="ignore", invalid="ignore"):
        blow = bat.mass.max() * passage.speed_in.max() * (1 + bat.efficiency.max())
        most, slowest = blow * np.abs(lever).max() / inertia.min(), speed.min()
        if slowest > stop.restitution * most * np.abs(lever).max():
            return False
        if soonest(most, slowest) >= RECORD:
            return False
        rate = bat.mass * passage.speed_in * (1 + bat.efficiency) * lever / inertia
        slow = (rate > 0) & (speed <= stop.restitution * rate * lever)
        return slow & _at_hand(passage, bat, soonest(rate, speed))


def _at_hand(passage: Passage, bat: RestingBat, since: Array) -> NDArray[np.bool_]:
    """Return whether balls may be as high as the bat at some time from `since` to `RECORD` [s]."""
    reach = max(bat.body.profile.outer_diameter) / 2 + passage.radius
    up = passage.slope_out * passage.speed_out
    first, last = (bat.across + (up - passage.gravity / 2 * t) * t for t in (since, RECORD))
    above, falls = (first > reach) & (last > reach), up <= passage.gravity * since
    return np.asarray((since < RECORD) & ~above & ~(falls & (first < -reach)))


def _stopped(passage: Passage, around: Surroundings, chosen: NDArray[np.bool_]) -> Passage:
    """Return flights that end at the first frame that balls on their way back do not clear."""
    shots = np.flatnonzero(chosen)
    if not shots.size:
        return passage
    names = ("speed_out", "drag", "height", "slope_out", "radius", "gravity")
    each: dict[str, Any] = {name: np.asarray(getattr(passage, name)) for name in names}
    some = replace(passage, **{n: v[shots] if v.ndim else v for n, v in each.items()})
    gates, radius = around.hiding(passage.radius), np.asarray(some.radius)[..., None]
    faces = (gates[shots] if gates.ndim > 1 else gates[None]) - around.frame.radius - radius
    _, height = some.outbound(faces)
    frame = GateFrame(around.frame, 0.0)
    first = np.where(frame.clears(height, radius), np.inf, faces).min(axis=1)
    reach = np.full(len(chosen), np.inf)
    reach[shots] = first
    return replace(passage, reach=reach) if np.isfinite(first).any() else passage


def _columns(passage: Passage, count: int, chosen: Any = slice(None)) -> dict[str, Any]:
    """Return what a batch of flights has for each shot, as own arrays."""
    names: tuple[str, ...] = (
        "speed_in",
        "speed_out",
        "drag",
        "height",
        "slope_in",
        "slope_out",
        "plane",
    )
    optional = ("height_out", "plane_out", "reach")
    names += tuple(name for name in optional if getattr(passage, name) is not None)
    whole = {name: np.broadcast_to(getattr(passage, name), (count,)) for name in names}
    return {name: values[chosen].astype(float) for name, values in whole.items()}


def _shared(passage: Passage, count: int, shot: int) -> dict[str, Any]:
    """Return what one shot shares with all of its laboratory, as numbers."""
    names = ("radius", "gravity")
    return {n: float(np.broadcast_to(getattr(passage, n), count)[shot]) for n in names}


def _played(scene: ShotScene, asked: bool) -> Pieces | None:
    """Return the pieces of one shot; None where it was not asked for and closed form does it.

    A blow on the edge of the tip, which the law of the collision takes and no scene, stays in it.
    """
    played = play_pymunk(scene)
    pieces = played.pieces
    if not asked:
        alone = pieces.struck[1:].tolist() == [Target.BAT]
        return None if alone or len(pieces.time) < 2 else pieces
    if len(pieces.time) < 2:
        why = str(played.refused[0]) or "the ball misses"
        raise InputError("", "motion", MotionRung.PYMUNK.value, f"allowed: closed-form; {why}")
    return pieces


def _contacts(pieces: Pieces) -> tuple[int, int]:
    """Return on which pieces the ball comes to the bat, or to what it meets instead, and goes back.

    It goes back after it last touched the bat, before any frame.
    """
    bats = np.flatnonzero(pieces.struck == Target.BAT)
    first = int(bats[0]) if bats.size else 1
    frames = np.flatnonzero(pieces.struck[first + 1 :] == Target.FRAME) + first + 1
    free = slice(first, frames[0] if frames.size else None)
    last = first + int(
        np.flatnonzero(np.isin(pieces.struck[free], (Target.BAT, Target.BAT_AGAIN)))[-1:].sum()
    )
    turned = np.flatnonzero(pieces.state.vx[last : free.stop] < 0)
    return first, last + int(turned[:1].sum())


def _as_flown(scene: ShotScene, pieces: Pieces, first: int, back: int) -> dict[str, Any]:
    """Return what a scene of one shot comes to as flights in and back."""
    once = np.zeros(1, dtype=np.int_)
    begun = pieces.state.part(slice(first - 1, first))
    before = moved(scene, begun, pieces.time[first] - pieces.time[first - 1 : first], once)
    state, up = pieces.state.part(back), scene.frames[0].up
    contact = scene.start.x[0] + AHEAD  # where it would be in closed form
    frames = np.flatnonzero(pieces.struck[back + 1 :] == Target.FRAME) + back + 1
    found = {
        "speed_in": before.vx[0],
        "plane": contact - before.x[0],
        "speed_out": -state.vx,
        "slope_out": -state.vy / (state.vx or np.nan),
        "plane_out": contact - state.x,
        "height_out": state.y - up,
        "reach": contact - pieces.state.x[frames[0]] if frames.size else np.inf,
    }
    if pieces.struck[first] != Target.BAT:
        found["height"] = before.y[0] - up
    return found
