"""Equations of the ball-bat collision, for reduction and studies, not for the simulation.

Symbols: ``e_A`` collision efficiency, ``e`` restitution of ball and bat, ``e0`` of the ball
on a rigid wall, ``r`` recoil factor, ``m`` ball mass, ``M`` bat mass. Every function
broadcasts over numbers and arrays, works in SI (or any coherent units) and passes NaN
through: a shot without a rebound is a result, not an error. Equation numbers are those of
the 2003 paper (source key ``nathan2003``).

`reduce_shot` applies them to a shot in the order of the paper. `compiled_reduction` compiles it,
with the equations, for many sets of constants. Both are in this file because numba's cache only
detects changes in the file of the compiled function.
"""

from __future__ import annotations

from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import KERNEL

Floats = float | NDArray[np.float64]
# names of the results of `reduce_shot`: RESULTS for every set of constants, DETAILS for the best
RESULTS = (
    *("position", "lot_ball_restitution", "lot_recoil_factor", "aimed_recoil_factor"),
    *("bat_performance_factor", "lot_restitution", "lot_collision_efficiency"),
    *("rebound_efficiency", "recoil_efficiency"),
)
DETAILS = (
    *("ball_mass", "bat_speed", "relative_speed", "recoil_rate", "recoil_factor"),
    *("ball_restitution", "collision_efficiency", "restitution"),
)


class ShotConstants(NamedTuple):
    """Constants of `reduce_shot` [SI], numbers or arrays that broadcast with those of the shot."""

    mass: Any  # mass of the bat
    length: Any  # length of the bat
    z_cm: Any  # distance of the center of mass from the barrel tip
    inertia_cm: Any  # moment of inertia of the bat about its center of mass
    turn_rate: Any  # nominal angular rate of the bat
    pivot_from_knob: Any  # distance of the rig's axis from the knob
    aim: Any  # offset of the line of fire from its nominal line
    encoder: Any  # angle per count, times the clock's rate relative to true time
    lot_mass: Any  # mass of the lot's mean ball
    lot_restitution: Any  # e0 of the lot's mean ball
    speed: Any  # speed at which e0 is measured
    slope: Any  # slope of e0 over speed
    place_slope: Any  # slope of e_A over the distance from the tip
    slope_error: Any  # error of the correction of e_A to the aimed position, `efficiency_at_aim`


def collision_efficiency(v_ball: Floats, v_bat: Floats, v_f: Floats) -> Floats:
    """Return e_A = (v_f - v_bat) / (v_ball + v_bat), dimensionless. Eq. (2) of Nathan (2003).

    The arguments are the speeds at impact [m/s], each positive. `v_ball` is the speed of the ball
    toward the bat, and `v_bat` is the speed of the bat toward the ball. `v_f` is the speed of the
    batted ball away from the bat. The arguments broadcast, and NaN gives NaN.
    """
    return (v_f - v_bat) / (v_ball + v_bat)


def batted_speed(e_A: Floats, v_ball: Floats, v_bat: Floats) -> Floats:
    """Return the batted-ball speed e_A v_ball + (1 + e_A) v_bat [m/s]. Eq. (3) of Nathan (2003).

    `v_ball` is the speed of the ball toward the bat [m/s], and `v_bat` is the speed of the bat
    toward the ball [m/s].
    """
    return e_A * v_ball + (1 + e_A) * v_bat


def besr(e_A: Floats) -> Floats:
    """Return the ball exit speed ratio e_A + 1/2, dimensionless. Eq. (4) of Nathan (2003)."""
    return e_A + 0.5


def bat_performance_factor(e: Floats, e0: Floats) -> Floats:
    """Return the bat performance factor e / e0, dimensionless. Eq. (5) of Nathan (2003)."""
    return e / e0


def restitution_from_efficiency(e_A: Floats, r: Floats) -> Floats:
    """Return the restitution e = e_A (1 + r) + r of ball and bat, dimensionless.

    `r` is the recoil factor. Source: Eq. (6) of Nathan (2003).
    """
    return e_A * (1 + r) + r


def efficiency_from_restitution(e: Floats, r: Floats) -> Floats:
    """Return the collision efficiency e_A = (e - r) / (1 + r), dimensionless.

    `r` is the recoil factor. Source: Eq. (6) of Nathan (2003).
    """
    return (e - r) / (1 + r)


def recoil_factor(m: Floats, inverse_M_eff: Floats) -> Floats:
    """Return the recoil factor r = m / M_eff, dimensionless. Eq. (7) of Nathan (2003).

    `m` is the mass of the ball [kg], and `inverse_M_eff` is 1/M_eff of the bat [1/kg].
    """
    return m * inverse_M_eff


def inverse_mass_free(M: Floats, I_cm: Floats, d: Floats) -> Floats:
    """Return 1/M_eff = 1/M + d²/I_cm [1/kg] of a free bat. Eq. (8) of Nathan (2003).

    `M` is the mass of the bat [kg] and `I_cm` its moment of inertia about the center of mass
    [kg m²]. `d` is the distance of the impact from the center of mass [m].
    """
    return 1 / M + d**2 / I_cm


def inverse_mass_pivoted(I_p: Floats, b: Floats) -> Floats:
    """Return 1/M_eff = b²/I_p [1/kg] of a pivoted bat. Eq. (9) of Nathan (2003).

    `I_p` is the moment of inertia about the pivot [kg m²], and `b` is the distance of the impact
    from the pivot [m].
    """
    return b**2 / I_p


def recoil_factor_free(m: Floats, M: Floats, I_cm: Floats, d: Floats) -> Floats:
    """Return the recoil factor r of a free bat, dimensionless. Eqs. (7) and (8) of Nathan (2003).

    `m` is the mass of the ball [kg], `M` the mass of the bat [kg], and `I_cm` the bat's moment of
    inertia about its center of mass [kg m²]. `d` is the distance of the impact from the center of
    mass [m].
    """
    return recoil_factor(m, inverse_mass_free(M, I_cm, d))


def recoil_factor_pivoted(m: Floats, I_p: Floats, b: Floats) -> Floats:
    """Return the recoil factor r of a pivoted bat, dimensionless.

    `m` is the mass of the ball [kg], and `I_p` the bat's moment of inertia about the pivot [kg m²].
    `b` is the distance of the impact from the pivot [m]. Source: Eqs. (7) and (9) of Nathan (2003).
    """
    return recoil_factor(m, inverse_mass_pivoted(I_p, b))


def parallel_axis(I_cm: Floats, M: Floats, d: Floats) -> Floats:
    """Return the moment of inertia I_cm + M d² [kg m²] about an axis beside the center of mass.

    `I_cm` is the moment of inertia about the center of mass [kg m²], `M` is the mass [kg], and `d`
    is the distance of the axis from the center of mass [m].
    """
    return I_cm + M * d**2


def centre_of_percussion(z_cm: Floats, I_cm: Floats, M: Floats, z_pivot: Floats) -> Floats:
    """Return the distance of the center of percussion from the barrel tip [m].

    An impact there exerts no force on the pivot. `z_cm` and `z_pivot` are the distances of center
    of mass and pivot from the barrel tip [m]. `I_cm` is the bat's moment of inertia about its
    center of mass [kg m²], and `M` is its mass [kg]. The position tends to infinity as the pivot
    approaches the center of mass. Source: Eq. (11) of Nathan (2003).
    """
    return z_cm - I_cm / (M * (z_pivot - z_cm))


def rebound_speed_from_recoil(
    I_p: Floats, omega: Floats, m: Floats, b: Floats, v_ball: Floats
) -> Floats:
    """Return the rebound speed v_f of a ball [m/s], from the recoil of a pivoted bat.

    The bat was at rest before the hit. The angular momentum about the pivot is conserved:

    ``I_p omega = m b (v_ball + v_f)``

    Parameters
    ----------
    I_p
        Moment of inertia of the bat about the pivot [kg m²].
    omega
        Angular rate of the bat after contact [rad/s].
    m
        Mass of the ball [kg].
    b
        Distance of the impact from the pivot [m].
    v_ball
        Speed of the incoming ball [m/s].
    """
    return I_p * omega / (m * b) - v_ball


def impact_position(aimed: Floats, aim: Floats, along: Floats) -> Floats:
    """Return the distance from the barrel tip at which a ball met the bat [m].

    The result is `aimed` + `aim` - `along`.

    Parameters
    ----------
    aimed
        Impact position that is expected if the line of fire has the offset `along` [m].
    aim
        Offset of the line of fire from its nominal line [m], positive toward the knob. An
        uncertainty budget varies it.
    along
        Calibrated value of this offset [m]. If `aim` is equal to `along`, the result is `aimed`.
    """
    return aimed + aim - along


def square_rebound(v_in: Floats, v_out: Floats, cosine: Floats) -> Floats:
    """Return the component of a ball's rebound velocity at right angles to the bat [m/s].

    The ball is taken as smooth: it keeps its velocity component along the bat.

    Parameters
    ----------
    v_in
        Speed of the incoming ball along the line of fire [m/s].
    v_out
        Speed of the rebounding ball along the line of fire [m/s].
    cosine
        Cosine of the angle by which the bat is tilted. It is 1 if the bat is square to the line of
        fire.
    """
    return (v_out + v_in * (1 - cosine**2)) / cosine


def head_on_efficiency(e_A: Floats, sine_square: Floats) -> Floats:
    """Return e_A of a head-on hit, given `e_A` of a hit off the bat's axis.

    e_A is lower off the axis. `sine_square` is sin² of the contact angle, which is 0 on the axis.
    All numbers are dimensionless, and the arguments broadcast.
    """
    return (e_A + sine_square) / (1 - sine_square)


def efficiency_at_aim(e_A: Floats, off: Floats, slope: Floats, error: Floats) -> Floats:
    """Return e_A at the aimed position, given `e_A` at the actual impact position.

    e_A is the collision efficiency. The result is ``e_A - (slope * off + error)``.

    Parameters
    ----------
    off
        Distance of the actual from the aimed position, positive toward the knob [m].
    slope
        Slope of e_A over the distance from the tip [1/m].
    error
        Error of ``slope * off``, without a unit. It is 0 except when an uncertainty budget varies
        it.
    """
    return e_A - (slope * off + error)


def restitution_at_speed(e0: Floats, slope: Floats, faster: Floats) -> Floats:
    """Return the ball-wall restitution at another speed than the speed at which `e0` applies.

    `faster` is the other speed minus the speed at which `e0` applies [m/s]. `slope` is the slope of
    e0 over speed [s/m].
    """
    return e0 + slope * faster


def restitution_of_standard_ball(e: Floats, e0: Floats, standard: float) -> Floats:
    """Return e with a ball of restitution `standard`, from `e` measured with a ball of `e0`.

    All are dimensionless, and NaN gives NaN. In the model, an elastic shell and a lossy ball share
    the energy by the ratio R of their stiffnesses (shell/ball): ``e^2 = (e0^2 R + 1)/(R + 1)``. R
    therefore follows from e and e0. If e is not above e0, the shell has no measurable elasticity.
    The result is then `e` times `standard` / `e0`, as for a rigid shell.
    """
    e, e0 = np.asarray(e), np.asarray(e0)
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffer = (1 - e**2) / (e**2 - e0**2)
        sprung = np.sqrt((standard**2 * stiffer + 1) / (stiffer + 1))
    return np.where(e > e0, sprung, e * standard / e0)


def inverse_effective_mass(
    free: bool, M: Floats, I_cm: Floats, z_cm: Floats, axis: Floats, z: Floats
) -> Floats:
    """Return 1/M_eff [1/kg] of a bat that is free or pivoted at `axis`.

    `M` is the mass of the bat [kg], and `I_cm` its moment of inertia about the center of mass
    [kg m²]. `z_cm`, `axis` and `z` are the distances of center of mass, pivot and impact from the
    barrel tip [m]. If `free` is true, `axis` has no effect. Source: Eqs. (8) and (9) of Nathan
    (2003).
    """
    if free:
        return inverse_mass_free(M, I_cm, z - z_cm)
    return inverse_mass_pivoted(parallel_axis(I_cm, M, axis - z_cm), axis - z)


def reduce_shot(
    settings: Any, constants: ShotConstants, ball: Any, shot: Any
) -> tuple[tuple[Floats, ...], tuple[Floats, ...]]:
    """Return two tuples for a shot: the values named in `RESULTS`, and those in `DETAILS` [SI].

    Each argument is a tuple of numbers, or of arrays that broadcast.

    Parameters
    ----------
    settings
        Three bools, then two numbers:

        * whether e_A is corrected to the aimed position;
        * whether e_A is computed from the recoil;
        * whether r is computed for a free bat;
        * distance of the axis from the knob that the procedure requires [m];
        * nominal speed of the ball [m/s].
    constants
        Properties of bat, rig and lot.
    ball
        Mass [kg] and e0 of the ball.
    shot
        Values of the shot, in this order:

        * speeds of the ball before and after [m/s];
        * sin² of the contact angle;
        * aimed position [m];
        * known offset of the line of fire along the bat [m];
        * cosine of the bat's angle;
        * angular rate of the swing [rad/s];
        * rate of the recoil [counts/s].
    """
    at_aim, by_recoil, free, pivot_from_knob, ball_speed = settings
    M, I_cm, z_cm, length = constants.mass, constants.inertia_cm, constants.z_cm, constants.length
    lot_m, slope, mean_speed = constants.lot_mass, constants.slope, constants.speed
    v_in, v_out, sine_square, aimed, along, cosine, swing_rate, counts = shot
    m, mean_e0 = ball
    # The line of fire passes the axis at the distance `abreast`. A bat that is not square to this
    # line is struck farther from the axis.
    axis = length - constants.pivot_from_knob
    struck = impact_position(aimed, constants.aim, along)
    abreast = axis - struck
    b = abreast / cosine
    v_ball, v_bat, omega = v_in * cosine, b * swing_rate, constants.encoder * counts
    # e_A by Eq. (2), from the rebound of the ball, and from the recoil of a bat that was at rest.
    v_f = square_rebound(v_in, v_out, cosine)
    by_ball = head_on_efficiency(collision_efficiency(v_ball, v_bat, v_f), sine_square)
    I_p = parallel_axis(I_cm, M, axis - z_cm)
    v_f = rebound_speed_from_recoil(I_p, omega, m, b, v_in)
    by_bat = head_on_efficiency(collision_efficiency(v_in, 0.0, v_f), sine_square)
    efficiency = by_bat if by_recoil else by_ball
    e_A = efficiency_at_aim(
        efficiency, struck - aimed, constants.place_slope, constants.slope_error
    )
    position = aimed if at_aim else struck
    # r by Eqs. (7) to (9), about the axis that the procedure requires. e_A hardly depends on the
    # axis, so a misplaced axis only affects the angular momentum above.
    axis = length - pivot_from_knob
    inverse_M_eff = inverse_effective_mass(free, M, I_cm, z_cm, axis, position)
    r, lot_r = recoil_factor(m, inverse_M_eff), recoil_factor(lot_m, inverse_M_eff)
    aimed_r = recoil_factor(lot_m, inverse_effective_mass(free, M, I_cm, z_cm, axis, aimed))
    # e by Eq. (6) and BPF by Eq. (5), with e0 at the relative speed
    e = restitution_from_efficiency(e_A, r)
    v_rel = v_ball + v_bat
    e0 = restitution_at_speed(mean_e0, slope, v_rel - mean_speed)
    factor = bat_performance_factor(e, e0)
    # e and e_A of the lot's mean ball at the nominal relative speed
    nominal = ball_speed + constants.turn_rate * (axis - aimed)
    lot_e0 = restitution_at_speed(constants.lot_restitution, slope, nominal - mean_speed)
    lot_e = factor * lot_e0
    lot_e_A = efficiency_from_restitution(lot_e, lot_r)
    position = position + abreast - b
    return (
        (position, lot_e0, lot_r, aimed_r, factor, lot_e, lot_e_A, by_ball, by_bat),
        (m, v_bat, v_rel, omega, r, e0, e_A, e),
    )


def reduce_sets(settings: Any, sets: Any, balls: Any, ball: Any, shots: Any, results: Any) -> None:
    """Fill `results` with the results of `reduce_shot` for each shot and each set of constants.

    Parameters
    ----------
    settings
        Settings of `reduce_shot`.
    sets
        Tuple of the constants in the order of `ShotConstants`, each (laboratory, set, 1). A set is
        one combination of values of the constants.
    balls
        Masses [kg] and e0 of the balls, each (laboratory, set, ball).
    ball
        Index of the ball of each shot, (laboratory, set, shot).
    shots
        Readings of the shots in the order of `reduce_shot`, each (laboratory, set, shot).
    results
        Two arrays to fill, each (quantity, laboratory, set, shot). The first is for the quantities
        named in `RESULTS`, the second for those named in `DETAILS`. If the second array is empty,
        it is not filled.
    """
    (masses, restitutions), (results, details) = balls, results
    for n in range(ball.shape[0]):
        for k in range(ball.shape[1]):
            row = (n, k, 0)
            constants = ShotConstants(
                *(sets[0][row], sets[1][row], sets[2][row], sets[3][row], sets[4][row]),
                *(sets[5][row], sets[6][row], sets[7][row], sets[8][row], sets[9][row]),
                *(sets[10][row], sets[11][row], sets[12][row], sets[13][row]),
            )
            for i in range(ball.shape[2]):
                at, hit = (n, k, i), (n, k, ball[n, k, i])
                shot = (
                    *(shots[0][at], shots[1][at], shots[2][at], shots[3][at]),
                    *(shots[4][at], shots[5][at], shots[6][at], shots[7][at]),
                )
                of_ball = masses[hit], restitutions[hit]
                values, more = reduce_shot(settings, constants, of_ball, shot)
                for field in range(len(values)):
                    results[field, n, k, i] = values[field]
                if details.size:
                    for field in range(len(more)):
                        details[field, n, k, i] = more[field]


@cache
def compiled_reduction() -> Any:
    """Return `reduce_sets`, compiled by numba together with all functions of this module.

    The first call compiles it, or reads it from numba's cache.
    """
    from numba import njit, typeof
    from numba.extending import register_jitable

    for value in list(globals().values()):
        if isinstance(value, FunctionType) and value.__module__ == __name__:
            register_jitable(no_cfunc_wrapper=True)(value)
    number, index = (np.broadcast_to(np.zeros(1, kind), (2, 2, 2)) for kind in (float, np.int64))
    settings, sets = (True,) * 3 + (0.0,) * 2, (number,) * len(ShotConstants._fields)
    filled = (np.empty((1, 1, 1, 1)),) * 2
    types = map(typeof, (settings, sets, (number,) * 2, index, (number,) * 8, filled))
    return njit(tuple(types), **KERNEL, error_model="numpy")(reduce_sets)
