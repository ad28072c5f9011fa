"""A calibration certificate: what is known of an instrument's constants, and what is true.

A sheet states each constant as its certificate does: a value, which differs from nominal, how far
the true constant lies from it (σ), and the degrees of freedom ν that σ was found with. Of one
instrument the true constant is off by σ N, and the uncertainty on its certificate is an estimate
itself: u = σ √(χ²_ν / ν), so that (true - value) / u is Student's t of ν. Without randomness the
true constants are the certificate's values, and u is σ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import inf
from typing import Annotated, Any, ClassVar, Generic, Self, TypeVar, cast

import numpy as np
from annotated_types import Gt
from scipy.special import gammaincinv, ndtr

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

Freedom = Annotated[float, Gt(0), Dimension("number")]  # degrees of freedom, inf where not stated


class CalibratedSpec(Spec):
    """A data sheet that states constants: NAME, NAME_u and maybe NAME_dof."""

    __slots__ = ()
    # how the errors of an instrument are named beside ..._u
    errors: ClassVar[tuple[str, ...]] = ("scatter", "jitter", "resolution", "repeatability")
    other_errors: ClassVar[tuple[str, ...]] = ()

    def ideal(self) -> Self:
        """Return the sheet of an instrument without errors: they are 0, or False."""
        changes: dict[str, Any] = {}
        for part in fields(cast("Any", self)):
            name, value = part.name, getattr(self, part.name)
            if isinstance(value, CalibratedSpec):
                changes[name] = value.ideal()
            elif name.endswith(("_u", *self.errors)) or name in self.other_errors:
                many = isinstance(value, tuple)
                changes[name] = (0.0,) * len(value) if many else type(value)()
        return cast("Self", replace(cast("Any", self), **changes))

    def certificate(self) -> dict[str, Estimate]:
        """Return the constants with their σ and degrees of freedom, by name."""
        names = [part.name[:-2] for part in fields(cast("Any", self)) if part.name.endswith("_u")]
        return {
            name: certified(
                getattr(self, name), getattr(self, f"{name}_u"), getattr(self, f"{name}_dof", inf)
            )
            for name in names
        }


S = TypeVar("S", bound=CalibratedSpec)


def certified(value: float, sigma: float, dof: float = inf) -> Estimate:
    """Return a constant as a sheet states it; one that is known exactly has no freedom to state."""
    return Estimate(value=value, u=sigma, dof=dof if sigma else inf)


def drawn(
    sheet: Mapping[str, Estimate], draws: Draws, name: str
) -> tuple[dict[str, Estimate], dict[str, float]]:
    """Return what the certificate of one instrument states, and its true constants."""
    errors, chances = draws.normal(f"{name}.errors", (2, len(sheet)))
    stated, true = {}, {}
    for (key, known), error, chance in zip(sheet.items(), errors, chances, strict=True):
        stated[key] = known
        # a quiet laboratory draws 0 exactly, which stands for σ itself and not for χ²'s median
        if chance and known.dof < inf:
            spread = 2 * gammaincinv(known.dof / 2, ndtr(chance)) / known.dof
            stated[key] = replace(known, u=known.u * float(np.sqrt(spread)))
        true[key] = known.value + known.u * float(error)
    return stated, true


@dataclass(frozen=True, slots=True)
class CalibratedInstrument(Generic[S]):
    """One instrument: its sheet, what its certificate states, and its true constants."""

    unknown: ClassVar[frozenset[str]] = frozenset()  # constants that no certificate states

    spec: S
    stated: Mapping[str, Estimate]
    true: Mapping[str, float]

    @classmethod
    def commission(cls, spec: S, draws: Draws, name: str) -> Self:
        """Return an instrument of a sheet, its constants drawn under `name`."""
        return cls(spec, *drawn(spec.certificate(), draws, name))

    def exact(self) -> dict[str, Estimate]:
        """Return what the sheet says beside the certificate, in which there is no error."""
        return {}

    def calibration(self) -> dict[str, Estimate]:
        """Return what the laboratory knows of the instrument."""
        known = {key: stated for key, stated in self.stated.items() if key not in self.unknown}
        return known | self.exact()

    def errors(self) -> dict[str, float]:
        """Return the true constants, to be sealed."""
        return dict(self.true)

    def altered(self, **true: float) -> Self:
        """Return the instrument with other true constants, of which its certificate knows nothing.

        Raises `KeyError` where it has no such constant.
        """
        if strange := true.keys() - self.true.keys():
            raise KeyError(min(strange))
        return replace(self, true={**self.true, **true})
