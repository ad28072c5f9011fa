"""Requirements on a bat before the first hit: weight, ring gauge, moment of inertia."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.reduction.kinematics import parallel_axis
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.units import INCH, OUNCE, OZ_IN2


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule and whether the bat meets it."""

    sentence: str
    met: bool


def findings(procedure: Procedure, bat: BatProperties) -> tuple[Finding, ...]:
    """Return the findings of the eligibility rules for a measured bat."""
    exempt = procedure.eligibility.exempt if procedure.eligibility else None
    found = _findings(procedure, bat)
    if exempt is None:
        return tuple(found)
    return tuple(
        each if each.met else replace(each, sentence=f"{each.sentence} ({exempt} are exempt)")
        for each in found
    )


def _findings(procedure: Procedure, bat: BatProperties) -> Iterator[Finding]:
    rules = procedure.eligibility
    if rules is None:
        return
    length, mass = float(bat.length), float(bat.mass)
    if rules.length_less_weight is not None:
        less = round(length / INCH - mass / OUNCE, 2)
        most = rules.length_less_weight
        yield Finding(
            f"length less weight {less:.2f} (in, oz), allowed up to {most:g}", less <= most
        )
    if rules.barrel_diameter is not None:
        wide, ring = 2 * float(bat.barrel_radius), rules.barrel_diameter
        yield Finding(
            f"barrel {wide / INCH:.3f} in across, the ring passes {ring / INCH:.3f} in",
            wide <= ring,
        )
    if rules.inertia_lengths:
        lever = length - procedure.pivot_from_knob - float(bat.z_cm)
        inertia = float(parallel_axis(float(bat.inertia_cm), mass, lever))
        floor = float(np.interp(length, rules.inertia_lengths, rules.inertia_floors))
        yield Finding(
            f"moment of inertia {inertia / OZ_IN2:.0f} oz in² about the pivot, "
            f"at least {floor / OZ_IN2:.0f} for {length / INCH:.1f} in",
            inertia >= floor,
        )
