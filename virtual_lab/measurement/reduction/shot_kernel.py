"""The algebra of wall hits and of shots, for many sets of constants at once; compiled.

The functions are generalised functions of numpy. Their arguments broadcast over sets of constants,
and the last axis of some is that of shots or balls. Values that do not depend on the shot are
computed once per set. The formulas of `kinematics` are repeated here instead of called, because
numba does not notice changes of other files and would keep the old compiled formula.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import guvectorize

from virtual_lab.files.caches import one_process_at_a_time

RESULTS = (  # fields of `ShotResults`
    *("ball_mass", "bat_speed", "relative_speed", "recoil_rate", "place", "recoil_factor"),
    *("ball_restitution", "collision_efficiency", "restitution", "bat_performance_factor"),
    *("window_ball_restitution", "lot_ball_restitution", "lot_recoil_factor"),
    *("asked_recoil_factor", "lot_restitution", "lot_collision_efficiency"),
    *("rebound_efficiency", "recoil_efficiency"),
)
ROW = "float64[:]"
TYPES = ["boolean"] * 3 + ["float64"] * 15 + [ROW] * 2 + ["boolean[:]", "int64[:]"] + [ROW] * 8
AXES = ["()"] * 18 + ["(ball)"] * 3 + ["(shot)"] * 9


@one_process_at_a_time(
    guvectorize(  # type: ignore[no-untyped-call]
        [f"void({','.join([*TYPES, *[ROW] * len(RESULTS)])})"],
        f"{','.join(AXES)}->{','.join(['(shot)'] * len(RESULTS))}",
        nopython=True,
        cache=True,
    )
)
def shots_of_sets(
    carried: Any,
    by_recoil: Any,
    free: Any,
    asked_pivot: Any,
    ball_speed: Any,
    window_speed: Any,
    turn_rate: Any,
    bat_mass: Any,
    length: Any,
    z_cm: Any,
    inertia_cm: Any,
    pivot: Any,
    aim: Any,
    encoder: Any,
    slope: Any,
    mean_speed: Any,
    place_slope: Any,
    slope_error: Any,
    masses: Any,
    restitutions: Any,
    used: Any,
    ball: Any,
    speed_in: Any,
    speed_out: Any,
    sine: Any,
    place: Any,
    along: Any,
    cosine: Any,
    swing_rate: Any,
    counts: Any,
    ball_mass: Any,
    bat_speed: Any,
    relative_speed: Any,
    recoil_rate: Any,
    struck: Any,
    recoil_factor: Any,
    ball_restitution: Any,
    efficiency: Any,
    restitution: Any,
    factor: Any,
    window_restitution: Any,
    lot_ball_restitution: Any,
    lot_recoil: Any,
    asked_recoil: Any,
    lot_restitution: Any,
    lot_efficiency: Any,
    rebound: Any,
    recoiled: Any,
) -> None:
    """Fill in e_A by Eq. (2) or by angular momentum, e by Eq. (6), BPF by Eq. (5), of shots.

    `carried`: e_A is corrected to the aimed position. `by_recoil`: e_A is computed from the recoil.
    `free`: r is that of a free bat. Other names and units are those of `shot_algebra`.
    """
    axis = length - pivot
    turning = inertia_cm + bat_mass * (axis - z_cm) ** 2
    asked_axis = length - asked_pivot
    asked_turning = inertia_cm + bat_mass * (asked_axis - z_cm) ** 2
    lot_mass, lot, many = 0.0, 0.0, 0
    for each in range(used.size):
        if used[each]:
            lot_mass += masses[each]
            lot += restitutions[each]
            many += 1
    lot_mass /= many
    lot /= many
    for i in range(ball.size):
        own_mass, own = masses[ball[i]], restitutions[ball[i]]
        hit = place[i] + aim - along[i]
        # the line of fire passes the axis at the distance `abreast`; a bat that is not square to it
        # is struck farther out
        abreast = axis - hit
        lever = abreast / cosine[i]
        swung = lever * swing_rate[i]
        relative = speed_in[i] * cosine[i] + swung
        rate = encoder * counts[i]
        # a smooth ball keeps its velocity along the bat and rebounds at right angles to it;
        # a hit off the bat's axis always lowers the measured e_A
        back = (speed_out[i] + speed_in[i] * (1 - cosine[i] ** 2)) / cosine[i]
        by_ball = ((back - swung) / relative + sine[i]) / (1 - sine[i])
        momentum = turning * rate / (own_mass * lever) - speed_in[i]
        by_bat = (momentum / speed_in[i] + sine[i]) / (1 - sine[i])
        off = hit - place[i]
        e_A = (by_bat if by_recoil else by_ball) - (place_slope * off + slope_error)
        at = place[i] if carried else place[i] + off
        # r of a ball of 1 kg about the axis that the procedure requires: e_A hardly depends on the
        # axis, so a misplaced axis changes only the angular momentum above
        if free:
            recoil = 1 / bat_mass + (at - z_cm) ** 2 / inertia_cm
            asked = 1 / bat_mass + (place[i] - z_cm) ** 2 / inertia_cm
        else:
            recoil = (asked_axis - at) ** 2 / asked_turning
            asked = (asked_axis - place[i]) ** 2 / asked_turning
        r, lot_r = own_mass * recoil, lot_mass * recoil
        e = e_A * (1 + r) + r
        e0 = own + slope * (relative - mean_speed)
        nominal = ball_speed + turn_rate * (asked_axis - place[i])
        lot_e0 = lot + slope * (nominal - mean_speed)
        lot_e = e / e0 * lot_e0
        ball_mass[i], bat_speed[i], relative_speed[i] = own_mass, swung, relative
        recoil_rate[i], struck[i], recoil_factor[i] = rate, at + abreast - lever, r
        ball_restitution[i], efficiency[i], restitution[i], factor[i] = e0, e_A, e, e / e0
        window_restitution[i] = own + slope * (window_speed - mean_speed)
        lot_ball_restitution[i], lot_recoil[i], asked_recoil[i] = lot_e0, lot_r, lot_mass * asked
        lot_restitution[i], lot_efficiency[i] = lot_e, (lot_e - lot_r) / (1 + lot_r)
        rebound[i], recoiled[i] = by_ball, by_bat


@one_process_at_a_time(
    guvectorize(  # type: ignore[no-untyped-call]
        [f"void({ROW}, int64[:], {','.join([ROW] * 7)})"],
        "(ball),(hit),(hit),(hit),(hit)->(ball),(ball),(),()",
        nopython=True,
        cache=True,
    )
)
def balls_of_sets(
    masses: Any,
    ball: Any,
    nominal: Any,
    speed_in: Any,
    speed_out: Any,
    restitution: Any,
    faster: Any,
    speed: Any,
    slope: Any,
) -> None:
    """Fill in mean e0 and excess speed of each ball, the mean nominal speed, and the slope of e0.

    The excess speed is the mean measured speed of a ball's hits minus the mean nominal speed of all
    hits [m/s]. The slope of e0 over speed [s/m] is the one within each ball. Its instrumental
    variable is the nominal speed, because the error of a measured speed is in e0, too: the slope is
    the rise of e0 with the nominal speed, divided by that of the measured speed. A hit with a
    negative ball is ignored.
    """
    many, middle = np.zeros(masses.size), np.zeros(masses.size)
    restitution[:], faster[:], speed[0] = 0.0, 0.0, 0.0
    for i in range(ball.size):
        own = ball[i]
        if own >= 0:
            many[own] += 1
            middle[own] += nominal[i]
            speed[0] += nominal[i]
            restitution[own] += speed_out[i] / speed_in[i]
    speed[0] /= many.sum()
    for own in range(masses.size):
        restitution[own] /= many[own]
        middle[own] /= many[own]
    rise, width = 0.0, 0.0
    for i in range(ball.size):
        own = ball[i]
        if own >= 0:
            faster[own] += (speed_in[i] - speed[0]) / many[own]
            off = nominal[i] - middle[own]
            rise += speed_out[i] / speed_in[i] * off
            width += speed_in[i] * off
    slope[0] = rise / width
