"""Bats, balls and collisions from which the paper's claims are computed; results are cached.

Positions are in inches and speeds in mph here, as in the paper. Bats have their catalog names.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    centre_of_percussion,
    recoil_factor_free,
    recoil_factor_pivoted,
    restitution_from_efficiency,
)
from virtual_lab.relations.peaks import Peak, peak
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel
from virtual_lab.simulation.collision.scene import Collisions, Scenes
from virtual_lab.simulation.physics.beam import Beam, Clamped, Free, Pinned, Support, beam_of
from virtual_lab.studies.bats.profile import (
    CONDITIONS,
    BatProfile,
    GameConditions,
    free_model,
    profiles,
)
from virtual_lab.units import INCH, MPH, Array

WOOD, ALUMINIUM, BARREL, KNOB = BATS = ("r161", "ea70", "barrel-loaded", "knob-loaded")
SWINGS: tuple[float | None, ...] = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, None)  # None: constant energy
GAME_BALL, BALL = "game-2003", "baseball-2003"  # balls: e0 constant, e0 falling with speed
Z = np.arange(3.0, 8.01, 0.25)  # impact positions from the tip [in]


@lru_cache
def game() -> GameConditions:
    """Return the standard game conditions of the paper in SI units.

    They are the pitch, the swing and the names of the balls.
    """
    return catalog.load("conditions", CONDITIONS, GameConditions).spec


@lru_cache
def paper_ball(name: str = GAME_BALL) -> BallSpec:
    """Return the data sheet of a ball of the catalog, in SI units.

    Raises `InputError` for an unknown ball.
    """
    return catalog.load("balls", name, BallSpec).spec


@lru_cache
def rules(procedure: str) -> Procedure:
    """Return the procedure of the catalog with the name `procedure`, in SI units.

    Raises `InputError` for an unknown procedure.
    """
    return catalog.load("procedures", procedure, Procedure).spec


@lru_cache
def body(bat: str) -> BatBody:
    """Return geometry, material and hoop mode of a bat in SI units, by its catalog name.

    Raises `InputError` for an unknown bat.
    """
    return catalog.load_bat(bat).spec.body


@lru_cache
def beam(bat: str) -> Beam:
    """Return length, mass, balance point and inertia of a bat of the catalog, in SI units.

    Positions are distances from the tip. Raises `InputError` for an unknown bat.
    """
    return beam_of(body(bat))


@lru_cache
def profiles_by_swing(bat: str) -> dict[float | None, BatProfile]:
    """Return the profiles of a bat under standard game conditions, keyed by the swing exponent n.

    The keys are 0, 0.1, 0.2, 0.3, 0.4, 0.5, and None for the law of constant energy. For the
    barrel-loaded and the knob-loaded bat, the reference inertia of the swing law is the inertia of
    the barrel-loaded bat, as in the paper. Raises `InputError` for an unknown bat.
    """
    reference = BARREL if bat in (BARREL, KNOB) else None
    bat_profiles = profiles(bat, swings=SWINGS, reference_bat=reference)
    return dict(zip(SWINGS, bat_profiles, strict=True))


@lru_cache
def top(bat: str, curve: str, swing: float | None = 0.0) -> Peak:
    """Return the largest value of a curve along a bat, and its distance from the tip [in].

    The bat is swung under standard game conditions. The curve is searched from 0.5 to 12 in. Raises
    `KeyError` for an unknown curve or exponent, and `InputError` for an unknown bat.

    Parameters
    ----------
    bat
        Name in the catalog.
    curve
        ``restitution`` (bat-ball restitution e), ``bat_performance_factor``,
        ``collision_efficiency`` (e_A) or ``batted_speed_mph`` (mph).
    swing
        Exponent n of the swing law, 0 to 0.5 in steps of 0.1. None means the law of constant
        energy.
    """
    return profiles_by_swing(bat)[swing].peaks[curve]


def peak_value(bat: str, curve: str) -> float:
    """Return the largest value of a curve along a bat, for swing exponent 0.

    `curve` is ``restitution``, ``bat_performance_factor``, ``collision_efficiency`` (all
    dimensionless) or ``batted_speed_mph`` [mph]. The bat is swung under standard game conditions.
    Positions from 0.5 to 12 in from the tip are searched. Raises `KeyError` for an unknown curve,
    and `InputError` for an unknown bat.
    """
    return top(bat, curve).value


def position_of_peak(bat: str, curve: str) -> float:
    """Return the distance from the tip of the largest value of a curve [in], for swing exponent 0.

    `curve` is ``restitution``, ``bat_performance_factor``, ``collision_efficiency`` or
    ``batted_speed_mph``. The bat is swung under standard game conditions. Positions from 0.5 to 12
    in from the tip are searched. Raises `KeyError` for an unknown curve, and `InputError` for an
    unknown bat.
    """
    return top(bat, curve).place


def ball_restitution(name: str, speed: float) -> float:
    """Return the ball-wall restitution e0 of a ball of the catalog at an impact speed [mph].

    The wall is rigid. Raises `InputError` for an unknown ball.
    """
    return float(paper_ball(name).restitution.at(speed * MPH))


def peak_speed_lead(first: str, second: str, swing: float | None = 0.0) -> float:
    """Return the peak batted-ball speed of one bat minus the peak speed of another bat [mph].

    The result is `first` minus `second`. The bats are swung under standard game conditions. `swing`
    is the exponent n of the swing law, 0 to 0.5 in steps of 0.1; None means the law of constant
    energy. Raises `KeyError` for another exponent, and `InputError` for an unknown bat.
    """
    return (
        top(first, "batted_speed_mph", swing).value - top(second, "batted_speed_mph", swing).value
    )


def support(name: str) -> Support:
    """Return the support of a bat by name: free, pivoted, clamped or held.

    The pivot is 28 in and the clamp 33 in from the tip. ``held`` is a bat held by a hand: a pivot
    on a spring of 1e6 N/m, 31 in from the tip. Raises `InputError` for another name.
    """
    supports: dict[str, Support] = {
        "free": Free(),
        "pivoted": Pinned(28 * INCH),
        "clamped": Clamped(33 * INCH),
        "held": Pinned(31 * INCH, 1e6),
    }
    if name not in supports:
        raise InputError("", "support", name, f"allowed: {', '.join(supports)}")
    return supports[name]


@lru_cache
def model(bat: str, support_name: str = "free", modes: int = BENDING_MODES) -> ModalModel:
    """Return the modal model of a bat of the catalog, with a number of bending modes.

    `support_name` is free, pivoted, clamped or held (by a hand), as in `support`. Raises
    `InputError` for an unknown bat or support.
    """
    if support_name == "free" and modes == BENDING_MODES:
        return free_model(body(bat))
    return ModalModel.of(body(bat), support(support_name), modes)


def collide_at(
    bat: str | ModalModel,
    z: ArrayLike,
    *,
    support_name: str = "free",
    speed: ArrayLike = 160.0,
    with_ball: str = GAME_BALL,
) -> Collisions:
    """Return the collisions of a ball with a bat at rest, one per impact position, in SI units.

    Parameters
    ----------
    bat
        Name in the catalog, or a modal model.
    z
        Distances of the impact positions from the tip [in], one number or shape (position,).
    support_name
        Support of a bat given by name: free, pivoted, clamped or held. It is ignored for a model,
        which contains its support.
    speed
        Relative speed of ball and bat [mph], one number or shape (position,).
    with_ball
        Name of the ball in the catalog.

    Raises
    ------
    InputError
        The bat or the ball is unknown, or a position is beyond the bat.
    KeyError
        The name of the support is unknown.
    """
    places = np.atleast_1d(np.asarray(z, dtype=float))
    scenes = Scenes.with_ball(
        paper_ball(with_ball),
        impact_position=places * INCH,
        relative_speed=np.broadcast_to(np.asarray(speed, dtype=float), places.shape) * MPH,
    )
    return (model(bat, support_name) if isinstance(bat, str) else bat).collide(scenes)


def energy_loss(collisions: Collisions) -> Array:
    """Return the energy lost in a collision, as a share of the ball's initial energy, (position,).

    The share is 0 to 1. It is the sum of the losses in bending, in the hoop mode and in the ball.
    """
    return np.asarray(
        collisions.energy.bending + collisions.energy.hoop + collisions.energy.hysteresis
    )


def recoil(bat: str, z: ArrayLike, support_name: str = "free") -> Array:
    """Return the recoil factor r of a bat at one or more positions, in the shape of `z`.

    `z` are distances from the tip [in]. The ball is ``game-2003``. `support_name` is free, pivoted
    (6 in from the knob) or clamped. For a clamped bat r is 0. Raises `InputError` for an unknown
    bat, and for another support.
    """
    bat_beam, place, mass = beam(bat), np.asarray(z, dtype=float) * INCH, paper_ball().mass
    if support_name == "clamped":
        return np.zeros_like(place)
    if support_name == "pivoted":
        axis = bat_beam.length - 6 * INCH
        return np.asarray(recoil_factor_pivoted(mass, bat_beam.inertia(axis), axis - place))
    if support_name != "free":
        raise InputError("", "support_name", support_name, "allowed: free, pivoted, clamped")
    return np.asarray(
        recoil_factor_free(mass, bat_beam.mass, bat_beam.inertia_cm, place - bat_beam.z_cm)
    )


def restitution(
    bat: str,
    z: ArrayLike,
    support_name: str = "free",
    speed: float = 160.0,
    with_ball: str = GAME_BALL,
) -> Array:
    """Return the bat-ball restitution e by Eq. (6) at one or more positions, (position,).

    `z` are distances from the tip [in]. `support_name` is free, pivoted or clamped. `speed` is the
    relative speed of ball and bat [mph]. `with_ball` is the ball's name in the catalog. Raises
    `InputError` for an unknown bat or ball, and for a position beyond the bat. Raises `KeyError`
    for an unknown support.
    """
    efficiency = collide_at(
        bat, z, support_name=support_name, speed=speed, with_ball=with_ball
    ).collision_efficiency
    return np.asarray(restitution_from_efficiency(efficiency, recoil(bat, z, support_name)))


def centre_of_percussion_in(bat: str) -> float:
    """Return the distance of the center of percussion from the tip [in].

    The bat has a pivot 6 in from the knob. Raises `InputError` for an unknown bat.
    """
    bat_beam = beam(bat)
    pivot = bat_beam.length - 6 * INCH
    return (
        float(centre_of_percussion(bat_beam.z_cm, bat_beam.inertia_cm, bat_beam.mass, pivot)) / INCH
    )


def peak_speed(z: ArrayLike, e_A: ArrayLike, pitch: float, bat_speed: ArrayLike) -> Peak:
    """Return the largest batted-ball speed v_f by Eq. (3) [mph] and its distance from the tip [in].

    Between positions v_f is interpolated by a spline. The maximum may be at an end.

    Parameters
    ----------
    z
        At least four increasing distances from the tip [in], shape (position,).
    e_A
        Collision efficiency at these positions, (position,).
    pitch
        Speed of the pitched ball [mph].
    bat_speed
        Bat speed at these positions [mph], (position,), or a single number.

    Raises
    ------
    ValueError
        The positions do not increase, or a value is not finite.
    """
    speeds = batted_speed(np.asarray(e_A), pitch, np.asarray(bat_speed))
    return peak(np.asarray(z, dtype=float), np.asarray(speeds))


def game_bat_speed(bat: str, z: ArrayLike, swing: float | None = 0.0) -> Array:
    """Return the bat speed at one or more positions [mph], in the shape of `z`.

    `z` are distances from the tip [in]. The bat is swung under standard game conditions. The speed
    is interpolated from 0.5 to 12 in. A position outside this range gets the speed at the nearer
    end of the range. `swing` is the exponent n of the swing law, 0 to 0.5 in steps of 0.1. None
    means the law of constant energy. Raises `KeyError` for another exponent, and `InputError` for
    an unknown bat.
    """
    table = profiles_by_swing(bat)[swing].table
    return np.asarray(
        np.interp(np.asarray(z, dtype=float), table["impact_position_in"], table["bat_speed_mph"])
    )
