"""Checks of the shots at the bat: passages, aim, encoder, and recoil against rebound."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.diagnostics.evidence import FEWEST_SHOTS, Evidence
from virtual_lab.measurement.diagnostics.flag import Pairs, Raised, pairs
from virtual_lab.measurement.reduction.flights import number_shots
from virtual_lab.measurement.reduction.rate import MOST_MISFIT, RateFit
from virtual_lab.measurement.reduction.shot_algebra import bat_properties
from virtual_lab.records import AimMarks
from virtual_lab.uncertainty.budget import Components, Variants, type_a_component, weighted_sums
from virtual_lab.uncertainty.estimate import Estimates
from virtual_lab.units import Array, Mask

AIM_ALONG = "impact.cannon.along"
RATE_ROUNDING = 1e-5  # relative accuracy of the extrapolation of a rate to contact


def ball_seen(evidence: Evidence) -> Iterator[Raised]:
    """Yield two flags for balls that the gates missed: one at the wall, then one at the bat.

    Each flag is raised in the laboratories with at least one missed ball. At the wall, a ball is
    missed if the gates did not detect it on the way in or on the way back. At the bat, it is missed
    if a gate did not detect it on the way in. Both flags are yielded, even if they are raised in no
    laboratory.
    """
    hits = evidence.reduced.preparation.balls.ball[:, 0]
    wall_misses = np.sum(hits < 0, axis=1)
    yield Raised(
        name="ball-seen",
        where=wall_misses > 0,
        sentence=lambda i: (
            f"the gates missed the incoming or the returning ball in {wall_misses[i]} of "
            f"{hits.shape[1]} hits at the wall"
        ),
    )
    bat_misses = evidence.per_laboratory(~evidence.readings.flights.raw.complete)
    fired = evidence.per_laboratory(np.ones(evidence.owner.size))
    yield Raised(
        name="ball-seen",
        where=bat_misses > 0,
        sentence=lambda i: (
            f"a gate missed the incoming ball in {bat_misses[i]:.0f} of {fired[i]:.0f} shots"
        ),
    )


def edges(evidence: Evidence) -> Iterator[Raised]:
    """Yield one flag, raised where over 10 % of a laboratory's shots do not fit a straight flight.

    A beam edge is the time at which a ball breaks or clears a beam of a light board. A shot does
    not fit if its beam edges deviate from one straight flight by more than the procedure allows.
    The flag is yielded even if it is raised in no laboratory.
    """
    count = evidence.per_laboratory(evidence.off_flight)
    fired = evidence.per_laboratory(np.ones(evidence.owner.size))
    yield Raised(
        name="edges",
        where=count > 0.1 * fired,  # more than scraps of a sabot can explain
        sentence=lambda i: (
            f"the beam edges of {count[i]:.0f} of {fired[i]:.0f} shots do not fit a single flight; "
            "scraps of sabots explain only a few such shots"
        ),
    )


def aim(evidence: Evidence) -> Iterator[Pairs]:
    """Yield two comparisons of the mean mark on the aim paper with the known aim.

    The first comparison is along the bat, the second across it. The difference is the mark minus
    the aim. `Pairs.sigmas`, (laboratory,), is the absolute difference in units of its standard
    uncertainty. Nothing is yielded without an aim paper, or with fewer than `FEWEST_SHOTS` marks
    per laboratory.
    """
    marks = evidence.block.impact.get("aim")
    if not isinstance(marks, AimMarks):
        return
    none, endless = np.zeros(evidence.laboratories), np.full(evidence.laboratories, np.inf)
    nothing = Estimates(value=none, u=none, dof=endless)
    lined_up = evidence.reduced.constants.get(AIM_ALONG, nothing)
    height = evidence.reduced.constants.get("impact.pivot.height", nothing)
    variants = Variants.of({AIM_ALONG: lined_up})
    survey = variants.components(variants.columns[AIM_ALONG][..., 0])
    aimed = (
        ("along", marks.along, lined_up, evidence.moves(survey)),
        ("across", marks.across, height, np.inf),
    )
    for axis, marked, at, moves in aimed:
        deviation = marked.reshape(evidence.laboratories, -1) - at.value[:, None]
        number = deviation.shape[1]
        if number < FEWEST_SHOTS:
            continue
        mean, u = deviation.mean(axis=1), deviation.std(axis=1, ddof=1) / sqrt(number)
        yield pairs(
            "aim",
            _aim_sentence(axis, number, mean),
            mean,
            survey + type_a_component("scatter", mean, u, number - 1),
            of=axis,
            least=1e-5,
            moves=moves,
        )


def _aim_sentence(axis: str, number: int, mean: Array) -> Callable[[int], str]:
    return lambda i: (
        f"the mean of the {number} marks of impact/aim is {mean[i] * 1e3:+.1f} mm from the aim "
        f"{axis} the bat"
    )


def encoder_fit(evidence: Evidence) -> Iterator[Raised]:
    """Yield one flag per encoder. It shows that the fitted rotation disagrees with the record.

    The misfit of a shot is a ratio. The numerator is the rms deviation of the record from the
    fitted rotation. The denominator is the rms noise, to which the resolution and the noise of the
    bat at rest contribute. The flag is raised in the laboratories with a misfit above `MOST_MISFIT`
    in at least one shot. It is yielded even if it is raised in no laboratory.

    The rig may have an encoder for the recoil and one for the swing. Nothing is yielded for an
    encoder that the rig does not have.
    """
    for fit in (evidence.readings.recoil, evidence.readings.swing):
        if fit is None:
            continue
        rough = fit.misfit > MOST_MISFIT

        def describe(i: int, fit: RateFit = fit, rough: Mask = rough) -> str:
            shots = np.flatnonzero(evidence.owner == i)
            worst = int(np.where(rough[shots], fit.misfit[shots], 0.0).argmax())
            return (
                f"the encoder's misfit exceeds its resolution and noise at rest in "
                f"{int(rough[shots].sum())} of {shots.size} shots; it is largest in shot "
                f"{worst + 1}, {fit.residual[shots[worst]]:.2f} counts rms"
            )

        yield Raised(
            name="encoder-fit", where=evidence.per_laboratory(rough) > 0, sentence=describe
        )


def encoder_halves(evidence: Evidence) -> Iterator[Pairs]:
    """Yield two comparisons per encoder of half of the record with the whole record.

    The rate of the bat is computed from both. The half is the part of a shot's record nearest
    contact. For each shot, the difference of the two rates is multiplied by the sensitivity of the
    test result to the rate. The two comparisons are:

    * The sum of these products over all shots of a laboratory.
    * The product of a single shot of each laboratory, the shot with the smallest p-value
      (`Pairs.harmful`).

    `Pairs.sigmas`, (laboratory,), is the absolute value of this sum or product, divided by its
    standard uncertainty.

    Nothing is yielded for an encoder that the rig does not have, that keeps no record, or that does
    not affect the result.
    """
    for channel, which in (("encoder", "recoil"), ("swing", "swing")):
        fit = getattr(evidence.readings, which)
        if fit is None or not np.isfinite(fit.by_half).any():
            continue
        # 0 if the result depends only on the ball
        lever = evidence.hit_weights.effects * _by_rate(evidence, which)
        mask = (lever != 0) & np.isfinite(lever) & np.isfinite(fit.by_half)
        compared = (
            evidence.has_result & (evidence.metric.u > 0) & (evidence.per_laboratory(mask) > 0)
        )
        if not compared.any():
            continue
        with np.errstate(divide="ignore"):
            moves = np.where(compared, 1 / evidence.metric.u, 0.0)
        difference = np.where(mask, lever * (fit.by_half - fit.rate), 0.0)
        u = np.where(mask, np.abs(lever) * fit.by_half_u, 0.0)
        rounding = np.where(mask, RATE_ROUNDING * lever * fit.rate, 0.0)
        change = evidence.per_laboratory(difference)
        yield pairs(
            "encoder-halves",
            _halves_sentence(evidence, channel, change * moves, mask),
            change,
            type_a_component("fit", change, np.sqrt(evidence.per_laboratory(u**2))),
            of="mean",
            least=np.abs(evidence.per_laboratory(rounding)),
            moves=moves,
            compared=compared,
        )
        yield _worst_shot(
            evidence, channel, mask & compared[evidence.owner], difference, u, rounding, moves
        )


def _halves_sentence(
    evidence: Evidence, channel: str, change: Array, mask: Mask
) -> Callable[[int], str]:
    return lambda i: (
        f"the half of each impact/{channel} record nearest contact, used alone, shifts the result "
        f"by {change[i]:+.2f} of its u ({evidence.shots_of(mask, i)})"
    )


def _worst_shot(
    evidence: Evidence,
    channel: str,
    mask: Mask,
    difference: Array,
    u: Array,
    rounding: Array,
    moves: Array,
) -> Pairs:
    """Return the comparison for the least likely shot of each laboratory."""
    shots = np.flatnonzero(mask)
    owner = evidence.owner[shots]
    among = np.bincount(owner, minlength=evidence.laboratories)
    every = pairs(
        "encoder-halves",
        str,
        difference[shots],
        type_a_component("fit", difference[shots], u[shots]),
        least=np.abs(rounding[shots]),
        moves=moves[owner],
        among=among[owner],
    )
    order = np.lexsort((shots, every.likely, every.harmful, owner))
    compared = among > 0
    first = order[np.searchsorted(owner[order], np.flatnonzero(compared))]
    worst = np.zeros(evidence.laboratories, dtype=np.intp)
    worst[compared] = first

    def describe(i: int) -> str:
        shot = shots[worst[i]]
        number = int(np.sum(evidence.owner[:shot] == i))
        return (
            f"the half of shot {number + 1}'s impact/{channel} record nearest contact, used alone, "
            f"shifts the result by {difference[shot] * moves[i]:+.2f} of its u"
        )

    return Pairs(
        name="encoder-halves",
        which="worst shot",
        statement=describe,
        compared=compared,
        sigmas=every.sigmas[worst],
        likely=every.likely[worst],
        harmful=every.harmful[worst],
    )


def _by_rate(evidence: Evidence, which: str) -> Array:
    """Return the change of the metric per unit of an encoder's rate, (shot,) [per count/s]."""
    fit, step, model = getattr(evidence.model.readings, which), 1e-4, evidence.model

    def metric(factor: float) -> Array:
        scaled_fit = replace(fit, rate=fit.rate * factor)
        variant = replace(model, readings=replace(model.readings, **{which: scaled_fit}))
        return variant(evidence.best)["metric"]

    shots = evidence.reduced.shot_numbers
    changes = np.empty(evidence.owner.size)
    change = (metric(1 + step) - metric(1 - step)) / (2 * step * fit.rate)
    changes[shots[shots >= 0]] = change[:, 0][shots >= 0]
    return changes


def recoil_and_rebound(evidence: Evidence) -> Iterator[Pairs]:
    """Yield one comparison of the mean e_A from the recoil with the mean e_A from the rebound.

    e_A is the collision efficiency. The difference is recoil minus rebound. `Pairs.sigmas`,
    (laboratory,), is the absolute difference in units of its standard uncertainty. Each mean is
    over the valid shots that have both values.

    The ball leaves marks on the aim paper before the impacts. If there are at least `FEWEST_SHOTS`
    marks, their scatter gives the uncertainty, and one shot is enough. Otherwise the scatter of the
    shots gives the uncertainty, and `FEWEST_SHOTS` shots are needed.

    Nothing is yielded if no laboratory has enough shots.
    """
    difference = evidence.shots.recoil_efficiency - evidence.shots.rebound_efficiency
    has_both = evidence.reduced.valid & np.isfinite(difference)
    mean, _, number = evidence.mean_of(difference, has_both)
    marks = _marks_along(evidence)
    compared = number >= (FEWEST_SHOTS if marks is None else 1)
    if not compared.any():
        return
    hits, differences = _variant_differences(evidence, has_both)
    mask = np.where(hits >= 0, has_both[hits], False)
    weights = mask / np.maximum(mask.sum(axis=1, keepdims=True), 1)
    shared = evidence.variants.components(weighted_sums(differences, weights))
    square, degrees = _scatter(evidence, difference, has_both, shared, marks)
    yield pairs(
        "recoil-and-rebound",
        lambda i: (
            f"e_A from the recoil (impact/encoder) minus e_A from the rebound (impact/gates) is "
            f"{mean[i]:+.4f} on average ({evidence.shots_of(has_both, i)})"
        ),
        mean,
        shared
        + type_a_component("scatter", mean, np.sqrt(square / np.maximum(number, 1)), degrees),
        least=1e-5,
        compared=compared,
    )


def _variant_differences(evidence: Evidence, both: Mask) -> tuple[NDArray[np.intp], Array]:
    """Return the shot numbers, (laboratory, hit), and e_A from recoil minus e_A from rebound.

    The shots include all shots in `both`. The differences are computed with each variant of the
    constants.
    """
    hits = number_shots(evidence.owner, both, evidence.laboratories)
    if np.isin(hits[hits >= 0], evidence.hits).all():
        return evidence.hits, evidence.efficiency_gap
    model = evidence.reduced.model(evidence.readings, hits)
    columns = evidence.variants.columns
    results = model.shots(columns, bat_properties(columns))
    return hits, results.recoil_efficiency - results.rebound_efficiency


def _marks_along(evidence: Evidence) -> Array | None:
    """Return the marks on the aim paper along the bat, (laboratory, mark) [m]; None: too few."""
    marks = evidence.block.impact.get("aim")
    if not isinstance(marks, AimMarks) or AIM_ALONG not in evidence.reduced.constants:
        return None
    along = marks.along.reshape(evidence.laboratories, -1)
    return along if along.shape[1] >= FEWEST_SHOTS else None


def _scatter(
    evidence: Evidence, difference: Array, both: Mask, shared: Components, marks: Array | None
) -> tuple[Array, Array]:
    """Return the variance of a shot and its degrees of freedom, from shots and from aim marks.

    Recoil and rebound of a shot differ mainly because of its position along the bat, and the marks
    give the scatter of this position better than a few shots.
    """
    _, u, number = evidence.mean_of(difference, both)
    degrees = np.maximum(number - 1.0, 0.0)
    square = np.where(degrees > 0, u**2 * number, 0.0)
    if marks is not None and AIM_ALONG in shared.names:
        lever, more = shared.sensitivity[:, shared.names.index(AIM_ALONG)], marks.shape[1] - 1.0
        marked = lever**2 * marks.var(axis=1, ddof=1)
        square = (degrees * square + more * marked) / (degrees + more)
        degrees = degrees + more
    return square, degrees
