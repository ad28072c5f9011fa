"""Calibration of an instrument: the constants on its certificate, and the true constants.

A data sheet states each constant like a certificate: a value, which may differ from nominal, the
standard deviation σ of the true constant about this value, and the degrees of freedom ν of σ. The
true constant of one instrument differs from the value by σ N(0, 1). The uncertainty on its
certificate is itself an estimate, u = σ √(χ²_ν / ν), so (true - value) / u has Student's t
distribution with ν degrees of freedom. Without randomness the true constants equal the values of
the certificate, and u is σ.

The constants of one laboratory are numbers. Those of a block are arrays (laboratory,), which are
expanded to (shot,) when shots are simulated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from math import inf, sqrt
from typing import Annotated, Any, ClassVar, Generic, NamedTuple, Self, TypeVar, cast

import numpy as np
from annotated_types import Gt

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.records import Record
from virtual_lab.records.particulars import InstrumentIdentity
from virtual_lab.streams import Draws, Owner, of_owners
from virtual_lab.uncertainty.estimate import Estimate, Estimates
from virtual_lab.units import Array

TrueConstant = Any  # true value: a float for one laboratory, an array for a block
Stated = Estimate | Estimates  # value on the certificate

Freedom = Annotated[float, Gt(0), Dimension("number")]  # degrees of freedom, inf if not stated


class StandardDeviation(NamedTuple):
    """A standard deviation of repeated readings, minus a known variance of other causes."""

    total: float  # standard deviation of the readings
    dof: float  # degrees of freedom of `total`
    known: float = 0.0  # variance of the readings that has other causes

    @property
    def value(self) -> float:
        """The standard deviation without the known part."""
        return self._without_known(1.0)

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the standard deviation, for normal readings."""
        from scipy.special import chdtri

        low, high = (float(self.dof / chdtri(self.dof, p)) for p in (0.025, 0.975))
        return self._without_known(low), self._without_known(high)

    def _without_known(self, factor: float) -> float:
        return sqrt(max(factor * self.total**2 - self.known, 0.0))

    def scaled(self, factor: float) -> StandardDeviation:
        """Return the standard deviation of `factor` times the readings."""
        return StandardDeviation(factor * self.total, self.dof, factor**2 * self.known)

    @classmethod
    def of(cls, values: Array) -> Self:
        """Return the standard deviation of `values`, (n,), with n at least 2."""
        return cls(float(values.std(ddof=1)), values.size - 1)

    @classmethod
    def of_groups(cls, groups: Iterable[Array], known: float = 0.0) -> Self:
        """Return the pooled standard deviation of repeated values, 0 without repeats.

        Each group is an array (n,). `known` is the variance that has other causes.
        """
        return cls.pool([cls.of(each) for each in groups if each.size > 1], known)

    @classmethod
    def pool(cls, spreads: Sequence[StandardDeviation], known: float = 0.0) -> Self:
        """Return the pooled standard deviation. `known` is a further variance of other causes."""
        dof = sum(each.dof for each in spreads)
        if not dof:
            return cls(0.0, 0.0, known)
        variances = [(each.total**2, each.known) for each in spreads]
        total, part = np.average(variances, axis=0, weights=[each.dof for each in spreads]).tolist()
        return cls(sqrt(total), dof, part + known)


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedSpec(Spec):
    """A data sheet that states constants: NAME, NAME_u and optionally NAME_dof."""

    identity: InstrumentIdentity | None = None  # identity of the instrument, for certificates
    # endings of the names of errors, in addition to _u
    errors: ClassVar[tuple[str, ...]] = ("scatter", "jitter", "resolution", "repeatability")
    other_errors: ClassVar[tuple[str, ...]] = ()

    def ideal(self) -> Self:
        """Return the data sheet of an instrument without errors, which are 0 or False."""
        changes: dict[str, Any] = {}
        for part in fields(cast("Any", self)):
            name, value = part.name, getattr(self, part.name)
            if isinstance(value, CalibratedSpec):
                changes[name] = value.ideal()
            elif name.endswith(("_u", *self.errors)) or name in self.other_errors:
                is_tuple = isinstance(value, tuple)
                changes[name] = (0.0,) * len(value) if is_tuple else type(value)()
        return cast("Self", replace(cast("Any", self), **changes))

    def numbers_in(
        self, records: Sequence[Record], constants: Mapping[str, float]
    ) -> Mapping[str, object]:
        """Return numbers of the sheet that raw records show [SI], keyed by name.

        A standard deviation is a `StandardDeviation`.
        """
        return {}

    def certificate(self) -> dict[str, Estimate]:
        """Return the constants with their σ and degrees of freedom, keyed by name."""
        names = [part.name[:-2] for part in fields(cast("Any", self)) if part.name.endswith("_u")]
        return {
            name: stated_constant(
                getattr(self, name), getattr(self, f"{name}_u"), getattr(self, f"{name}_dof", inf)
            )
            for name in names
        }


S = TypeVar("S", bound=CalibratedSpec)


@lru_cache(maxsize=256)  # laboratories of a study have instruments of the same data sheets
def _certificate_of(spec: CalibratedSpec) -> Mapping[str, Estimate]:
    return spec.certificate()


def stated_constant(value: float, sigma: float, dof: float = inf) -> Estimate:
    """Return a constant from a data sheet, with the standard uncertainty `sigma`.

    `sigma` has the unit of `value`. `dof` is the number of degrees of freedom of `sigma`. If
    `sigma` is 0, the constant is exact and `dof` is replaced by inf.
    """
    return Estimate(value=value, u=sigma, dof=dof if sigma else inf)


def draw_constants(
    sheet: Mapping[str, Estimate], draws: Draws, name: str
) -> tuple[dict[str, Stated], dict[str, TrueConstant]]:
    """Return the constants on an instrument's certificate and its true constants, drawn at random.

    The result is two mappings, keyed by the name of the constant, in the units of `sheet`. For a
    block of laboratories, the constants on the certificate are `Estimates` and the true constants
    are arrays, both (laboratory,).

    Parameters
    ----------
    sheet
        Value, standard deviation σ and degrees of freedom ν of each constant. The true constant is
        normally distributed about the value with this σ. The certificate states the value with the
        standard uncertainty u = σ √(χ²_ν / ν), drawn at random, or u = σ if ν is inf.
    draws
        Random numbers of the laboratory or of the block.
    name
        Name of the instrument. It selects the stream of random numbers.
    """
    numbers = draws.normal(f"{name}.errors", 2 * len(sheet)).T
    laboratories = numbers.shape[1:]
    of_each = numbers.copy() if laboratories else numbers.tolist()
    stated: dict[str, Stated] = {}
    true: dict[str, TrueConstant] = {}
    for at, (key, constant) in enumerate(sheet.items()):
        error, chance = of_each[at], of_each[len(sheet) + at]
        share = _share(chance, constant.dof) if constant.dof < inf else 1.0
        stated[key] = repeat_constant(constant, laboratories, share)
        true[key] = constant.value + constant.u * error
    return stated, true


def repeat_constant(
    constant: Estimate, laboratories: tuple[int, ...], share: Array | float = 1.0
) -> Stated:
    """Return `constant` for one laboratory, or repeated for each laboratory of a block.

    `laboratories` is the shape of the block: (n,), or () for one laboratory. The result is
    `Estimates` for a block and an `Estimate` for one laboratory. Its standard uncertainty u is
    multiplied by `share`, a number, or an array (n,) for a block.
    """
    if not laboratories:
        return constant if share == 1.0 else replace(constant, u=constant.u * float(share))
    return Estimates(
        value=np.full(laboratories, constant.value),
        u=np.broadcast_to(constant.u * share, laboratories),
        dof=np.full(laboratories, constant.dof),
        evaluation=constant.evaluation,
        source=constant.source,
        pool=constant.pool,
    )


def _share(chance: Array | float, dof: float) -> Array:
    """Return u / σ of a certificate, in the shape of the standard normal numbers `chance`.

    A laboratory without randomness draws exactly 0. This gives u = σ, not the median of χ².
    """
    from virtual_lab.simulation.instruments.certificate_kernel import pieces_of, stated_shares

    chances = np.atleast_1d(chance)
    shares = np.empty(chances.shape)
    stated_shares(chances, pieces_of(dof), shares)
    return shares.reshape(np.shape(chance))


@dataclass(frozen=True, slots=True)
class CalibratedInstrument(Generic[S]):
    """An instrument: its data sheet, the constants on its certificate, and its true constants."""

    unknown: ClassVar[frozenset[str]] = frozenset()  # constants that no certificate states

    spec: S
    stated: Mapping[str, Stated]
    true: Mapping[str, TrueConstant]

    @classmethod
    def commission(cls, spec: S, draws: Draws, name: str) -> Self:
        """Return an instrument of a data sheet, with constants drawn under `name`."""
        return cls(spec, *draw_constants(_certificate_of(spec), draws, name))

    @property
    def laboratories(self) -> tuple[int, ...]:
        """Shape of a constant: () for one laboratory, (n,) for a block."""
        return np.shape(next(iter(self.true.values())))

    def at(self, owner: Owner) -> Self:
        """Return the instrument with the true constants of each shot's laboratory."""
        if owner is ...:
            return self
        return replace(self, true={key: of_owners(one, owner) for key, one in self.true.items()})

    def exact(self) -> dict[str, Estimate]:
        """Return the exact constants of the data sheet, which are on no certificate."""
        return {}

    def calibration(self) -> dict[str, Any]:
        """Return the known constants: `Estimate` for one laboratory, `Estimates` for a block."""
        constants = {key: stated for key, stated in self.stated.items() if key not in self.unknown}
        exact = self.exact().items()
        return constants | {key: repeat_constant(one, self.laboratories) for key, one in exact}

    def errors(self) -> dict[str, Any]:
        """Return the true constants, to be sealed."""
        return dict(self.true)

    def with_true(self, **true: TrueConstant) -> Self:
        """Return the instrument with other true constants but the same certificate.

        Raises `KeyError` for an unknown constant.
        """
        if strange := true.keys() - self.true.keys():
            raise KeyError(min(strange))
        return replace(self, true={**self.true, **true})
