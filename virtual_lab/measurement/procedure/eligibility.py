"""Requirements on a bat before the first hit: weight, length, ring gauge, moment of inertia."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np

from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.reduction.kinematics import parallel_axis
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.output.rounding import limit_message
from virtual_lab.units import INCH, OUNCE, OZ_IN2, Mask


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule and whether the bat meets it."""

    sentence: str
    met: bool


class BatRule(NamedTuple):
    """A rule for bats, with the bats of a block that meet it."""

    met: Mask  # (laboratory,)
    sentence: Callable[[int], str]  # sentence for a laboratory


def findings(procedure: Procedure, bat: BatProperties) -> tuple[Finding, ...]:
    """Return one finding per eligibility rule of a procedure: whether a measured bat meets it.

    The tuple is empty if the procedure states no such rules.
    """
    return tuple(Finding(rule.sentence(0), bool(rule.met[0])) for rule in bat_rules(procedure, bat))


def exemption(procedure: Procedure, construction: str) -> str:
    """Return the reason why a procedure requires no test of a bat, "" if it requires one.

    `construction` is the construction of the bat, "" if it is not known.
    """
    exempt = (procedure.eligibility and procedure.eligibility.exempt) or ""
    if not construction or construction not in exempt:
        return ""
    return f"no test required: {construction} (recalled, unverified)"


def bat_rules(procedure: Procedure, bat: BatProperties) -> Iterator[BatRule]:
    """Yield each eligibility rule of a procedure, with a mask of the bats that meet it.

    The mask is (laboratory,). A rule that all bats meet is yielded too. Nothing is yielded if the
    procedure states no rules.
    """
    rules = procedure.eligibility
    if rules is None:
        return
    exempt = f" ({rules.exempt} are exempt, if the construction is stated)" if rules.exempt else ""

    def rule(met: Mask, sentence: Callable[[int], str]) -> BatRule:
        return BatRule(met, lambda i: sentence(i) if met[i] else sentence(i) + exempt)

    length, mass = np.ravel(bat.length), np.ravel(bat.mass)
    if rules.length_less_weight is not None:
        less, most = np.round(length / INCH - mass / OUNCE, 2), rules.length_less_weight
        yield rule(
            less <= most,
            lambda i: (
                f"length in inches minus weight in ounces {less[i]:.2f}, allowed up to {most:g}"
            ),
        )
    if rules.greatest_length is not None:
        longest = rules.greatest_length
        yield rule(
            length <= longest,
            lambda i: limit_message(
                "length {0:.{d}f} in, allowed up to {2:.{d}f} in",
                float(length[i]) / INCH,
                -inf,
                longest / INCH,
                2,
            ),
        )
    if rules.barrel_diameter is not None:
        diameter, ring = 2 * np.ravel(bat.barrel_radius), rules.barrel_diameter
        yield rule(
            diameter <= ring,
            lambda i: limit_message(
                "barrel diameter {0:.{d}f} in, allowed up to {2:.{d}f} in (ring gauge)",
                float(diameter[i]) / INCH,
                -inf,
                ring / INCH,
                3,
            ),
        )
    if rules.inertia_lengths:
        lever = length - procedure.pivot_from_knob - np.ravel(bat.z_cm)
        inertia = np.asarray(parallel_axis(np.ravel(bat.inertia_cm), mass, lever))
        floor = np.interp(length, rules.inertia_lengths, rules.inertia_floors)
        yield rule(
            inertia >= floor,
            lambda i: limit_message(
                "moment of inertia about the pivot {0:.{d}f} oz in², required at least {1:.{d}f} "
                f"for a length of {length[i] / INCH:.1f} in",
                float(inertia[i]) / OZ_IN2,
                float(floor[i]) / OZ_IN2,
                inf,
                0,
            ),
        )
