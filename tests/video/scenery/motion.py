"""Physical motion of balls and hands before the camera: in meters, x right, y down, over time.

Flights are integrated with gravity and quadratic drag up to a surface, where the normal speed is
reversed and multiplied by the restitution. The result is a fine table of time with a node at each
contact; the ball moves straight between nodes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

__all__ = [
    "GRAVITY",
    "Ball",
    "Carried",
    "Contact",
    "Flight",
    "Motion",
    "Path",
    "Rolling",
    "Surface",
    "Swinging",
    "Thrown",
]

Array = NDArray[np.float64]
Pair = tuple[float, float]

GRAVITY = 9.81  # m/s^2
STEP = 2e-4  # step of the table [s], which is exact to 5e-8 m in free fall
AIR = 1.2  # kg/m^3
SLOWEST = 0.25  # least normal speed of a bounce off a floor [m/s]; a slower ball rolls
FOLLOW = 0.06  # time in which a hand comes to rest after a throw or a catch [s]


@dataclass(frozen=True, kw_only=True)
class Ball:
    """Sphere; `colour` is blue, green, red as shares of the reflected light."""

    diameter: float = 0.073  # m
    mass: float = 0.060  # kg
    drag_coefficient: float = 0.45
    colour: tuple[float, float, float] = (0.05, 0.62, 0.10)
    texture: float = 0.10  # relative amplitude
    gloss: float = 0.15
    facing: int = 1  # seed of the spots

    @property
    def radius(self) -> float:
        """Half the diameter [m]."""
        return self.diameter / 2

    @property
    def drag_per_metre(self) -> float:
        """Deceleration by drag over the speed squared [1/m]."""
        return AIR * self.drag_coefficient * np.pi * self.radius**2 / (2 * self.mass)


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Surface off which a ball bounces: floor at y = `at`, or wall (right, left) at x = `at`."""

    kind: str = "floor"  # floor | right | left
    at: float
    restitution: tuple[float, ...] = (0.75,)  # restitution by contact; the last one repeats
    keeps: float = 0.9  # ratio of the speeds along the surface

    @property
    def axis(self) -> int:
        """Axis of the normal: 0 for x, 1 for y."""
        return 1 if self.kind == "floor" else 0

    @property
    def sign(self) -> float:
        """+1 if the ball approaches in the positive direction, otherwise -1."""
        return -1.0 if self.kind == "left" else 1.0


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Contact of a ball with a surface; velocities are its center's just before and after [m/s]."""

    time: float
    kind: str
    restitution: float  # ratio of the speeds normal to the surface
    velocity_in: Pair
    velocity_out: Pair


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Free flight between two times [s], with the velocities at both [m/s]."""

    start: float
    end: float
    velocity_start: Pair
    velocity_end: Pair


@dataclass(frozen=True, kw_only=True)
class Path:
    """Positions of a ball and of its hand; the first axis of all arrays is that of `t`."""

    t: Array
    x: Array
    y: Array
    turn: Array  # angle in the plane of the picture [rad]
    phases: tuple[tuple[float, str], ...]  # start and name of each phase
    contacts: tuple[Contact, ...] = ()
    flights: tuple[Flight, ...] = ()
    hand: Array | None = None  # (node, 2): position at which the hand would hold a ball
    closed: Array | None = None  # (node,): 1 for a hand closed around the ball, 0 for an open one
    arm_from: Pair | None = None
    string_from: Pair | None = None

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return x and y of the center at these times [m]."""
        return np.interp(time, self.t, self.x), np.interp(time, self.t, self.y)

    def hand_at(self, time: float) -> tuple[Pair, float]:
        """Return the position of the hand [m], and its closure from 0 to 1."""
        x, y = (float(np.interp(time, self.t, self.hand[:, k])) for k in (0, 1))
        return (x, y), float(np.interp(time, self.t, self.closed))

    def phase(self, time: float) -> str:
        """Return the phase of the motion: hand, flight, rolling or pendulum."""
        return next(name for start, name in reversed(self.phases) if start <= time)


class Motion(Protocol):
    """Motion of a ball, of any kind."""

    def path(self, ball: Ball, until: float) -> Path:
        """Return the path from time 0 to at least `until` [s]."""
        ...


@dataclass(frozen=True, kw_only=True)
class Thrown:
    """A ball that is held by a hand, thrown or dropped, bounces, and may be caught.

    Without `arm_from` there is no hand. If `released` is 0, the ball flies from the start.
    """

    place: Pair  # position at release [m]
    velocity: Pair = (0.0, 0.0)  # velocity at release [m/s]
    released: float = 0.0  # time of release [s]
    run_up: float = 0.25  # time in which the hand accelerates the ball [s]
    arm_from: Pair | None = None
    surfaces: tuple[Surface, ...] = ()
    caught: float | None = None  # time of the catch [s]
    rolls: bool = False  # rolling on a table, at the velocity of release, before it

    def path(self, ball: Ball, until: float) -> Path:
        until = max(until, (self.caught or self.released) + 0.1)
        end = until if self.caught is None else min(until, self.caught)
        legs = list(self._legs(ball, end))
        t = np.concatenate([leg.t for leg in legs])
        places = np.concatenate([leg.places for leg in legs])
        phases = [(leg.t[0], leg.phase) for leg in legs]
        last = legs[-1]
        flying = [leg for leg in legs if leg.phase == "flight"]
        if self.released > 0:
            before = np.arange(0, self.released, STEP)
            t, places = np.append(before, t), np.concatenate([self._held(before), places])
            phases.insert(0, (0.0, "rolling" if self.rolls else "hand"))
        if self.caught is not None and until > end:
            after = np.arange(end + STEP, until + STEP, STEP)
            slowed = FOLLOW * (1 - np.exp(-(after - end) / FOLLOW))[:, None]
            t = np.append(t, after)
            places = np.concatenate([places, last.places[-1] + last.velocity_end * slowed])
            phases.append((end, "hand"))
        hand, closed = self._hand(t, places) if self.arm_from else (None, None)
        return Path(
            t=t,
            x=places[:, 0],
            y=places[:, 1],
            turn=_turn(t, places, ball.radius),
            phases=tuple(phases),
            contacts=tuple(leg.contact for leg in legs if leg.contact),
            flights=tuple(
                Flight(
                    start=float(leg.t[0]),
                    end=float(leg.t[-1]),
                    velocity_start=_pair(leg.velocity_start),
                    velocity_end=_pair(leg.velocity_end),
                )
                for leg in flying
            ),
            hand=hand,
            closed=closed,
            arm_from=self.arm_from,
        )

    def _legs(self, ball: Ball, until: float) -> Iterator["_Leg"]:
        state, time = np.array([*self.place, *self.velocity]), self.released
        bounced = dict.fromkeys(self.surfaces, 0)
        while time < until:
            leg, touched = _fly(ball, state, time, until, self.surfaces)
            time, velocity = float(leg.t[-1]), leg.velocity_end.copy()
            if touched is None:
                yield leg
                return
            count = bounced[touched]
            bounced[touched] += 1
            restitution = touched.restitution[min(count, len(touched.restitution) - 1)]
            velocity[touched.axis] *= -restitution
            velocity[1 - touched.axis] *= touched.keeps
            rolls = touched.kind == "floor" and -velocity[1] < SLOWEST
            if not rolls:
                leg.contact = Contact(
                    time=time,
                    kind="floor" if touched.kind == "floor" else "wall",
                    restitution=restitution,
                    velocity_in=_pair(leg.velocity_end),
                    velocity_out=_pair(velocity),
                )
            yield leg
            if rolls:
                yield _roll(leg.places[-1], velocity[0], time, until)
                return
            state = np.array([*leg.places[-1], *velocity])

    def _held(self, t: Array) -> Array:
        """Return positions in the hand, where the speed grows by a smooth step up to release."""
        if self.rolls:
            return np.array(self.place) - (self.released - t)[:, None] * np.array(self.velocity)
        u = np.clip(1 - (self.released - t) / self.run_up, 0, 1)
        short = self.run_up * (0.5 - (u**3 - u**4 / 2))
        return np.array(self.place) - short[:, None] * np.array(self.velocity)

    def _hand(self, t: Array, places: Array) -> tuple[Array, Array]:
        """Return the hand's positions and closure: with the ball, after release, up to a catch."""
        free = (t >= self.released) & (t < (self.caught or np.inf))
        after = np.maximum(t - self.released, 0)[:, None]
        follow = np.array(self.place) + np.array(self.velocity) * FOLLOW * (
            1 - np.exp(-after / FOLLOW)
        )
        if self.caught is not None:
            share = np.clip((t - self.released) / (self.caught - self.released), 0, 1)[:, None]
            goal = places[np.searchsorted(t, self.caught)]
            follow = follow + (goal - follow) * share**2 * (3 - 2 * share)
        hand = np.where(free[:, None], follow, places)
        opening = np.clip(after[:, 0] / 0.02, 0, 1)
        closed = np.where(free, 1 - opening, 1.0)
        return hand, closed


@dataclass(frozen=True, kw_only=True)
class Carried:
    """A ball that a hand moves quickly and slowly, and never releases."""

    centre: Pair = (0.0, 0.0)
    reach: Pair = (0.3, 0.2)  # amplitudes [m]
    period: float = 2.2  # period [s]
    arm_from: Pair = (1.5, 0.5)

    def path(self, ball: Ball, until: float) -> Path:
        t = np.arange(0, until + STEP, STEP)
        turn = 2 * np.pi * t / self.period
        x = self.centre[0] + self.reach[0] * (np.sin(turn) + 0.25 * np.sin(2.3 * turn + 1))
        y = self.centre[1] + self.reach[1] * (np.sin(1.37 * turn + 0.8) + 0.2 * np.sin(3.1 * turn))
        return Path(
            t=t,
            x=x,
            y=y,
            turn=0.3 * np.sin(turn),
            phases=((0.0, "hand"),),
            hand=np.stack([x, y], axis=1),
            closed=np.ones(t.size),
            arm_from=self.arm_from,
        )


@dataclass(frozen=True, kw_only=True)
class Swinging:
    """A ball on a string, by the full equation of a pendulum with a little friction."""

    pivot: Pair
    length: float = 0.9  # distance of the ball's center from the pivot [m]
    amplitude: float = 0.35  # angle of release [rad]
    damping: float = 0.03  # damping rate [1/s]

    def path(self, ball: Ball, until: float) -> Path:
        def rate(_: float, state: Array) -> list[float]:
            pull = -GRAVITY / self.length * np.sin(state[0])
            return [state[1], pull - 2 * self.damping * state[1]]

        t = np.arange(0, until + STEP, STEP)
        solved = solve_ivp(rate, (0, t[-1]), [self.amplitude, 0.0], "DOP853", t, rtol=1e-10)
        angle = solved.y[0]
        return Path(
            t=t,
            x=self.pivot[0] + self.length * np.sin(angle),
            y=self.pivot[1] + self.length * np.cos(angle),
            turn=-angle,
            phases=((0.0, "pendulum"),),
            string_from=self.pivot,
        )


@dataclass(frozen=True, kw_only=True)
class Rolling:
    """A ball that rolls on a table and slows down."""

    place: Pair
    speed: float = 0.9  # initial speed [m/s]
    slowing: float = 0.15  # deceleration [m/s^2]

    def path(self, ball: Ball, until: float) -> Path:
        leg = _roll(np.array(self.place), self.speed, 0.0, until, self.slowing)
        return Path(
            t=leg.t,
            x=leg.places[:, 0],
            y=leg.places[:, 1],
            turn=_turn(leg.t, leg.places, ball.radius),
            phases=((0.0, "rolling"),),
        )


@dataclass(kw_only=True)
class _Leg:
    """Part of a path with one phase."""

    t: Array
    places: Array
    phase: str
    velocity_start: Array
    velocity_end: Array
    contact: Contact | None = None


def _fly(
    ball: Ball, state: Array, start: float, until: float, surfaces: tuple[Surface, ...]
) -> tuple[_Leg, Surface | None]:
    """Return the flight up to the first surface or up to the end, and the surface or None."""
    drag = ball.drag_per_metre

    def rate(_: float, s: Array) -> list[float]:
        slow = drag * np.hypot(s[2], s[3])
        return [s[2], s[3], -slow * s[2], GRAVITY - slow * s[3]]

    def event(surface: Surface):
        def gap(_: float, s: Array) -> float:
            return surface.sign * (surface.at - s[surface.axis]) - ball.radius

        gap.terminal, gap.direction = True, -1
        return gap

    solved = solve_ivp(
        rate,
        (start, until),
        state,
        "DOP853",
        events=[event(surface) for surface in surfaces] or None,
        dense_output=True,
        rtol=1e-10,
        atol=1e-12,
    )
    end = float(solved.t[-1])
    t = np.append(np.arange(start, end - STEP / 2, STEP), end)
    places = solved.sol(t)[:2].T
    touched = next((surfaces[k] for k, t_e in enumerate(solved.t_events or ()) if t_e.size), None)
    leg = _Leg(
        t=t,
        places=places,
        phase="flight",
        velocity_start=state[2:].copy(),
        velocity_end=solved.y[2:, -1].copy(),
    )
    return leg, touched


def _roll(place: Array, speed: float, start: float, until: float, slowing: float = 0.3) -> _Leg:
    t = np.arange(start, until + STEP, STEP)
    rolled = np.minimum(t - start, abs(speed) / slowing)
    way = np.sign(speed) * (abs(speed) * rolled - slowing / 2 * rolled**2)
    places = np.stack([place[0] + way, np.full(t.size, place[1])], axis=1)
    none = np.zeros(2)
    return _Leg(t=t, places=places, phase="rolling", velocity_start=none, velocity_end=none)


def _turn(t: Array, places: Array, radius: float) -> Array:
    """Return the angle of a ball [rad]: a third of that of rolling, plus a constant rate."""
    return (places[:, 0] - places[0, 0]) / (3 * radius) + 0.5 * t


def _pair(values: Array) -> Pair:
    return float(values[0]), float(values[1])
