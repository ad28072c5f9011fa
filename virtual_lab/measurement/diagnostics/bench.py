"""Checks of the bench and of the lot of balls."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from virtual_lab.catalog.specs import CHECK_STANDARD
from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Answer, Pairs, Raised, pairs
from virtual_lab.measurement.procedure import set_aside
from virtual_lab.measurement.reduction.air import DENSITY, climate, climate_readings
from virtual_lab.measurement.reduction.observations import (
    Releases,
    pendulum_releases,
    reference_readings,
    restitution_names,
)
from virtual_lab.output.rounding import limit_message
from virtual_lab.records import REFERENCE_MASS
from virtual_lab.uncertainty.budget import type_a_component
from virtual_lab.units import Array, Mask

# uncertainty of mean minus median swing, because swings shorten unevenly [share of the period]
EVEN_U = 2e-5
STORE = "store"  # channel of the store's readings, and name of their check
FEWEST_RELEASES = 3  # smallest number of releases that gives a scatter
ROUNDING = 1e-9  # rounding error of masses in floating-point arithmetic [kg]
DENSITY_U = 5e-4  # uncertainty of the air density from its stated digits [kg/m³]
ODD_BALL = 0.02  # deviation of e0 from the median of the lot that a sound ball never has
# relative uncertainty of the loss of amplitude; its two readings differ by only a few steps
DECAY_U = 0.4


def sports(evidence: Evidence) -> Iterator[Raised]:
    """Yield one flag if bat, ball and procedure are not all for the same sport.

    The flag is raised in all laboratories of the block. Nothing is yielded if the sports agree. An
    item without a stated sport is ignored. A check standard, such as a steel cylinder in place of
    the bat, is also ignored.
    """
    entries = {
        "the bat": evidence.block.bat_sport,
        "the ball": evidence.block.ball_sport,
        "the procedure": evidence.procedure.sport,
    }
    sports_by_item = {
        what: sport for what, sport in entries.items() if sport and sport != CHECK_STANDARD
    }
    if len(set(sports_by_item.values())) > 1:
        words = ", ".join(f"{what} is for {sport}" for what, sport in sports_by_item.items())
        yield Raised(
            name="sports",
            where=np.ones(evidence.laboratories, dtype=bool),
            sentence=lambda _: f"{words}: the result applies to neither sport",
        )


def check_standard(evidence: Evidence) -> Iterator[Raised]:
    """Yield one flag, raised in all laboratories, if the tested object is a check standard.

    The result of a check standard describes the laboratory and not a bat. Nothing is yielded for a
    bat.
    """
    if evidence.block.bat_sport == CHECK_STANDARD:
        yield Raised(
            name="check-standard",
            where=np.ones(evidence.laboratories, dtype=bool),
            sentence=lambda _: (
                f"{evidence.block.bat} is a check standard, not a bat: the verdict applies to no "
                "bat"
            ),
        )


def bat_shape(evidence: Evidence) -> Iterator[Raised]:
    """Yield four flags for bats with impossible density, balance point, radius of gyration or mass.

    Each flag is raised in the laboratories where the measured property is NaN or outside wide
    limits that hold for any bat. The flags have the order given above. All four are yielded, even
    if they are raised in no laboratory. Only the flag for the density rules out a verdict.
    """
    bat = evidence.reduced.preparation.bat.select((slice(None), 0, 0))
    length, mass = bat.length, bat.mass
    light, heavy = 100.0, 12000.0  # densities of solid balsa and solid lead [kg/m³]
    density = mass / (pi * bat.barrel_radius**2 * length)
    yield Raised(
        name="bat-shape",
        where=~((light <= density) & (density <= heavy)),
        sentence=lambda i: limit_message(
            "the bat's mean density, as a cylinder of its barrel's radius, is {0:.{d}f} kg/m³; "
            "possible densities are {1:g} to {2:g} kg/m³",
            density[i],
            light,
            heavy,
            1,
        ),
        invalidates=True,
    )
    gyration = np.sqrt(np.maximum(bat.inertia_cm / mass / length**2, 0.0))
    # limits for any bat, including a child's, and for the plain steel cylinder of the daily check
    yield _band("balance point", bat.z_cm / length, 0.25, 0.55, " of the length from the tip")
    yield _band("radius of gyration", gyration, 0.20, 0.36, " of the length")
    yield _band("mass", mass, 0.4, 20.0, " kg")


def _band(words: str, value: Array, low: float, high: float, unit: str) -> Raised:
    return Raised(
        name="bat-shape",
        where=~((low <= value) & (value <= high)),
        sentence=lambda i: limit_message(
            f"the {words} is {{0:.{{d}}f}}{unit}, allowed {{1:g}} to {{2:g}}",
            value[i],
            low,
            high,
            3,
        ),
    )


def pendulum_swing(evidence: Evidence) -> Iterator[Pairs]:
    """Yield one comparison of the observed with the predicted change of the pendulum's period.

    The period shortens as the swing decays. The prediction is computed from the recorded
    amplitudes. The deviation is the observed change divided by the predicted change, minus 1.
    `Pairs.sigmas`, (laboratory,), is the absolute deviation in units of its standard uncertainty.
    Nothing is yielded if the record has fewer than four swings per release. A laboratory is not
    compared if its amplitude does not decay.
    """
    releases = pendulum_releases(evidence.block)
    slowing = swing_slowing(releases)
    if slowing is None:
        return
    # The period is that of small swings times 1 + θ²/16. `times` is the true θ² divided by the θ²
    # that was read.
    square = releases.first_amplitude * releases.last_amplitude
    unknown = np.full(evidence.laboratories, np.inf)
    period = (
        evidence.sensitivities.get("bat.period", unknown) * evidence.best["bat.period"][:, 0, 0]
    )
    moves = np.abs(period) * square.mean(axis=1) / 16
    yield pairs(
        "pendulum-swing",
        lambda i: (
            f"in {slowing.releases[i]} releases of bench/pendulum, the period shortens "
            f"{slowing.times[i]:.1f} times as much as the recorded amplitudes predict"
        ),
        slowing.times - 1,
        type_a_component("scatter", np.zeros(evidence.laboratories), slowing.u, slowing.dof),
        least=DECAY_U,
        moves=np.where(np.isfinite(moves), moves, np.inf),
        compared=np.isfinite(slowing.times),
    )


def pendulum_even(evidence: Evidence) -> Iterator[Answer]:
    """Yield comparisons of mean and median swing time, and flags for releases with odd swings.

    A swing is the time between two passages of the pendulum through its lowest point in the same
    direction. If a passage is not recorded, two swings appear as one long swing, which changes the
    mean but not the median. A swing is odd if it is much longer or shorter than the median. A
    counted release is one that is used for the period, see `Releases`.

    Two comparisons are yielded if at least one laboratory has `FEWEST_RELEASES` counted releases:

    * The first compares the mean with the median swing time, on average over all counted releases.
    * The second compares the release that deviates most with the others. An outlier increases the
      uncertainty of the first comparison, so that the first may miss it.

    Two flags are always yielded, even if they are raised in no laboratory:

    * The first is for releases that are left out because of an odd swing.
    * The second is for releases with an odd swing that are used, because too few others remain. If
      it is raised, the laboratory gets no verdict.
    """
    releases = pendulum_releases(evidence.block)
    swings, odd, counted = np.diff(releases.times, axis=2), releases.odd, releases.counted
    excess = swings.mean(axis=2) / np.median(swings, axis=2) - 1
    number, mean = counted.sum(axis=1), excess.mean(axis=1, where=counted)
    compared = number >= FEWEST_RELEASES
    unknown = np.full(evidence.laboratories, np.inf)
    period = (
        evidence.sensitivities.get("bat.period", unknown) * evidence.best["bat.period"][:, 0, 0]
    )
    moves = np.where(np.isfinite(period), np.abs(period), np.inf)
    if compared.any():
        spread = excess.std(axis=1, ddof=1, where=counted & compared[:, None])
        yield pairs(
            "pendulum-even",
            lambda i: (
                f"in {number[i]} releases of bench/pendulum, the mean swing time differs from the "
                f"median by {mean[i]:+.2%}; a passage may have been lost or counted twice"
            ),
            mean,
            type_a_component("scatter", mean, spread / np.sqrt(number), number - 1.0),
            least=EVEN_U,
            moves=moves,
            compared=compared,
        )
        yield _worst_release(np.where(counted, excess, np.nan), moves)
    yield from _odd_releases(swings, odd, counted)


def _worst_release(excess: Array, moves: Array) -> Pairs:
    """Return the comparison of the release that differs most with the mean of the other releases.

    `excess` is (laboratory, release), NaN for a release that is not counted. The uncertainty is
    computed from the scatter of the other releases. A laboratory with too few releases is not
    compared.
    """
    number = np.isfinite(excess).sum(axis=1)
    compared = number > FEWEST_RELEASES
    mean = np.nanmean(excess, axis=1, keepdims=True)
    worst = np.nanargmax(np.abs(excess - mean), axis=1)
    others = excess.copy()
    others[np.arange(len(excess)), worst] = np.nan
    other_count = np.where(compared, number - 1.0, 2.0)
    deviation = np.nanmax(np.abs(excess - mean), axis=1) * number / other_count
    spread = np.sqrt(np.nanvar(others, axis=1) * other_count / np.maximum(other_count - 1, 1))
    return pairs(
        "pendulum-even",
        lambda i: (
            f"in release {worst[i] + 1} of bench/pendulum, the ratio of mean to median swing time "
            f"differs by {deviation[i]:.2%} from that of the other releases"
        ),
        deviation,
        type_a_component(
            "scatter", deviation, spread * np.sqrt(1 + 1 / other_count), other_count - 1
        ),
        of="worst release",
        least=EVEN_U,
        moves=moves / number,
        among=number,
        compared=compared,
    )


def _odd_releases(swings: Array, odd: Mask, counted: Mask) -> Iterator[Raised]:
    """Yield the two flags for releases with an odd swing, see `pendulum_even`.

    `swings` and `odd` are (laboratory, release, swing), `counted` is (laboratory, release).
    """
    irregular: Mask = np.asarray(odd.any(axis=2))
    # Odd releases are used if too few others remain.
    too_many: Mask = np.asarray((irregular & counted).any(axis=1))
    any_left_out: Mask = np.asarray((irregular & ~counted).any(axis=1))

    def describe(i: int) -> str:
        release = int(irregular[i].argmax())
        swing = int(odd[i, release].argmax())
        times = swings[i, release, swing] / np.median(swings[i])
        swing_count = int(irregular[i].sum())
        outcome = "too many to leave out" if too_many[i] else "left out of the period"
        return (
            f"in release {release + 1} of bench/pendulum, the swing after passage {swing + 1} "
            f"takes {times:.2f} times the usual time, so a passage was lost or counted twice; "
            f"releases with such a swing: {swing_count} of {irregular.shape[1]}, {outcome}"
        )

    yield Raised(name="pendulum-even", where=any_left_out, sentence=describe)
    yield Raised(name="pendulum-even", where=too_many, sentence=describe, invalidates=True)


class Slowing(NamedTuple):
    """Observed change of a pendulum's period over the change expected from the amplitudes.

    Arrays are (laboratory,).
    """

    times: Array  # observed change over expected change; NaN if the swing did not decay
    u: Array
    releases: Array  # number of counted releases
    dof: Array


def swing_slowing(pendulum: Releases) -> Slowing | None:
    """Return the observed change of the pendulum's period, divided by the predicted change.

    The period of a pendulum grows with the square of the amplitude, so it shortens as the swing
    decays. The change is predicted from the recorded amplitudes. The ratio is 1 if these amplitudes
    are correct.

    The result has four arrays, (laboratory,):

    * `times` is the ratio. It is NaN if the amplitude does not decay, or if no release is counted.
    * `u` is the standard uncertainty of the ratio.
    * `dof` is the number of degrees of freedom of this uncertainty.
    * `releases` is the number of counted releases.

    Return None if the releases have fewer than four swings.
    """
    times, counted = pendulum.times, pendulum.counted
    releases, passages = counted.sum(axis=1), times.shape[2]
    swings = passages - 1
    if swings < 4:
        return None
    first, last = (
        np.mean(each, axis=1, keepdims=True, where=counted)
        for each in (pendulum.first_amplitude, pendulum.last_amplitude)
    )
    middle = first * (last / first) ** ((np.arange(swings) + 0.5) / swings)
    longer = np.concatenate([np.zeros_like(first), np.cumsum(middle**2 / 16, axis=1)], axis=1)
    # least squares on orthogonal columns: start, period, and the rest of `longer`
    even = np.arange(passages) - swings / 2
    width = np.sum(even**2)
    longer -= longer.mean(axis=1, keepdims=True)
    part = longer @ even / width
    longer -= part[:, None] * even
    square = np.sum(longer**2, axis=1)
    decays = square > 1e-18  # rad⁴
    square = np.where(decays, square, np.nan)
    rest = times - times.mean(axis=2, keepdims=True)
    period = rest @ even / width  # (laboratory, release)
    rest = rest - period[..., None] * even
    slowing = np.einsum("lrp,lp->lr", rest, longer) / square[:, None]
    rest = rest - slowing[..., None] * longer[:, None]
    dof = releases * (passages - 3)
    spread = np.sqrt(np.sum(rest**2, axis=(1, 2), where=counted[..., None]) / dof)
    slowed = slowing.mean(axis=1, where=counted)
    small = period.mean(axis=1, where=counted) - slowed * part
    u = spread / np.sqrt(releases * square) / small
    return Slowing(slowed / small, u, releases, dof)


def scale_drift(evidence: Evidence) -> Iterator[Pairs]:
    """Yield one comparison of the scale's readings of the reference mass, before and after use.

    Bat and balls are weighed in between. The difference is the mean reading after use minus the
    mean reading before. `Pairs.sigmas`, (laboratory,), is the absolute difference in units of its
    standard uncertainty. Nothing is yielded without a record of the reference mass. Raises
    `InputError` unless the record has two items, before and after, with at least two readings of
    each.
    """
    record = evidence.block.records["bench"].get(REFERENCE_MASS)
    if record is None:
        return
    readings = reference_readings(evidence.block)
    number = readings.shape[2]
    change = np.diff(readings.mean(axis=2), axis=1)[:, 0]
    scatter = np.sqrt(readings.var(axis=2, ddof=1).sum(axis=1) / number)
    step = evidence.block.calibration["bench.scale.resolution"].value / sqrt(12)
    effects = evidence.sensitivities
    moves = np.abs(effects.get("bench.scale.zero", np.full(change.shape, np.inf)))
    yield pairs(
        "scale-drift",
        lambda i: (
            "the scale's reading of the reference mass (bench/reference-mass) changed by "
            f"{change[i] * 1e3:+.2f} g while bat and balls were weighed"
        ),
        change,
        type_a_component("scatter", change, scatter, 2.0 * (number - 1)),
        least=np.hypot(sqrt(2) * step, ROUNDING),
        moves=np.where(np.isfinite(moves), moves, np.inf),
    )


def air_read_and_stated(evidence: Evidence) -> Iterator[Pairs]:
    """Yield one comparison of the measured air density with the density stated in the calibration.

    The measured density comes from the climate record. `Pairs.sigmas`, (laboratory,), is the
    absolute difference of the two densities in units of its standard uncertainty.

    Nothing is yielded if there is no climate record, or if the calibration states no density.
    """
    calibration = evidence.block.calibration.get(DENSITY)
    if calibration is None or "climate" not in evidence.block.records["bench"]:
        return
    measured = evidence.reduced.constants[DENSITY]
    difference = measured.value - calibration.value
    moves = np.abs(evidence.sensitivities.get(DENSITY, np.full(difference.shape, np.inf)))
    yield pairs(
        "air-density",
        lambda i: (
            f"the air density is {measured.value[i]:.3f} kg/m³ according to bench/climate, but "
            f"{calibration.value[i]:.3f} kg/m³ according to the calibration"
        ),
        difference,
        type_a_component("climate", difference, measured.u, measured.dof)
        + type_a_component("stated", difference, calibration.u, calibration.dof),
        least=DENSITY_U,
        moves=np.where(np.isfinite(moves), moves, np.inf),
    )


def store(evidence: Evidence) -> Iterator[Raised]:
    """Yield one flag, raised in the laboratories with a ball store that is too dry or too humid.

    The mean relative humidity of each laboratory is compared with the limits of the procedure. A
    mean of NaN raises the flag. Nothing is yielded if the procedure states no conditioning, or if
    the store has no record. The flag never rules out a verdict. Humidity changes the ball-wall
    restitution e0 of the balls, but the result is stated for these balls or normalized by their
    measured e0.
    """
    conditioning, readings = (
        evidence.procedure.conditioning,
        climate_readings(evidence.block, STORE),
    )
    if conditioning is None or readings is None:
        return
    humidity = climate(evidence.block, readings)["humidity"][0].mean(axis=1)
    low, high = (
        conditioning.humidity - conditioning.tolerance,
        conditioning.humidity + conditioning.tolerance,
    )
    yield Raised(
        name=STORE,
        where=~((low <= humidity) & (humidity <= high)),
        sentence=lambda i: limit_message(
            "the store of the balls had {0:.{d}f} % relative humidity, allowed {1:g} to {2:g} %",
            100 * humidity[i],
            100 * low,
            100 * high,
            0,
        ),
    )


def lot_rules(evidence: Evidence) -> Iterator[Raised]:
    """Yield one flag, raised in the laboratories that have a wrong ball in their lot.

    A ball is wrong if two conditions are met. First, its mass or e0 is outside the window of the
    procedure. Second, it was fired, or its e0 differs by more than 0.02 from the median of the lot.
    The flag is yielded even if it is raised in no laboratory.
    """
    windows, balls = evidence.procedure.windows, evidence.measured_balls.select((slice(None), 0))
    at = balls.restitution + balls.slope * (windows.ball_restitution_speed - balls.speed)
    low, high = windows.ball_restitution_low, windows.ball_restitution_high
    fired = np.zeros(at.shape, dtype=bool)
    fired[evidence.owner, evidence.readings.ball] = True
    # 0.02 is five standard deviations of the measured e0 about the median of a sound lot.
    far = ~(np.abs(at - np.median(at, axis=-1, keepdims=True)) <= ODD_BALL)
    fit = (windows.ball_mass_low <= balls.mass) & (balls.mass <= windows.ball_mass_high)
    bad = ~(fit & (low <= at) & (at <= high)) & (fired | far)
    yield Raised(
        name="lot-rules",
        where=np.asarray(bad.any(axis=1)),
        sentence=lambda i: _of_ball(evidence, i, fired[i], bad[i]),
    )


def _of_ball(evidence: Evidence, laboratory: int, fired: Mask, bad: Mask) -> str:
    """Return a sentence on the first wrong ball of a laboratory."""
    unfit = set_aside(evidence.procedure, evidence.measured_balls.select((laboratory, 0)))
    entry = next(one for one in unfit if bad[one.ball])
    if fired[entry.ball]:
        return f"ball {entry.ball + 1} was fired although the rules do not allow it: {entry.reason}"
    return f"ball {entry.ball + 1} of the lot has {entry.reason}; it is worn or of another type"


def wall_drift(evidence: Evidence) -> Iterator[Pairs]:
    """Yield one comparison that shows a drift of e0 during the hits at the wall.

    e0 is the ball-wall restitution. A straight line is fitted to the mean e0 of the balls against
    the order in which the balls hit the wall. The difference is the value of the line for the last
    ball minus its value for the first ball. `Pairs.sigmas`, (laboratory,), is the absolute
    difference in units of its standard uncertainty. Nothing is yielded for fewer than four balls.
    """
    e0, readings = evidence.measured_balls.restitution[:, 0], evidence.reduced.preparation.balls
    if e0.shape[1] < 4:
        return
    number = np.cumsum(readings.ball[:, 0] >= 0, axis=1) - 1.0  # order of each measured hit, from 0
    order = (number[:, None] @ readings.share[:, 0])[:, 0]
    along, length = order - order.mean(axis=1, keepdims=True), np.ptp(order, axis=1)
    width = np.sum(along**2, axis=1)
    slope = np.sum(along * e0, axis=1) / width
    rest = e0 - e0.mean(axis=1, keepdims=True) - slope[:, None] * along
    dof = e0.shape[1] - 2
    change = slope * length
    scatter = np.sqrt(np.sum(rest**2, axis=1) / dof / width) * length
    # In either case, whether the trend continues or began at the wall, the error of the mean e0 is
    # half the change.
    effects = evidence.sensitivities
    shared = sum(
        (effects[name] for name in restitution_names(e0.shape[1]) if name in effects),
        np.where(evidence.has_result & (evidence.metric.u > 0), 0.0, np.nan),
    )
    yield pairs(
        "wall-drift",
        lambda i: (
            f"e0 at the wall changed by {change[i]:+.4f} from the first to the last of "
            f"{e0.shape[1]} balls (balls/gates)"
        ),
        change,
        type_a_component("scatter", np.zeros(change.shape), scatter, dof),
        least=1e-5,
        moves=np.where(np.isfinite(shared), np.abs(shared) / 2, np.inf),
    )
