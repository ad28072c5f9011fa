"""The dear rung: a pymunk space carries ball and bat, one shot at a time.

Between contacts each step is given the mean velocity of the exact motion, so that its length
costs no accuracy. Ball and bat never collide in pymunk: the step that would bring them together
ends at their touch, and the collision model's e_A and the angular momentum say how they part.
Stops act at their angle. Frames and walls are pymunk's own shapes: a swept circle tells when the
ball comes to one, the step ends there, and pymunk throws the ball back.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.flight import distance_after, time_after
from virtual_lab.simulation.motion.closed_form import EDGE, FOLLOWED, GRAZED, effective
from virtual_lab.simulation.motion.outcome import BAT, BAT_AGAIN, STOP, Events, Outcome
from virtual_lab.simulation.motion.scene import Scene, State
from virtual_lab.simulation.motion.settings import Settings
from virtual_lab.simulation.motion.space import Space
from virtual_lab.simulation.motion.touch import (
    Nearness,
    after_contact,
    first_touch,
    moved,
    nearness,
)
from virtual_lab.simulation.motion.track import Track
from virtual_lab.simulation.physics.coasting import time_to_turn, turned

__all__ = ["RUNG", "MissedContactError", "play_pymunk"]

Array = NDArray[np.float64]
RUNG = "pymunk"
DEEP = 1e-6  # m, an overlap that no rounding explains
BEYOND = 1e-9  # m, by which a ball must overlap an obstacle for pymunk to see it
MOST_CONTACTS = 100
ONE = np.zeros(1, dtype=np.int_)


class MissedContactError(RuntimeError):
    """Ball and bat overlap or have passed through each other: a fault of this program."""


class RefusedError(Exception):
    """What this rung cannot do either; its text is the reason."""


def play_pymunk(scene: Scene, settings: Settings | None = None) -> Outcome:
    """Return what the shots come to; those refused hold NaN.

    Raises
    ------
    InputError
        Unsafe settings, or from the scene's `efficiency`.
    MissedContactError
        A contact that should have been was not.
    """
    settings = settings or Settings.safe(scene)
    settings.check(scene)
    return carried(scene, settings)


def carried(scene: Scene, settings: Settings) -> Outcome:
    """Return what the shots come to by settings as they are."""
    shots = [_Shot(scene.part(slice(i, i + 1)), settings) for i in range(len(scene))]
    for shot in shots:
        shot.play()
    count = len(shots)

    def column(name: str, *shape: int) -> Array:
        return np.array([getattr(shot, name) for shot in shots], dtype=float).reshape(count, *shape)

    rows = [(i, *row) for i, shot in enumerate(shots) for row in shot.events]
    return Outcome(
        rung=np.full(count, RUNG),
        reason=np.full(count, f"{RUNG} was asked for"),
        refused=np.array([shot.refused for shot in shots], dtype=np.str_),
        time=column("time"),
        place=column("place"),
        relative_speed=column("relative_speed"),
        collision_efficiency=column("efficiency"),
        ball_velocity=column("ball_velocity", 3),
        bat_rate=column("bat_rate"),
        end=State.of(**{n: [getattr(s.state, n)[0] for s in shots] for n in State.__slots__}),
        pivot_drift=column("drift"),
        events=Events.of(rows),
        track=Track.of(scene, [shot.pieces(i) for i, shot in enumerate(shots)]),
    )


@dataclass(slots=True)
class _Shot:
    """One shot on its way."""

    scene: Scene
    settings: Settings
    now: float = 0.0
    touching: bool = False
    refused: str = ""
    time: float = np.nan
    place: float = np.nan
    relative_speed: float = np.nan
    efficiency: float = np.nan
    ball_velocity: Array = field(default_factory=lambda: np.full(3, np.nan))
    bat_rate: float = np.nan
    drift: float = 0.0
    events: list[tuple[float, str, float, float]] = field(default_factory=list)
    state: State = field(init=False)
    begun: list[tuple[float, State]] = field(init=False)  # free motion, from when and where
    space: Space = field(init=False)
    ahead: tuple[Any, str] = (None, "")  # the shape this step ends at, and its kind

    def __post_init__(self) -> None:
        self.state = self.scene.start
        self.begun = [(0.0, self.state)]
        self.space = Space(self.scene, self.settings)

    def play(self) -> None:
        """Carry the shot to the end of the record."""
        try:
            while self.now < self.scene.duration:
                self._step(min(self.settings.step, self.scene.duration - self.now))
        except RefusedError as why:
            self.refused = str(why)
            self._forget()

    def _forget(self) -> None:
        nothing = np.full(1, np.nan)
        self.time = self.place = self.relative_speed = self.efficiency = self.bat_rate = np.nan
        self.ball_velocity = np.full(3, np.nan)
        self.drift = np.nan
        self.state = State(**dict.fromkeys(State.__slots__, nothing))
        self.events, self.begun = [], []

    def pieces(self, shot: int) -> tuple[NDArray[np.int_], Array, State]:
        """Return the pieces of free motion as `Track` takes them."""
        parts = [state for _, state in self.begun]
        names = State.__slots__
        empty = np.zeros(0)
        whole = {n: np.concatenate([empty, *(getattr(s, n) for s in parts)]) for n in names}
        times = np.array([time for time, _ in self.begun])
        return np.full(len(parts), shot), times, State(**whole)

    def _step(self, step: float) -> None:
        """Go a step, or to the first contact within it."""
        before, self.ahead = self.state, (None, "")
        touch = self._touch(step)
        stop = self._stop(min(step, touch))
        solid = self._solid(min(step, touch, stop))
        span = min(step, touch, stop, solid)
        mean = self._carry(span)
        self.now += span
        if len(self.events) > MOST_CONTACTS:
            raise RefusedError(f"more than {MOST_CONTACTS} contacts in one record")
        if solid <= span:
            self._rebound(mean)
        elif stop <= span:
            self._turn_back()
        elif touch <= span:
            self._strike()
        else:
            self._assert_apart(before)
            return
        self.begun.append((self.now, self.state))

    def _carry(self, span: float) -> Array:
        """Let pymunk move the bodies by their mean velocities, then give them their own.

        Returns that mean velocity of the ball in the plan, (2,).
        """
        if span == 0:
            return np.zeros(2)
        start, space, time = self.state, self.space, np.array([span])
        after = moved(self.scene, start, time)
        speed = np.hypot(start.vx, start.vz)
        way = distance_after(time, speed, self.scene.balls.drag)
        share = way / (speed * span) if speed[0] > 0 else np.zeros(1)
        given = float((start.vx * share)[0]), float((start.vz * share)[0])
        rate = float(turned(start.rate, time, **self.scene.bat.friction)[0]) / span
        place = float(start.x[0]), float(start.z[0])
        space.carry(place, given, float(start.angle[0]), rate, span, self.ahead[0])
        self.drift = max(self.drift, space.drift)
        x, z = space.ball.position
        angle = np.array([space.bat.angle])
        self.state = replace(after, x=np.array([x]), z=np.array([z]), angle=angle)
        return np.array(given)

    def _touch(self, step: float) -> float:
        """Return when ball and bat touch within a step [s], inf if they do not."""
        start, bat = self.state, self.scene.bat
        z = float(start.z[0]) - bat.axis
        x, (beside, _) = float(start.x[0]), self._beside(start)
        swept = np.hypot(start.vx[0], start.vz[0]) + abs(start.rate[0]) * np.hypot(x, z)
        if abs(beside) > self.scene.balls.radius + bat.barrel.widest + 2 * swept * step:
            self.touching = False
            return np.inf
        found = first_touch(self.scene, start, np.array([step]), parting=self.touching)
        return float(found[0])

    def _stop(self, step: float) -> float:
        """Return when the bat reaches a stop within a step [s], inf if it does not."""
        stops = self.scene.stops
        rate = self.state.rate
        if not stops or rate[0] == 0:
            return np.inf
        limit = stops.high if rate[0] > 0 else stops.low
        time = time_to_turn(rate, limit - self.state.angle, **self.scene.bat.friction)[0]
        return float(time) if time <= step else np.inf

    def _solid(self, step: float) -> float:
        """Return when the ball comes to an obstacle within a step [s], inf if it does not."""
        if not self.scene.obstacles or step == 0:
            return np.inf
        balls, start = self.scene.balls, self.state
        after = moved(self.scene, start, np.array([step]))
        here, there = ((float(s.x[0]), float(s.z[0])) for s in (start, after))
        speed = float(np.hypot(start.vx[0], start.vz[0]))
        way = float(np.hypot(there[0] - here[0], there[1] - here[1]))
        for share, solid, obstacle in self.space.ahead(here, there):
            time = float(time_after(share * way + BEYOND, speed, balls.drag[0]))
            height = moved(self.scene, start, np.array([time])).y
            if obstacle.meets(height, balls.radius)[0]:
                self.ahead = solid, obstacle.kind
                return time
        return np.inf

    def _strike(self) -> None:
        """Part ball and bat by the collision model."""
        scene = self.scene
        near = nearness(scene, self.state)
        if not 0 <= near.place[0] <= scene.bat.barrel.length:
            raise RefusedError(EDGE)
        if near.approach[0] <= 0:
            raise RefusedError(GRAZED)
        efficiency = effective(scene, near, ONE)
        self.state = after_contact(scene, self.state, near, efficiency)
        if nearness(scene, self.state).opening[0] <= 0:
            raise RefusedError(FOLLOWED)
        self.touching = True
        first = np.isnan(self.time)
        if first:
            self._remember(near, efficiency)
        kind = BAT if first else BAT_AGAIN
        self.events.append((self.now, kind, float(near.place[0]), float(near.approach[0])))

    def _remember(self, near: Nearness, efficiency: Array) -> None:
        self.time, self.place = self.now, float(near.place[0])
        self.relative_speed, self.efficiency = float(near.approach[0]), float(efficiency[0])
        state = self.state
        self.ball_velocity = np.array([state.vx[0], state.vy[0], state.vz[0]])
        self.bat_rate = float(state.rate[0])

    def _turn_back(self) -> None:
        stops, rate = self.scene.stops, self.state.rate
        assert stops
        limit = stops.high if rate[0] > 0 else stops.low
        self.events.append((self.now, STOP, limit, abs(float(rate[0]))))
        self.state = replace(self.state, angle=np.array([limit]), rate=-stops.restitution * rate)

    def _rebound(self, mean: Array) -> None:
        """Take the velocity pymunk gave the ball, scaled from the step's mean to its end's."""
        went = np.array(self.space.ball.velocity)
        change = went - mean
        if not change.any():
            raise MissedContactError(f"pymunk saw no contact with an obstacle at {self.now:.9g} s")
        state = self.state
        share = np.hypot(state.vx[0], state.vz[0]) / np.hypot(*mean)
        speed = float(-share * (mean @ change) / np.hypot(*change))
        self.events.append((self.now, self.ahead[1], float(state.z[0]), speed))
        self.state = replace(state, vx=share * went[:1], vz=share * went[1:])

    def _assert_apart(self, before: State) -> None:
        """Raise where a contact was missed."""
        bat, radius = self.scene.bat, self.scene.balls.radius
        after = self.state
        for obstacle in self.space.within(DEEP):
            if obstacle.meets(after.y, radius)[0]:
                raise RefusedError(f"the ball comes on a {obstacle.kind} from above or below")
        (was, _), (beside, lever) = self._beside(before), self._beside(after)
        near = radius + bat.barrel.widest
        if abs(beside) > near and was * beside > 0:
            return
        here = nearness(self.scene, after)
        height = max(abs(float(before.y[0])), abs(float(after.y[0])))
        through = was * beside < 0 and 0 < bat.axis - lever < bat.barrel.length
        if here.gap[0] < -DEEP or (through and height < radius):
            raise MissedContactError(f"ball and bat met unseen by {self.now:.9g} s")

    def _beside(self, state: State) -> tuple[float, float]:
        """Return the ball's place across and along the bat, from its axis [m]."""
        x, z = float(state.x[0]), float(state.z[0]) - self.scene.bat.axis
        cos, sin = np.cos(state.angle[0]), np.sin(state.angle[0])
        return float(x * cos + z * sin), float(x * sin - z * cos)
