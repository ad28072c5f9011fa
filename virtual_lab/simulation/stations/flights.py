"""Models of the motion at a rig: flights in closed form, event-driven, or in pymunk."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import Profile
from virtual_lab.errors import InputError
from virtual_lab.relations.flight import time_before
from virtual_lab.simulation.instruments.calibrated import TrueConstant
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.motion.events import play_events
from virtual_lab.simulation.motion.played import Pieces, PlayedShots, Target
from virtual_lab.simulation.motion.pymunk_scene import play_pymunk
from virtual_lab.simulation.motion.scene import (
    FrameSpec,
    GateFrame,
    PivotedBat,
    ShotScene,
    ShotState,
    StopSpec,
)
from virtual_lab.simulation.motion.touch import move
from virtual_lab.simulation.stations.rig import MotionModel, ShotPlan
from virtual_lab.units import Array

AHEAD = 1.0  # distance before the contact at which a scene begins [m]
# models of the motion that simulate every shot of a plan
PLAYERS: Mapping[MotionModel, Callable[[ShotScene], PlayedShots]] = {
    MotionModel.PYMUNK: play_pymunk
}
RECORD = 0.5  # time after the contact that is simulated if a ball can hit other objects [s]


class Surroundings(NamedTuple):
    """Objects around a bat at rest."""

    frame: FrameSpec
    stop: StopSpec
    gates: Array  # distances of gates and their frames, farthest first, ([shot,] gate) [m]
    # lowest and highest position of a ball's center that a gate can detect [m]
    view: tuple[TrueConstant, TrueConstant]

    def blocking_frames(self, radius: TrueConstant) -> Array:
        """Return the distances [m] of the frames that can stop a rebounding ball before its gate.

        The far frame is left out if it only stops balls that its own gate cannot detect.
        """
        low, high = self.frame.bottom + radius, self.frame.top - radius
        unseen = np.all((low <= self.view[0]) & (high >= self.view[1]))
        return self.gates[..., int(unseen) :]

    def at(self, shots: NDArray[np.int_]) -> Surroundings:
        """Return the objects around the bats of the `shots`."""
        return self._replace(gates=self.gates[shots] if self.gates.ndim > 1 else self.gates)


class RestingBat(NamedTuple):
    """A bat at rest and its collisions, arrays (shot,)."""

    profile: Profile
    axis: Array  # distance of the pivot from the tip [m]
    inertia: Array  # moment of inertia about the pivot [kg m²]
    place: Array  # position of the ball's center, from the tip [m]
    across: Array  # height of the ball's center above the bat's axis [m]
    efficiency: Array  # e_A
    mass: Array  # mass of the ball [kg]


class TrueFlights(NamedTuple):
    """Flights, with further results of shots that were simulated as scenes."""

    passage: Passage
    separation_time: Array | float = 0.0  # time from first contact to final separation [s]
    reached_bat: NDArray[np.bool_] | bool = True  # whether the ball reached the bat
    # shot, time after the first contact [s], and change of the bat's rate [rad/s] by each later one
    kicks: tuple[tuple[int, float, float], ...] = ()


def simulate_flights(
    passage: Passage, plan: ShotPlan, bat: RestingBat, around: Surroundings
) -> TrueFlights:
    """Return the flights of the balls at a pivoted bat at rest, one flight per shot.

    If the plan requests a model of `PLAYERS`, all shots are simulated by it. Otherwise the flights
    are computed in closed form, with these exceptions:

    * If a ball may hit a frame on its way in, or if the bat may return from its stop and hit the
      ball again, the shot is simulated event by event. The simulated flight is used only if the
      ball hits something other than the bat, or hits the bat twice.
    * If a ball may hit a frame only on its way back, the closed form is used and the flight ends at
      the frame. No gate beyond this frame can detect the ball.

    Raises
    ------
    InputError
        The requested model cannot simulate a shot, or a ball hits nothing in it.
    """
    beyond, framed = _beyond_closed_form(passage, bat, around)
    play, count = PLAYERS.get(plan.motion), len(beyond)
    if not play:
        passage = _stop_at_frames(passage, around, framed & ~beyond)
    shots = np.arange(count) if play else np.flatnonzero(beyond)
    if not shots.size:
        return TrueFlights(passage)
    subset = replace(
        passage, **_columns(passage, count, shots), **_common_constants(passage, shots)
    )
    # Without obstacles on the way back one millisecond is enough, because the ball has left the
    # bat.
    after = np.where((beyond | framed)[shots], RECORD, 1e-3)
    bats = RestingBat(bat.profile, *(each[shots] for each in bat[1:]))
    scene = scene_of(subset, bats, around.at(shots), after)
    played = (play or play_events)(scene)
    chosen = _require_contacts(played, plan) if play else _with_further_contacts(played)
    pieces, turns = played.pieces, _piece_rows(played.pieces, len(shots)).part(chosen)
    delay, hit_bat = np.zeros(count), np.ones(count, dtype=bool)
    delay[shots[chosen]] = pieces.time[turns.back] - pieces.time[turns.first]
    hit_bat[shots[chosen]] = pieces.struck[turns.first] == Target.BAT
    columns = _columns(passage, count)
    columns |= {"plane_out": columns["plane"].copy(), "height_out": columns["height"].copy()}
    columns.setdefault("frame_distance", np.full(count, np.inf))
    for name, values in _simulated_columns(scene, subset, pieces, turns).items():
        columns[name][shots[chosen]] = values
    if hit_bat.all() and np.isinf(columns["frame_distance"]).all():
        columns.pop("frame_distance")
    return TrueFlights(replace(passage, **columns), delay, hit_bat, _kicks(pieces, shots))


def scene_of(
    passage: Passage, bat: RestingBat, around: Surroundings, after: Array | float
) -> ShotScene:
    """Return the scene of the shots for a model of the motion.

    A scene starts when the ball is 1 m ahead of the contact. All contacts of a shot have the same
    collision efficiency e_A.

    Parameters
    ----------
    passage
        Flights of the balls.
    bat
        Bat at rest, with the e_A of each shot.
    around
        Objects around the bat.
    after
        Time from the contact to the end of the scene [s], a number or (shot,). The time of the
        contact is computed in closed form.
    """
    pivoted = PivotedBat(bat.profile, bat.axis, bat.inertia)
    touching = -np.sqrt((pivoted.radius(bat.place) + passage.radius) ** 2 - bat.across**2)
    span = time_before(AHEAD, passage.speed_in, passage.drag)
    up = bat.across - passage.height
    return ShotScene(
        start=ShotState.of(
            x=touching - AHEAD,
            y=bat.across - passage.gravity / 2 * span**2,
            z=bat.place,
            vx=passage.speed_in * np.exp(passage.drag * AHEAD),
            vy=passage.gravity * span,
        ),
        ball_mass=bat.mass,
        ball_drag=np.broadcast_to(passage.drag, bat.mass.shape),
        ball_radius=passage.radius,
        bat=pivoted,
        efficiency=lambda _place, _speed, shots: bat.efficiency[shots],
        duration=span + after,
        gravity=passage.gravity,
        stop=around.stop,
        frames=tuple(GateFrame(around.frame, touching - at, up) for at in around.gates.T),
    )


def _beyond_closed_form(
    passage: Passage, bat: RestingBat, around: Surroundings
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return two masks: shots that may need a scene, and rebounds that a frame may stop.

    Both are conservative, so the closed form is valid for all other shots.
    """
    frame, radius, count = around.frame, passage.radius, len(bat.place)

    def reaches_frame(
        gate: Any, speed: Any, slope: Any, height: Any, flights: Passage = passage
    ) -> NDArray[np.bool_]:
        far = gate + frame.radius + flights.radius
        slowest = far * np.exp(flights.drag * far) / speed
        rise, fall = slope * far, flights.gravity / 2 * slowest**2
        low = height + np.minimum(rise, 0.0) - fall <= frame.bottom + flights.radius
        high = height + np.maximum(rise, 0.0) >= frame.top - flights.radius
        return np.asarray(low | high)

    # Rare cases are first tested with the worst values of the batch.
    gate, height, largest = around.gates[..., 0], passage.height, np.max(radius)
    most = {name: np.max(getattr(passage, name)) for name in ("radius", "drag", "gravity")}
    worst = np.array([np.min(height), np.max(height)])
    aside = bat.place.min(), bat.place.max()
    beyond = np.zeros(count, dtype=bool)
    if reaches_frame(
        gate.max(), passage.speed_in.min(), 0.0, worst, replace(passage, **most)
    ).any():
        beyond |= reaches_frame(gate, passage.speed_in, 0.0, height)
    if aside[0] <= frame.tip_side + largest or aside[1] >= frame.knob_side - largest:
        beyond |= bat.place <= frame.tip_side + radius
        beyond |= bat.place >= frame.knob_side - radius
    beyond |= _may_be_hit_again(passage, bat, around.stop)
    with np.errstate(divide="ignore", invalid="ignore"):
        gate = around.blocking_frames(radius)[..., 0]
        rebound_mask = reaches_frame(gate, passage.speed_out, passage.slope_out, height)
    return beyond, rebound_mask & (passage.speed_out > 0)


def _may_be_hit_again(
    passage: Passage, bat: RestingBat, stop: StopSpec
) -> NDArray[np.bool_] | bool:
    """Return a conservative mask of the balls that a bat returning from its stop may hit."""
    lever, speed = bat.axis - bat.place, passage.speed_out

    def soonest(rate: Any, speed: Any) -> Any:
        """Return the earliest time of a second contact [s].

        If the ball rebounded, the bat must first return to its rest position.
        """
        came = 1 + 1 / np.float64(stop.restitution)
        return stop.angle / rate * np.where(speed > 0, came, 1.0)

    with np.errstate(divide="ignore", invalid="ignore"):
        blow = bat.mass.max() * passage.speed_in.max() * (1 + bat.efficiency.max())
        most, slowest = blow * np.abs(lever).max() / bat.inertia.min(), speed.min()
        if slowest > stop.restitution * most * np.abs(lever).max():
            return False
        if soonest(most, slowest) >= RECORD:
            return False
        rate = bat.mass * passage.speed_in * (1 + bat.efficiency) * lever / bat.inertia
        slow = (rate > 0) & (speed <= stop.restitution * rate * lever)
        return slow & _may_be_near_bat(passage, bat, soonest(rate, speed))


def _may_be_near_bat(passage: Passage, bat: RestingBat, since: Array) -> NDArray[np.bool_]:
    """Return a mask of balls that may be at the bat's height between `since` and `RECORD` [s]."""
    contact_distance = max(bat.profile.outer_diameter) / 2 + passage.radius
    up = passage.slope_out * passage.speed_out
    first, last = (bat.across + (up - passage.gravity / 2 * t) * t for t in (since, RECORD))
    above, falls = (
        (first > contact_distance) & (last > contact_distance),
        up <= passage.gravity * since,
    )
    return np.asarray((since < RECORD) & ~above & ~(falls & (first < -contact_distance)))


def _stop_at_frames(passage: Passage, around: Surroundings, chosen: NDArray[np.bool_]) -> Passage:
    """Return the flights, ending at the first frame that the rebounding ball does not clear."""
    shots = np.flatnonzero(chosen)
    if not shots.size:
        return passage
    names = ("speed_out", "drag", "height", "slope_out", "radius", "gravity")
    columns: dict[str, Any] = {name: np.asarray(getattr(passage, name)) for name in names}
    subset = replace(passage, **{n: v[shots] if v.ndim else v for n, v in columns.items()})
    gates, radius = around.blocking_frames(passage.radius), np.asarray(subset.radius)[..., None]
    faces = (gates[shots] if gates.ndim > 1 else gates[None]) - around.frame.radius - radius
    _, height = subset.outbound(faces)
    frame = GateFrame(around.frame, 0.0)
    first = np.where(frame.clears(height, radius), np.inf, faces).min(axis=1)
    limit = np.full(len(chosen), np.inf)
    limit[shots] = first
    return replace(passage, frame_distance=limit) if np.isfinite(first).any() else passage


def _columns(passage: Passage, count: int, chosen: Any = slice(None)) -> dict[str, Any]:
    """Return the values of a batch of flights that differ between shots, as new arrays."""
    names: tuple[str, ...] = (
        "speed_in",
        "speed_out",
        "drag",
        "height",
        "slope_in",
        "slope_out",
        "plane",
    )
    optional = ("height_out", "plane_out", "frame_distance")
    names += tuple(name for name in optional if getattr(passage, name) is not None)
    whole = {name: np.broadcast_to(getattr(passage, name), (count,)) for name in names}
    return {name: values[chosen].astype(float) for name, values in whole.items()}


def _common_constants(passage: Passage, shots: NDArray[np.int_]) -> dict[str, Any]:
    """Return radius and gravity of the `shots`, which are common to a laboratory."""
    constants = {name: np.asarray(getattr(passage, name)) for name in ("radius", "gravity")}
    return {name: values[shots] if values.ndim else values for name, values in constants.items()}


def _require_contacts(played: PlayedShots, plan: ShotPlan) -> NDArray[np.int_]:
    """Return the indices of all shots. Raises `InputError` if one was rejected or hit nothing."""
    contacts = np.bincount(played.pieces.shot, minlength=len(played.refused)) - 1
    for shot in np.flatnonzero(contacts < 1)[:1]:
        why = str(played.refused[shot]) or "the ball misses"
        raise InputError("", "motion", plan.motion.value, f"allowed: closed-form; {why}")
    return np.arange(len(contacts))


def _with_further_contacts(played: PlayedShots) -> NDArray[np.int_]:
    """Return the shots that hit other objects than the bat, or the bat twice.

    A rejected shot stays in closed form. It is a hit on the edge of the tip, which the collision
    model can compute but a scene cannot.
    """
    mask = ~np.isin(played.pieces.struck, (Target.START, Target.BAT))
    return np.unique(played.pieces.shot[mask])


class _PieceRows(NamedTuple):
    """Row numbers of pieces, one per shot; the total number of pieces if there is no such piece."""

    first: NDArray[np.int_]  # first contact, with the bat or another object
    back: NDArray[np.int_]  # start of the rebound, after the last contact with the bat
    frame: NDArray[np.int_]  # contact with a frame during the rebound

    def part(self, chosen: NDArray[np.int_]) -> _PieceRows:
        return _PieceRows(*(each[chosen] for each in self))


def _piece_rows(pieces: Pieces, shots: int) -> _PieceRows:
    """Return the pieces at which the balls change direction."""
    struck, shot = pieces.struck, pieces.shot
    row, at_frame = np.arange(len(shot)), struck == Target.FRAME

    def first_row(true: NDArray[np.bool_]) -> NDArray[np.int_]:
        lowest = np.full(shots, len(row))
        np.minimum.at(lowest, shot[true], row[true])
        return lowest

    first = first_row(struck == Target.BAT)
    first = np.where(first < len(row), first, first_row(struck == Target.START) + 1)
    free = (row >= first[shot]) & (row < first_row(at_frame & (row > first[shot]))[shot])
    blow, last = free & np.isin(struck, (Target.BAT, Target.BAT_AGAIN)), first.copy()
    np.maximum.at(last, shot[blow], row[blow])
    back = first_row(free & (row >= last[shot]) & (pieces.state.vx < 0))
    back = np.where(back < len(row), back, last)
    return _PieceRows(first, back, first_row(at_frame & (row > back[shot])))


def _simulated_columns(
    scene: ShotScene, planned: Passage, pieces: Pieces, turns: _PieceRows
) -> dict[str, Array]:
    """Return the columns that a scene replaces in the `planned` flights."""
    first, shot = turns.first, pieces.shot[turns.first]
    start_state = pieces.state.part(first - 1)
    before = move(scene, start_state, pieces.time[first] - pieces.time[first - 1], shot)
    state, up = pieces.state.part(turns.back), np.asarray(scene.frames[0].up)[shot]
    contact = scene.start.x[shot] + AHEAD  # position of the contact in closed form
    ends = np.append(pieces.state.x, -np.inf)[turns.frame]
    is_miss = pieces.struck[first] != Target.BAT
    return {
        "speed_in": before.vx,
        "plane": contact - before.x,
        "height": np.where(is_miss, before.y - up, np.asarray(planned.height)[shot]),
        "speed_out": -state.vx,
        "slope_out": -state.vy / np.where(state.vx == 0, np.nan, state.vx),
        "plane_out": contact - state.x,
        "height_out": state.y - up,
        "frame_distance": contact - ends,
    }


def _kicks(pieces: Pieces, shots: NDArray[np.int_]) -> tuple[tuple[int, float, float], ...]:
    """Return the changes of the bat's rate by later contacts, see `TrueFlights.kicks`."""
    again = np.flatnonzero(pieces.struck == Target.BAT_AGAIN)
    firsts = np.flatnonzero(pieces.struck == Target.BAT)
    first = firsts[np.searchsorted(pieces.shot[firsts], pieces.shot[again])]
    after = pieces.time[again] - pieces.time[first]
    more = pieces.state.rate[again] - pieces.state.rate[again - 1]
    return tuple(
        zip(shots[pieces.shot[again]].tolist(), after.tolist(), more.tolist(), strict=True)
    )
