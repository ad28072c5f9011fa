"""Checks of the shots at the bat: passages, aim, encoder, and recoil against rebound."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf, sqrt

import numpy as np

from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Discrepancy, Flag, pair
from virtual_lab.measurement.reduction.gates import INBOUND, GateReadings
from virtual_lab.measurement.reduction.rate import MOST_MISFIT
from virtual_lab.measurement.reduction.shot_algebra import drag_of
from virtual_lab.records import AimMarks, EncoderRecord
from virtual_lab.relations.flight import time_before
from virtual_lab.uncertainty.budget import Component, propagate, type_a
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array, Mask

AIM_ALONG = "impact.cannon.along"
RATE_ROUNDING = 1e-5  # relative, of a rate: what its extrapolation to contact is good for
FEWEST_SHOTS = 3  # shots that a mean and its scatter may rest on


def ball_seen(seen: Evidence) -> Iterator[Flag]:
    """Count incoming balls that a gate did not see: faultless gates see every one."""
    missed = ~seen.readings.seen.raw.complete
    if missed.any():
        yield Flag(
            name="ball-seen",
            sentence=f"a gate did not see the ball come in, in {int(missed.sum())} "
            f"of {missed.size} shots",
        )


def edges(seen: Evidence) -> Iterator[Flag]:
    """Count shots whose edges at the boards deviate from one flight."""
    off = seen.off_flight
    if off.mean() > 0.1:  # no scrap of a sabot explains so many
        yield Flag(
            name="edges",
            sentence=f"edges off one flight in {int(off.sum())} of {off.size} shots: "
            "more than scraps of sabots explain",
        )


def boards_in_line(seen: Evidence) -> Iterator[Discrepancy]:
    """Compare each board between first and last with the flight through these two."""
    known, best, gates = seen.constants, seen.best, seen.readings.seen
    if not isinstance(gates, GateReadings):
        return
    last = gates.distances.size - 1
    drag = drag_of(best, seen.shots.ball_mass)
    reach = [time_before(best[_distance(k)], 1.0, drag) for k in range(last + 1)]
    times, valid = gates.passages.times[:, INBOUND], seen.judgement.valid
    for board in range(1, last):
        part = (times[:, board] - times[:, 0]) / (times[:, last] - times[:, 0])
        off = reach[board] - reach[0] - part * (reach[last] - reach[0])
        used = valid & np.isfinite(off)
        if used.sum() < FEWEST_SHOTS:
            continue
        place = {_distance(k): known[_distance(k)] for k in (0, board, last)}
        survey = propagate(_between(board, last, float(part[used].mean())), place)["off"]
        mean = float(off[used].mean())
        yield pair(
            "boards-in-line",
            f"board {board} stands {mean * 1e3:+.2f} mm off the flight through its neighbours, in "
            f"{_shots(used)} of impact/gates",
            mean,
            [*survey, _of_mean(off[used])],
            of=f"board {board}",
            least=1e-5,
            moves=seen.moves(survey),
        )


def aim(seen: Evidence) -> Iterator[Discrepancy]:
    """Compare the mean of the marks on the aim paper with the aim, both ways."""
    marks = seen.session.records["impact"].get("aim")
    if not isinstance(marks, AimMarks):
        return
    nothing = Estimate(value=0.0)
    lined_up = seen.constants.get(AIM_ALONG, nothing)
    height = seen.constants.get("impact.pivot.height", nothing)
    survey = propagate(lambda x: {"off": x[AIM_ALONG][:, 0]}, {AIM_ALONG: lined_up})["off"]
    aimed = (
        ("along", marks.along, lined_up, seen.moves(survey)),
        ("across", marks.across, height, inf),
    )
    for way, marked, at, moves in aimed:
        off = marked - at.value
        if off.size < FEWEST_SHOTS:
            continue
        mean = float(off.mean())
        yield pair(
            "aim",
            f"{off.size} marks of impact/aim lie {mean * 1e3:+.1f} mm off the aim {way} the bat",
            mean,
            [*survey, _of_mean(off)],
            of=way,
            least=1e-5,
            moves=moves,
        )


def _of_mean(values: Array) -> Component:
    """Return the scatter of the mean of some values."""
    return type_a(
        "scatter", 0.0, float(values.std(ddof=1)) / sqrt(values.size), dof=values.size - 1
    )


def _shots(used: Mask) -> str:
    """Return the shots by number, or how many there are."""
    shots = np.flatnonzero(used)
    return f"shots {', '.join(map(str, shots))}" if shots.size <= 6 else f"{shots.size} shots"


def encoder_fit(seen: Evidence) -> Iterator[Flag]:
    """Count shots whose fit leaves more of the counts than resolution and noise at rest."""
    for fit in (seen.readings.recoil, seen.readings.swing):
        if fit is None:
            continue
        rough = np.flatnonzero(fit.misfit > MOST_MISFIT)
        if rough.size:
            worst = int(rough[fit.misfit[rough].argmax()])
            yield Flag(
                name="encoder-fit",
                sentence=f"{rough.size} of {fit.misfit.size} shots leave more of the encoder's "
                f"counts than counting and noise at rest, shot {worst} "
                f"{fit.residual[worst]:.2f} rms",
            )


def records_repeated(seen: Evidence) -> Iterator[Flag]:
    """Look for shots with the same encoder record whose gates differ: it was filed twice."""
    record = seen.session.records["impact"].get("encoder")
    if not isinstance(record, EncoderRecord):
        return
    turned = np.flatnonzero(np.ptp(record.counts, axis=1))  # a bat that was not hit stands
    raw = seen.readings.seen.raw
    flown = np.stack([raw.contact, raw.speed_in, raw.speed_out], axis=1)
    first: dict[bytes, int] = {}
    for shot in map(int, turned):
        other = first.setdefault(record.counts[shot].tobytes(), shot)
        if not np.array_equal(flown[other], flown[shot], equal_nan=True):
            yield Flag(
                name="records-repeated",
                sentence=f"shots {other} and {shot} have one and the same record in "
                "impact/encoder, and other flights of the ball",
                invalidates=True,
            )
            return


def encoder_halves(seen: Evidence) -> Iterator[Discrepancy]:
    """Compare the rate by the half of a record nearest contact with that by the whole record.

    Twice: the result by halves with the result, and the worst shot. Both in units of the result,
    which a shot moves by its weight.
    """
    for channel, which in (("encoder", "recoil"), ("swing", "swing")):
        fit = getattr(seen.readings, which)
        if fit is None or seen.metric is None or not seen.metric.u:
            continue
        lever = seen.effects * _by_rate(seen, which)  # 0 where the ball alone gives the result
        used = (lever != 0) & np.isfinite(lever) & np.isfinite(fit.by_half)
        if not used.any():
            continue
        apart, u = lever * (fit.by_half - fit.rate), np.abs(lever) * fit.by_half_u
        rounding, moves = RATE_ROUNDING * lever * fit.rate, 1 / seen.metric.u
        change = float(apart[used].sum())
        yield pair(
            "encoder-halves",
            f"half of each record of impact/{channel} moves the result by "
            f"{change * moves:+.2f} of its u, in {_shots(used)}",
            change,
            [type_a("fit", 0.0, sqrt(float((u[used] ** 2).sum())))],
            of="mean",
            least=abs(float(rounding[used].sum())),
            moves=moves,
        )
        singly = [
            pair(
                "encoder-halves",
                f"half of the record of shot {shot} of impact/{channel} moves the result by "
                f"{apart[shot] * moves:+.2f} of its u",
                float(apart[shot]),
                [type_a("fit", 0.0, float(u[shot]))],
                of="worst shot",
                least=abs(float(rounding[shot])),
                moves=moves,
                among=int(used.sum()),
            )
            for shot in np.flatnonzero(used)
        ]
        yield min(singly, key=lambda each: (each.harmful, each.likely))


def _by_rate(seen: Evidence, which: str) -> Array:
    """Return the metric's change per count a second of an encoder's rate, (shot,)."""
    fit, step = getattr(seen.readings, which), 1e-4

    def metric(factor: float) -> Array:
        turned = replace(fit, rate=fit.rate * factor)
        model = replace(seen.model, readings=replace(seen.readings, **{which: turned}))
        return model.metric(seen.best, model.shots(seen.best))

    return np.asarray((metric(1 + step) - metric(1 - step)) / (2 * step * fit.rate))


def recoil_and_rebound(seen: Evidence) -> Iterator[Discrepancy]:
    """Compare the mean e_A from the bat's recoil with that from the ball's rebound."""
    shots, valid = seen.shots, seen.judgement.valid
    apart = shots.recoil_efficiency - shots.rebound_efficiency
    both = valid & np.isfinite(apart)
    if both.sum() < FEWEST_SHOTS:
        return

    def mean_apart(x: Mapping[str, Array]) -> dict[str, Array]:
        found = seen.model.shots(x)
        difference = found.recoil_efficiency - found.rebound_efficiency
        return {"apart": difference[..., both].mean(axis=-1)}

    mean, shared = float(apart[both].mean()), propagate(mean_apart, seen.constants)["apart"]
    yield pair(
        "recoil-and-rebound",
        f"e_A by recoil (impact/encoder) less e_A by rebound (impact/gates) is {mean:+.4f} in the "
        f"mean of {_shots(both)}",
        mean,
        [*shared, _scatter(seen, apart[both], shared)],
        least=1e-5,
    )


def _scatter(seen: Evidence, apart: Array, shared: Sequence[Component]) -> Component:
    """Return the scatter of a mean, from the shots and from the aim marks.

    Recoil and rebound of a shot differ mainly because of its place along the bat, and the marks
    give the scatter of this place better than a few shots do.
    """
    degrees, square = apart.size - 1.0, float(apart.var(ddof=1))
    marks = seen.session.records["impact"].get("aim")
    lever = [part.sensitivity for part in shared if part.name == AIM_ALONG]
    if isinstance(marks, AimMarks) and marks.along.size >= FEWEST_SHOTS and lever:
        more = marks.along.size - 1.0
        marked = lever[0] ** 2 * float(marks.along.var(ddof=1))
        square = (degrees * square + more * marked) / (degrees + more)
        degrees += more
    return type_a("scatter", 0.0, sqrt(square / apart.size), dof=degrees)


def _distance(gate: int) -> str:
    return f"impact.gates.distance_{gate}"


def _between(
    board: int, last: int, part: float
) -> Callable[[Mapping[str, Array]], dict[str, Array]]:
    """Return the deviation of a board from its surveyed place, as a function of the survey."""

    def off(x: Mapping[str, Array]) -> dict[str, Array]:
        first, here, end = (x[_distance(k)][:, 0] for k in (0, board, last))
        return {"off": here - first - part * (end - first)}

    return off
