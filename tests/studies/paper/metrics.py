"""Results for Sec. II: the metrics, their algebra, and the paper's numerical examples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.studies.paper.computed import (
    ALUMINIUM,
    BALL,
    BATS,
    WOOD,
    Z,
    beam,
    body,
    centre_of_percussion_in,
    collide_at,
    energy_loss,
    paper_ball,
    profiles_by_swing,
    recoil,
    restitution,
    support,
    top,
)
from tests.studies.paper.equations import batted_speed_gain, energy_fractions
from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    besr,
    collision_efficiency,
    efficiency_from_restitution,
    parallel_axis,
    restitution_from_efficiency,
)
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.units import INCH, MPH, Array

SLOW, FAST = 60.0, 160.0  # relative speeds [mph]
E_AND_R = np.meshgrid(np.linspace(0, 1, 11), np.linspace(0, 0.5, 11))


def _worst(values: Array) -> float:
    return float(np.abs(values).max())


def frame_difference() -> float:
    """Return the largest difference of the collision efficiency e_A between two reference frames.

    e_A is computed by Eq. (2) from the speeds in the frame of the field, and compared with e_A in
    the frame of the bat. The absolute difference is returned. In theory it is 0, so the result is
    only a rounding error. R161 is hit 3 to 8 in from the tip at a relative speed of 160 mph, for
    bat speeds from -50 to 160 mph.
    """
    e_A = collide_at(WOOD, Z).collision_efficiency
    v_bat = np.linspace(-50, 160, 8)[:, None]
    v_f = e_A * FAST + v_bat  # the bat's frame moves at v_bat
    return _worst(np.asarray(collision_efficiency(FAST - v_bat, v_bat, v_f)) - e_A)


def round_trip_error() -> float:
    """Return the largest error of e_A after a conversion to batted-ball speed v_f and back.

    v_f is computed from e_A by Eq. (3), and e_A from v_f by Eq. (2). The absolute error is
    returned; it is a rounding error. The collision efficiency e_A is -0.2 to 0.6. The pitch speed
    is 90 mph, and the bat speed is 70 mph.
    """
    e_A = np.linspace(-0.2, 0.6, 9)
    v_f = batted_speed(e_A, 90.0, 70.0)
    return _worst(np.asarray(collision_efficiency(90.0, 70.0, v_f)) - e_A)


def symmetrical_form_error() -> float:
    """Return the largest absolute difference of the batted-ball speed by two computations [mph].

    The first computation uses BESR, the ball exit speed ratio. The second uses e_A, the collision
    efficiency, from -0.2 to 0.6. The pitch speed is 90 mph, and the bat speed is 70 mph. In theory
    both speeds are equal, so the result is only a rounding error.
    """
    e_A = np.linspace(-0.2, 0.6, 9)
    factor = np.asarray(besr(e_A))
    direct = np.asarray(batted_speed(e_A, 90.0, 70.0))
    return _worst((factor - 0.5) * 90 + (factor + 0.5) * 70 - direct)


def speed_slope(bat: str) -> float:
    """Return the absolute slope of the peak e_A of a free bat against relative speed [1/mph].

    The peak is the largest value of e_A, the collision efficiency, along the barrel. The slope is
    the peak at 160 mph minus the peak at 140 mph, divided by 20 mph. The ball-wall restitution of
    the ball decreases with speed. `bat` is the name of the bat. Raises `InputError` for an unknown
    bat.
    """
    return abs(_peak_at(bat, 160) - _peak_at(bat, 140)) / 20


def _peak_at(bat: str, speed: float) -> float:
    """Return the peak e_A at a relative speed [mph]. The e0 of the ball decreases with speed."""
    return float(collide_at(bat, Z, speed=speed, with_ball=BALL).collision_efficiency.max())


def explicit_share(v: str) -> float:
    """Return the direct share of the change of the batted-ball speed with a speed, 0 to 1.

    `v` is ``ball`` or ``bat``, for the speed of the ball or of the bat. This speed has two effects
    on the batted-ball speed:

    * The direct effect is the factor of the speed in Eq. (3). It is the collision efficiency e_A
      for the ball, and 1 + e_A for the bat.
    * The indirect effect is caused by the change of e_A with the relative speed. Its absolute value
      is used.

    The result is the direct effect divided by the sum of both. The bat is the wood bat R161, hit at
    the position of its largest e_A.
    """
    e_A = top(WOOD, "collision_efficiency").value
    factor = e_A if v == "ball" else 1 + e_A
    return factor / (factor + abs(160 * speed_slope(WOOD)))


def drop_beside_peak(bat: str, curve: str, side: float) -> float:
    """Return the decrease of a curve from its peak to a position `side` [in] away from the peak.

    A positive `side` is toward the handle. `curve` is ``restitution``, ``bat_performance_factor``,
    ``collision_efficiency`` (all dimensionless) or ``batted_speed_mph`` [mph], under standard game
    conditions with swing exponent 0. Raises `KeyError` for an unknown curve, and `InputError` for
    an unknown bat.
    """
    summit, table = top(bat, curve), profiles_by_swing(bat)[0.0].table
    return summit.value - float(
        np.interp(summit.place + side, table["impact_position_in"], table[curve])
    )


def distance_to_node() -> float:
    """Return the largest distance between the peak of e_A and the closest barrel node [in].

    e_A is the collision efficiency, and a barrel node is a position at which a bending mode has no
    deflection. The distance is computed for each of the paper's four bats, and the largest of the
    four distances is returned. The peaks are computed under standard game conditions.
    """
    return max(
        min(
            abs(top(bat, "collision_efficiency").place - node / INCH)
            for node in profiles_by_swing(bat)[0.0].nodes
        )
        for bat in BATS
    )


def support_effect(bat: str, support_name: str) -> float:
    """Return the largest absolute change of e_A if a free bat gets a support.

    e_A is the collision efficiency. The bat is hit 3 to 8 in from the tip, at 160 mph.
    `support_name` is pivoted, clamped or held (by a hand), as in `support`. Raises `KeyError` for
    another support, and `InputError` for an unknown bat.
    """
    gap = (
        collide_at(bat, Z, support_name=support_name).collision_efficiency
        - collide_at(bat, Z).collision_efficiency
    )
    return _worst(gap)


def grip_effect() -> float:
    """Return the largest difference of the batted-ball speed between two handle supports [mph].

    The largest absolute difference over the impact positions is returned. The bat is R161, the wood
    bat of the paper. It is at rest and is hit at 160 mph, 3 to 8 in from the tip. One support is a
    clamp. The other is a pivot on a spring (``held`` in `support`).
    """
    on_spring = collide_at(WOOD, Z, support_name="held").collision_efficiency
    return FAST * _worst(
        on_spring - collide_at(WOOD, Z, support_name="clamped").collision_efficiency
    )


def energy_loss_error() -> float:
    """Return the largest absolute deviation of the energy loss of free R161 from 1 - e².

    e is the bat-ball restitution. The loss is divided by the initial energy of ball and bat in
    their center-of-mass frame. The bat is hit 2 to 10 in from the tip, at 160 mph.
    """
    z = np.linspace(2, 10, 9)
    collisions, r = collide_at(WOOD, z), recoil(WOOD, z)
    e = np.asarray(restitution_from_efficiency(collisions.collision_efficiency, r))
    return _worst(energy_loss(collisions) * (1 + r) - (1 - e**2))


def energy_share_error(name: str) -> float:
    """Return the largest absolute difference of an energy share: collision model minus Eqs. (10).

    Eqs. (10) are equations of the paper of Nathan (2003). They give three shares of the collision
    energy. `name` selects one of them: ``ball``, ``bat`` or ``dissipated``. Two bats without
    support are compared: R161 (the wood bat of the paper) and EA70 (its aluminum bat). Each is hit
    2 to 10 in from the tip at 160 mph. The result is the largest value over both bats and all
    positions. Raises `KeyError` for another name.
    """
    z = np.linspace(2, 10, 9)
    gaps = []
    for bat in (WOOD, ALUMINIUM):
        collisions, r = collide_at(bat, z), recoil(bat, z)
        e = np.asarray(restitution_from_efficiency(collisions.collision_efficiency, r))
        shares = energy_fractions(e, r)
        energy = collisions.energy
        model_share = {
            "ball": energy.ball,
            "bat": energy.rigid,
            "dissipated": energy_loss(collisions),
        }[name]
        gaps.append(_worst(model_share - np.asarray(getattr(shares, name))))
    return max(gaps)


def sum_of_shares() -> float:
    """Return the sum of the three energy shares of Eqs. (10).

    The sum is computed for a bat-ball restitution e from 0 to 1 and a recoil factor r from 0 to
    0.5. The value farthest from 1 is returned.
    """
    shares = energy_fractions(*E_AND_R)
    total = np.ravel(np.asarray(shares.ball) + shares.bat + shares.dissipated)
    return float(total[np.abs(total - 1).argmax()])


def recoil_deviation(support_name: str) -> float:
    """Return the largest relative difference of r between the paper's equation and finite elements.

    The equation of the recoil factor r is Eq. (8) if `support_name` is ``free``, and Eq. (9) if it
    is ``pivoted``. The finite-element r is computed from the rigid modes of each of the four bats,
    0.5 to 20 in from the tip.
    """
    z, gaps = np.linspace(0.5, 20, 40), []
    for bat in BATS:
        modes = modes_of(body(bat), support(support_name), 0)
        shapes = modes.shape(z * INCH)[:, : modes.rigid]
        by_modes = paper_ball().mass * np.sum(shapes**2, axis=1)
        gaps.append(_worst(by_modes / recoil(bat, z, support_name) - 1))
    return max(gaps)


def parallel_axis_error() -> float:
    """Return the relative error of the parallel-axis theorem for the wood bat R161.

    The moment of inertia about an axis 6 in from the knob is computed by the theorem and by an
    integral over the finite elements. The error is positive if the theorem gives the larger value.
    """
    bat_beam = beam(WOOD)
    pivot = bat_beam.length - 6 * INCH
    shifted = parallel_axis(bat_beam.inertia_cm, bat_beam.mass, pivot - bat_beam.z_cm)
    return float(shifted) / bat_beam.inertia(pivot) - 1


def effective_mass_increase() -> float:
    """Return the smallest relative increase of the effective mass from one position to the next.

    On each of the paper's four bats there are 30 positions, from the tip to the center of mass. A
    result of 0.01 means 1 %. A negative result means that the effective mass decreases somewhere.
    """
    least = np.inf
    for bat in BATS:
        z = np.linspace(0, beam(bat).z_cm / INCH, 30)
        least = min(least, float((-np.diff(recoil(bat, z)) / recoil(bat, z)[1:]).min()))
    return least


def efficiency_rise() -> float:
    """Return the smallest change of e_A, over a grid of e and r, if r decreases by 0.05.

    The collision efficiency e_A is computed by Eq. (6). The grid has a bat-ball restitution e from
    0 to 1 and a recoil factor r from 0 to 0.5. The result is positive if e_A always rises.
    """
    e_A = np.asarray(efficiency_from_restitution(*E_AND_R))
    return float(-np.diff(e_A, axis=0).max())


def efficiency_excess() -> float:
    """Return the largest difference e_A - e of the four bats, 0.5 to 12 in from the tip.

    e_A is the collision efficiency and e the bat-ball restitution. The result is negative if e_A is
    less than e at all of these positions.
    """
    curves = [profiles_by_swing(bat)[0.0].table for bat in BATS]
    return max(
        float((curve["collision_efficiency"] - curve["restitution"]).max()) for curve in curves
    )


def efficiency(e: float, r: float) -> float:
    """Return the collision efficiency e_A = (e - r) / (1 + r), Eq. (6), dimensionless.

    `e` is the bat-ball restitution and `r` the recoil factor. The result is negative for e < r.
    """
    return float(efficiency_from_restitution(e, r))


def overestimate(speed: float) -> float:
    """Return the error of the batted-ball speed v_f [mph] due to a restitution at a wrong speed.

    e is the bat-ball restitution. It depends on the relative speed of ball and bat, which is 160
    mph in the hit. v_f is computed twice, with the e for the wrong speed `speed` [mph], and with
    the e for 160 mph. The result is the first value minus the second. The numbers are an example. e
    decreases linearly from 0.55 at 60 mph to 0.45 at 160 mph. The recoil factor is 0.25.
    """
    e = 0.55 - 0.001 * (speed - SLOW)
    return FAST * (efficiency(e, 0.25) - efficiency(0.45, 0.25))


def overestimate_of_model(speed: float) -> float:
    """Return the error of the batted-ball speed v_f [mph] due to an e_A measured at `speed` [mph].

    e_A is the collision efficiency of the wood bat R161. The bat is at rest, so v_f is e_A times
    the speed of the incoming ball. v_f is computed for a ball of 160 mph, with e_A at `speed` and
    with e_A at 160 mph. The result is the first value minus the second. e_A is the largest value 3
    to 8 in from the tip of the free bat. The ball-wall restitution decreases with speed.
    """
    return FAST * (_peak_at(WOOD, speed) - _peak_at(WOOD, FAST))


def speed_gain(v_rel: float) -> float:
    """Return the increase of the batted-ball speed [mph] if e increases from 0.50 to 0.55.

    e is the bat-ball restitution. The recoil factor is 0.25. `v_rel` is the relative speed of ball
    and bat [mph].
    """
    return float(batted_speed_gain(v_rel, 0.05, 0.25))


def gain_by_equations() -> float:
    """Return the largest absolute error of the function `speed_gain` [mph].

    The correct value is computed by Eqs. (3) and (6) of the paper of Nathan (2003). The relative
    speeds are 80 and 160 mph. The result is only a rounding error.
    """

    def deviation(v_rel: float) -> float:
        v_ball = 90 / 160 * v_rel
        v_bat = v_rel - v_ball
        before, after = (batted_speed_of(efficiency(e, 0.25), v_ball, v_bat) for e in (0.50, 0.55))
        return abs(after - before - speed_gain(v_rel))

    return max(deviation(80.0), deviation(FAST))


def energy_with_vibration(support_name: str) -> float:
    """Return the largest absolute change of the collision energy caused by a support of the bat.

    The energy is the sum of three parts: the bat's rigid motion, its bending and hoop vibration,
    and the loss in the ball. The energy of the rebounding ball is not included. The sum is divided
    by the ball's initial energy. The change is relative to a bat without support.

    R161, the wood bat of the paper, is hit at 160 mph at 21 positions, 3 to 8 in from the tip.
    `support_name` is pivoted, clamped or held (by a hand). Raises `KeyError` for another support.
    """

    def total(name: str) -> Array:
        collisions = collide_at(WOOD, Z, support_name=name)
        return np.asarray(collisions.energy.rigid + energy_loss(collisions))

    return _worst(total(support_name) - total("free"))


def least_energy_gap(support_name: str) -> float:
    """Return the smallest absolute change of rigid-motion energy caused by a support of the bat.

    The energy is the energy of the bat's rigid motion, divided by the ball's initial energy. The
    change is relative to a bat without support.

    R161, the wood bat of the paper, is hit at 160 mph at 8 positions, 3 to 4.75 in from the tip.
    `support_name` is pivoted, clamped or held (by a hand). Raises `KeyError` for another support.
    """
    gap = (
        collide_at(WOOD, Z, support_name=support_name).energy.rigid
        - collide_at(WOOD, Z).energy.rigid
    )
    return float(np.abs(gap[Z < 5]).min())


def restitution_change_at_percussion(bat: str) -> float:
    """Return the absolute change of the bat-ball restitution e caused by a pivot.

    The pivot is 6 in from the knob; without it the bat is free. The bat is hit at the center of
    percussion for this pivot, at 60 mph. Raises `InputError` for an unknown bat.
    """
    z = centre_of_percussion_in(bat)
    gap = restitution(bat, [z], "pivoted", SLOW, BALL) - restitution(bat, [z], "free", SLOW, BALL)
    return _worst(gap)


def recoil_change_at_percussion() -> float:
    """Return the largest absolute relative change of the recoil factor r caused by a pivot.

    The pivot is 6 in from the knob. r is computed at the center of percussion for this pivot. The
    result is the largest change among the four bats of the paper. A result of 0.01 means 1 %.
    """
    return max(
        _worst(
            recoil(bat, centre_of_percussion_in(bat), "pivoted")
            / recoil(bat, centre_of_percussion_in(bat))
            - 1
        )
        for bat in BATS
    )


def pivot_speed() -> float:
    """Return the speed of a point P just after a hit, divided by the speed of the impact point.

    P is 6 in from the knob of R161. The bat is free and rigid, and is hit at the center of
    percussion for a pivot at P. P then stays at rest, so the ratio is a rounding error of either
    sign.
    """
    bat_beam = beam(WOOD)
    modes = modes_of(body(WOOD), Free(), 0)
    hit, pivot = modes.shape(
        np.array([centre_of_percussion_in(WOOD) * INCH, bat_beam.length - 6 * INCH])
    )
    rigid = slice(modes.rigid)
    return float(hit[rigid] @ pivot[rigid] / (hit[rigid] @ hit[rigid]))


def factor_gain_of_hoop() -> float:
    """Return the peak bat performance factor (BPF) of EA70 minus the peak with a rigid shell.

    Both bats are free. The first peak is computed under standard game conditions (90 mph pitch),
    0.5 to 12 in from the tip. The second is `dead_shell_factor`.
    """
    return top(ALUMINIUM, "bat_performance_factor").value - dead_shell_factor()


def dead_shell_factor() -> float:
    """Return the peak bat performance factor (BPF) of the bat EA70 with a rigid shell.

    The bat is free and is hit 3 to 8 in from the tip, at 160 mph.
    """
    stiff = ModalModel.of(replace(body(ALUMINIUM), hoop=None), Free())
    e_A = collide_at(stiff, Z).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, recoil(ALUMINIUM, Z)))
    return float(e.max()) / 0.5


def softball_factor() -> float:
    """Return the peak bat performance factor (BPF) of the catalog's bat ``softball-34``.

    The bat is free and is hit 4 to 8.75 in from the tip, at 60 mph.
    """
    z, slow = np.arange(4, 9, 0.25), "softball-slowpitch"
    bat_beam, struck_ball = beam("softball-34"), paper_ball(slow)
    e_A = collide_at("softball-34", z, speed=SLOW, with_ball=slow).collision_efficiency
    distance = z * INCH - bat_beam.z_cm
    r = struck_ball.mass * (1 / bat_beam.mass + distance**2 / bat_beam.inertia_cm)
    e0 = float(struck_ball.restitution.at(SLOW * MPH))
    return float(np.asarray(restitution_from_efficiency(e_A, r)).max()) / e0


def besr_less_efficiency(e_A: float) -> float:
    """Return the ball exit speed ratio BESR minus the collision efficiency `e_A`.

    The result is 0.5 for every `e_A`.
    """
    return float(besr(e_A)) - e_A


def besr_of(e: float, r: float) -> float:
    """Return the ball exit speed ratio BESR = e_A + 0.5, dimensionless.

    The collision efficiency e_A follows from the bat-ball restitution `e` and the recoil factor `r`
    by Eq. (6).
    """
    return float(besr(efficiency(e, r)))


def batted_speed_of(e_A: float, v_ball: float, v_bat: float) -> float:
    """Return the batted-ball speed v_f = e_A v_ball + (1 + e_A) v_bat, Eq. (3).

    The result has the unit of `v_ball` and `v_bat`, which are both positive. `e_A` is the collision
    efficiency.
    """
    return float(batted_speed(e_A, v_ball, v_bat))


def energy_fraction(name: str, e: float, r: float) -> float:
    """Return one of the three shares of the collision energy, dimensionless.

    The share is computed by Eqs. (10) of Nathan (2003).

    Parameters
    ----------
    name
        ``ball`` (energy of the ball), ``bat`` or ``dissipated``. Another name raises
        `AttributeError`.
    e
        Bat-ball restitution.
    r
        Recoil factor.
    """
    return float(getattr(energy_fractions(e, r), name))


def sweet_spot_restitution() -> float:
    """Return the mean bat-ball restitution e of the wood bat R161 around its sweet spot.

    The bat has no support. The mean is over impact positions 4 to 6 in from the tip, at 160 mph.
    """
    return float(restitution(WOOD, np.linspace(4, 6, 9)).mean())


def restitution_by_support() -> float:
    """Return the absolute difference of the bat-ball restitution e between pivoted and free R161.

    The pivot is 6 in from the knob. The bat is hit 4 in from the tip, at 160 mph.
    """
    return _worst(restitution(WOOD, [4.0], "pivoted") - restitution(WOOD, [4.0]))


def clamping_loss() -> float:
    """Return the smallest loss of bat-ball restitution e caused by clamping the handle of R161.

    The loss is e of the free bat minus e of the clamped bat. It is the smallest over impacts 3 to 8
    in from the tip, at 160 mph. A negative result means that e increased at some position.
    """
    return float((restitution(WOOD, Z) - restitution(WOOD, Z, "clamped")).min())


def recoil_at_peak(bat: str) -> float:
    """Return the recoil factor r of a free bat at the position of its largest e_A, dimensionless.

    e_A is the collision efficiency under standard game conditions. Its largest value is searched
    from 0.5 to 12 in from the tip. Raises `InputError` for an unknown bat.
    """
    return float(recoil(bat, top(bat, "collision_efficiency").place))
