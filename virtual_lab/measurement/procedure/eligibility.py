"""Requirements on a bat before the first hit: weight, ring gauge, moment of inertia."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.reduction.kinematics import parallel_axis
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.output.rounding import beyond
from virtual_lab.units import INCH, OUNCE, OZ_IN2, Mask


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule and whether the bat meets it."""

    sentence: str
    met: bool


def findings(procedure: Procedure, bat: BatProperties) -> tuple[Finding, ...]:
    """Return the findings of the eligibility rules for a measured bat."""
    exempt = procedure.eligibility.exempt if procedure.eligibility else None
    found = [Finding(said(), bool(met)) for met, said in _rules(procedure, bat)]
    if exempt is None:
        return tuple(found)
    return tuple(
        each if each.met else replace(each, sentence=f"{each.sentence} ({exempt} are exempt)")
        for each in found
    )


def eligible(procedure: Procedure, bat: BatProperties) -> Mask:
    """Return whether bats meet all the rules, of the shape of their properties."""
    met = np.ones(np.shape(bat.length), dtype=bool)
    for each, _ in _rules(procedure, bat):
        met = met & each
    return met


def _rules(
    procedure: Procedure, bat: BatProperties
) -> Iterator[tuple[Mask | bool, Callable[[], str]]]:
    """Yield whether each rule is met, and a function that returns the sentence for one bat."""
    rules = procedure.eligibility
    if rules is None:
        return
    length, mass = bat.length, bat.mass
    if rules.length_less_weight is not None:
        less, most = np.round(length / INCH - mass / OUNCE, 2), rules.length_less_weight
        yield (
            less <= most,
            lambda: f"length less weight {less:.2f} (in, oz), allowed up to {most:g}",
        )
    if rules.barrel_diameter is not None:
        wide, ring = 2 * bat.barrel_radius, rules.barrel_diameter
        yield (
            wide <= ring,
            lambda: beyond(
                "barrel {0:.{d}f} in across, the ring passes {2:.{d}f} in",
                float(wide) / INCH,
                -inf,
                ring / INCH,
                3,
            ),
        )
    if rules.inertia_lengths:
        lever = length - procedure.pivot_from_knob - bat.z_cm
        inertia = np.asarray(parallel_axis(bat.inertia_cm, mass, lever))
        floor = np.interp(length, rules.inertia_lengths, rules.inertia_floors)
        yield (
            inertia >= floor,
            lambda: beyond(
                "moment of inertia {0:.{d}f} oz in² about the pivot, at least {1:.{d}f} for "
                f"{length / INCH:.1f} in",
                float(inertia) / OZ_IN2,
                float(floor) / OZ_IN2,
                inf,
                0,
            ),
        )
