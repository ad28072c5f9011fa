"""Checks of the shots at the bat: passages, aim, encoder, and recoil against rebound."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import sqrt

import numpy as np

from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import FALSE_ALARMS, Flag, chance
from virtual_lab.measurement.reduction.flights import gate_count
from virtual_lab.measurement.reduction.gates import INBOUND
from virtual_lab.measurement.reduction.rate import MOST_MISFIT
from virtual_lab.measurement.reduction.shot_algebra import drag_of
from virtual_lab.records import AimMarks
from virtual_lab.relations.flight import time_before
from virtual_lab.uncertainty.budget import Component, propagate, type_a
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

FEWEST_SHOTS = 3  # shots that a mean and its scatter may rest on


def ball_seen(seen: Evidence) -> Iterator[Flag]:
    """Count incoming balls that a gate did not see: faultless gates see every one."""
    missed = ~np.isfinite(seen.readings.passages.times[:, INBOUND]).all(axis=1)
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


def boards_in_line(seen: Evidence) -> Iterator[Flag]:
    """Compare each board between first and last with the flight through these two."""
    known, best = seen.constants, seen.best
    last = gate_count(known, "impact") - 1
    drag = drag_of(best, seen.shots.ball_mass)
    reach = [time_before(best[_distance(k)], 1.0, drag) for k in range(last + 1)]
    times, valid = seen.readings.passages.times[:, INBOUND], seen.judgement.valid
    for board in range(1, last):
        part = (times[:, board] - times[:, 0]) / (times[:, last] - times[:, 0])
        off = (reach[board] - reach[0] - part * (reach[last] - reach[0]))[valid]
        off, share = off[np.isfinite(off)], part[valid][np.isfinite(off)]
        if off.size < FEWEST_SHOTS:
            continue
        place = {_distance(k): known[_distance(k)] for k in (0, board, last)}
        survey = propagate(_between(board, last, float(share.mean())), place)["off"]
        if found := _certainly_off(off, survey):
            yield Flag(
                name="boards-in-line",
                sentence=f"board {board} stands {found[0] * 1e3:+.2f} mm off the flight through "
                f"its neighbours, {found[1]:.1f} standard uncertainties",
            )


def aim(seen: Evidence) -> Iterator[Flag]:
    """Compare the mean of the marks on the aim paper with the aim, both ways."""
    marks = seen.session.records["impact"].get("aim")
    if not isinstance(marks, AimMarks):
        return
    nothing = Estimate(value=0.0)
    lined_up = seen.constants.get("impact.cannon.along", nothing)
    height = seen.constants.get("impact.pivot.height", nothing)
    aimed = (("along", marks.along, lined_up), ("across", marks.across, height))
    for way, marked, at in aimed:
        off = marked - at.value
        if off.size < FEWEST_SHOTS:
            continue
        survey = propagate(lambda x: {"off": x["along"][:, 0]}, {"along": lined_up})["off"]
        if found := _certainly_off(off, survey):
            yield Flag(
                name="aim",
                sentence=f"the marks lie {found[0] * 1e3:+.1f} mm off the aim {way} the bat, "
                f"{found[1]:.1f} standard uncertainties",
            )


def _certainly_off(off: Array, survey: Sequence[Component]) -> tuple[float, float] | None:
    """Return the mean [m], also in standard uncertainties; None where chance may have made it."""
    mean = float(off.mean())
    scatter = type_a("scatter", 0.0, float(off.std(ddof=1)) / sqrt(off.size), dof=off.size - 1)
    u, likely = chance(mean, [*survey, scatter], least=1e-5)
    return (mean, abs(mean) / u) if likely < FALSE_ALARMS else None


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


def recoil_and_rebound(seen: Evidence) -> Iterator[Flag]:
    """Compare the mean e_A from the bat's recoil with that from the ball's rebound."""
    shots, valid = seen.shots, seen.judgement.valid
    apart = shots.recoil_efficiency - shots.rebound_efficiency
    both = valid & np.isfinite(apart)
    if both.sum() < FEWEST_SHOTS:
        return

    def mean_apart(x: Mapping[str, Array]) -> dict[str, Array]:
        found = seen.results(x)
        difference = found.recoil_efficiency - found.rebound_efficiency
        return {"apart": difference[..., both].mean(axis=-1)}

    mean, shared = float(apart[both].mean()), propagate(mean_apart, seen.constants)["apart"]
    u, likely = chance(mean, [*shared, _scatter(seen, apart[both], shared)], least=1e-5)
    if likely < FALSE_ALARMS:
        yield Flag(
            name="recoil-and-rebound",
            sentence=f"e_A by recoil less e_A by rebound is {mean:+.4f} in the mean, "
            f"{abs(mean) / u:.1f} standard uncertainties",
            invalidates=abs(mean) > 6 * u,
        )


def _scatter(seen: Evidence, apart: Array, shared: Sequence[Component]) -> Component:
    """Return the scatter of a mean, from the shots and from the aim marks.

    Recoil and rebound of a shot differ mainly because of its place along the bat, and the marks
    give the scatter of this place better than a few shots do.
    """
    degrees, square = apart.size - 1.0, float(apart.var(ddof=1))
    marks = seen.session.records["impact"].get("aim")
    lever = [part.sensitivity for part in shared if part.name == "impact.cannon.along"]
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
