"""A calibration certificate: what is known of an instrument's constants, and what is true.

A sheet states each constant as its certificate does: a value, which differs from nominal, how far
the true constant lies from it (σ), and the degrees of freedom ν that σ was found with. Of one
instrument the true constant is off by σ N, and the uncertainty on its certificate is an estimate
itself: u = σ √(χ²_ν / ν), so that (true - value) / u is Student's t of ν. Without randomness the
true constants are the certificate's values, and u is σ.

Constants of one laboratory are numbers; those of a block are arrays (laboratory,), gathered to
(shot,) where shots are played.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import inf
from typing import Annotated, Any, ClassVar, Generic, Self, TypeVar, cast

import numpy as np
from annotated_types import Gt

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.records.particulars import InstrumentIdentity
from virtual_lab.streams import Draws, Owner, of_owners
from virtual_lab.uncertainty.estimate import Estimate, Known
from virtual_lab.units import Array

TrueConstant = Any  # what is true: float of one laboratory, array of a block
Stated = Estimate | Known  # what its certificate says of it

Freedom = Annotated[float, Gt(0), Dimension("number")]  # degrees of freedom, inf where not stated


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedSpec(Spec):
    """A data sheet that states constants: NAME, NAME_u and maybe NAME_dof."""

    identity: InstrumentIdentity | None = None  # of the instrument, for certificates
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
) -> tuple[dict[str, Stated], dict[str, TrueConstant]]:
    """Return what the certificate of one instrument states, and its true constants.

    Draws of a block give the instrument of every laboratory.
    """
    numbers = np.moveaxis(draws.normal(f"{name}.errors", 2 * len(sheet)), -1, 0)
    laboratories = numbers.shape[1:]
    of_each = numbers.copy() if laboratories else numbers.tolist()
    stated: dict[str, Stated] = {}
    true: dict[str, TrueConstant] = {}
    for at, (key, known) in enumerate(sheet.items()):
        error, chance = of_each[at], of_each[len(sheet) + at]
        share = _share(chance, known.dof) if known.dof < inf else 1.0
        stated[key] = at_all(known, laboratories, share)
        true[key] = known.value + known.u * error
    return stated, true


def at_all(known: Estimate, laboratories: tuple[int, ...], share: Array | float = 1.0) -> Stated:
    """Return an estimate with a `share` of its u as all laboratories have it, one alone or (n,)."""
    if not laboratories:
        return replace(known, u=known.u * float(share))
    return Known(
        value=np.full(laboratories, known.value),
        u=np.broadcast_to(known.u * share, laboratories),
        dof=np.full(laboratories, known.dof),
        evaluation=known.evaluation,
        source=known.source,
        pool=known.pool,
    )


def _share(chance: Array | float, dof: float) -> Array:
    """Return u over σ of a certificate, of the shape of its standard normal `chance`.

    A quiet laboratory draws 0 exactly, which stands for σ itself and not for χ²'s median.
    """
    from virtual_lab.simulation.instruments.certificate_kernel import pieces_of, stated_shares

    chances = np.atleast_1d(chance)
    shares = np.empty(chances.shape)
    stated_shares(chances, pieces_of(dof), shares)
    return shares.reshape(np.shape(chance))


@dataclass(frozen=True, slots=True)
class CalibratedInstrument(Generic[S]):
    """One instrument: its sheet, what its certificate states, and its true constants."""

    unknown: ClassVar[frozenset[str]] = frozenset()  # constants that no certificate states

    spec: S
    stated: Mapping[str, Stated]
    true: Mapping[str, TrueConstant]

    @classmethod
    def commission(cls, spec: S, draws: Draws, name: str) -> Self:
        """Return an instrument of a sheet, its constants drawn under `name`."""
        return cls(spec, *drawn(spec.certificate(), draws, name))

    @property
    def laboratories(self) -> tuple[int, ...]:
        """The shape of a constant: () of one laboratory, (n,) of a block."""
        return np.shape(next(iter(self.true.values())))

    def at(self, owner: Owner) -> Self:
        """Return the instrument with the true constants of the laboratories that own shots."""
        return replace(self, true={key: of_owners(one, owner) for key, one in self.true.items()})

    def exact(self) -> dict[str, Estimate]:
        """Return what the sheet says beside the certificate, in which there is no error."""
        return {}

    def calibration(self) -> dict[str, Any]:
        """Return what is known of the instrument: `Estimate`, `Known` of a block."""
        known = {key: stated for key, stated in self.stated.items() if key not in self.unknown}
        exact = self.exact().items()
        return known | {key: at_all(one, self.laboratories) for key, one in exact}

    def errors(self) -> dict[str, Any]:
        """Return the true constants, to be sealed."""
        return dict(self.true)

    def altered(self, **true: TrueConstant) -> Self:
        """Return the instrument with other true constants, of which its certificate knows nothing.

        Raises `KeyError` where it has no such constant.
        """
        if strange := true.keys() - self.true.keys():
            raise KeyError(min(strange))
        return replace(self, true={**self.true, **true})
