"""Bats, balls and collisions from which the paper's claims are computed, each once.

Places are in inches and speeds in mph here, as in the paper; a bat is named as in the catalog.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatBody
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
    """Return the conditions of the paper's game: pitch speed, swing and its reference inertia."""
    return catalog.load("conditions", CONDITIONS, GameConditions).spec


@lru_cache
def paper_ball(name: str = GAME_BALL) -> BallSpec:
    """Return the data sheet of a ball of the paper."""
    return catalog.load("balls", name, BallSpec).spec


@lru_cache
def rules(procedure: str) -> Procedure:
    """Return a test procedure of the catalog."""
    return catalog.load("procedures", procedure, Procedure).spec


@lru_cache
def body(bat: str) -> BatBody:
    """Return the body of a bat of the catalog."""
    return catalog.load_bat(bat).spec.body


@lru_cache
def beam(bat: str) -> Beam:
    """Return length, mass, balance and inertia of a bat of the catalog."""
    return beam_of(body(bat))


@lru_cache
def profiles_by_swing(bat: str) -> dict[float | None, BatProfile]:
    """Return the profiles of a bat in the standard game, by exponent n.

    I0 of both loaded bats is that of the barrel-loaded bat, as in the paper.
    """
    reference = BARREL if bat in (BARREL, KNOB) else None
    bat_profiles = profiles(bat, swings=SWINGS, reference_inertia=reference)
    return dict(zip(SWINGS, bat_profiles, strict=True))


@lru_cache
def top(bat: str, curve: str, swing: float | None = 0.0) -> Peak:
    """Return the peak of `curve` (e, BPF, e_A or v_f_mph) in the standard game, position in in."""
    return profiles_by_swing(bat)[swing].peaks[curve]


def peak_value(bat: str, curve: str) -> float:
    """Return the maximum of `curve` in the standard game, see `top`."""
    return top(bat, curve).value


def peak_place(bat: str, curve: str) -> float:
    """Return the position of the maximum of `curve` [in from the tip], see `top`."""
    return top(bat, curve).place


def ball_restitution(name: str, speed: float) -> float:
    """Return e0 of a ball at a speed [mph]."""
    return float(paper_ball(name).restitution.at(speed * MPH))


def lead(first: str, second: str, swing: float | None = 0.0) -> float:
    """Return the peak v_f of the first bat minus that of the second [mph]."""
    return top(first, "v_f_mph", swing).value - top(second, "v_f_mph", swing).value


def support(name: str) -> Support:
    """Return a support by name: free, pivoted as in tests, clamped, or held by a spring."""
    supports: dict[str, Support] = {
        "free": Free(),
        "pivoted": Pinned(28 * INCH),
        "clamped": Clamped(33 * INCH),
        "held": Pinned(31 * INCH, 1e6),
    }
    return supports[name]


@lru_cache
def model(bat: str, support_name: str = "free", modes: int = BENDING_MODES) -> ModalModel:
    """Return the modal model of a bat held by a `support`, with the given number of modes."""
    if support_name == "free" and modes == BENDING_MODES:
        return free_model(body(bat))
    return ModalModel.of(body(bat), support(support_name), modes)


def peak_of(
    bat: str | ModalModel,
    z: ArrayLike,
    *,
    support_name: str = "free",
    speed: ArrayLike = 160.0,
    with_ball: str = GAME_BALL,
) -> Collisions:
    """Return collisions at positions `z` [in] and relative speeds [mph], shape (position,)."""
    places = np.atleast_1d(np.asarray(z, dtype=float))
    scenes = Scenes.with_ball(
        paper_ball(with_ball),
        impact_position=places * INCH,
        relative_speed=np.broadcast_to(np.asarray(speed, dtype=float), places.shape) * MPH,
    )
    return (model(bat, support_name) if isinstance(bat, str) else bat).collide(scenes)


def energy_loss(collisions: Collisions) -> Array:
    """Return the share of the energy lost in bending, hoop and ball, shape (position,)."""
    return np.asarray(
        collisions.energy.bending + collisions.energy.hoop + collisions.energy.hysteresis
    )


def recoil(bat: str, z: ArrayLike, support_name: str = "free") -> Array:
    """Return r of a free, pivoted or clamped bat at positions `z` [in], shape (position,)."""
    bat_beam, place, mass = beam(bat), np.asarray(z, dtype=float) * INCH, paper_ball().mass
    if support_name == "clamped":
        return np.zeros_like(place)
    if support_name == "pivoted":
        axis = bat_beam.length - 6 * INCH
        return np.asarray(recoil_factor_pivoted(mass, bat_beam.inertia(axis), axis - place))
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
    """Return e by Eq. (6) at impact positions `z` [in] and `speed` [mph], shape (position,)."""
    efficiency = peak_of(
        bat, z, support_name=support_name, speed=speed, with_ball=with_ball
    ).collision_efficiency
    return np.asarray(restitution_from_efficiency(efficiency, recoil(bat, z, support_name)))


def centre_of_percussion_in(bat: str) -> float:
    """Return the centre of percussion [in from the tip], for a pivot 6 in from the knob."""
    bat_beam = beam(bat)
    pivot = bat_beam.length - 6 * INCH
    return (
        float(centre_of_percussion(bat_beam.z_cm, bat_beam.inertia_cm, bat_beam.mass, pivot)) / INCH
    )


def top_of(z: ArrayLike, e_A: ArrayLike, pitch: float, bat_speed: ArrayLike) -> Peak:
    """Return the peak of v_f [mph] by Eq. (3), with its position [in]; speeds in mph."""
    speeds = batted_speed(np.asarray(e_A), pitch, np.asarray(bat_speed))
    return peak(np.asarray(z, dtype=float), np.asarray(speeds))


def nominal(bat: str, z: ArrayLike, swing: float | None = 0.0) -> Array:
    """Return the bat speed in the standard game [mph] at positions `z` [in]."""
    table = profiles_by_swing(bat)[swing].table
    return np.asarray(np.interp(np.asarray(z, dtype=float), table["z_in"], table["v_bat_mph"]))
