"""The file of an interlaboratory study: its design, and the factors that vary."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields
from itertools import chain
from math import hypot
from typing import Annotated, Any, ClassVar, get_args, get_type_hints

from annotated_types import Ge, Le, MinLen

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.reading import Key
from virtual_lab.catalog.specs import Dimension, Spec, Whole
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.parameters import AnyDocument
from virtual_lab.sheets import document_text, toml_text
from virtual_lab.streams import LABORATORIES, LARGEST_SEED
from virtual_lab.studies.interlab.predicted import NominalTest

Share = Annotated[float | None, Ge(0), Le(0.1), Dimension("number")]
Slope = Annotated[float | None, Ge(0), Dimension("slope of speed")]
Length = Annotated[float | None, Ge(0), Dimension("length")]
Inertia = Annotated[float | None, Ge(0), Dimension("inertia")]
Rebound = Annotated[float | None, Ge(0.5), Le(1), Dimension("number")]


@dataclass(frozen=True, slots=True)
class InSheet:
    """Annotation of a factor's number: kind and name of the sheet that has it, and its key there.

    The name is empty for the ball of the procedure.
    """

    kind: str
    name: str
    key: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor(Spec, ABC):
    """Numbers of a factor, and its effect. A factor belongs to a lot or to a laboratory."""

    # patterns of the names of its random numbers, see `Selected`
    streams: ClassVar[tuple[str, ...]]
    of_lot: ClassVar[bool] = False

    @classmethod
    def places(cls) -> dict[str, InSheet]:
        """Return the place of each number in the data sheets, by key."""
        hints = get_type_hints(cls, include_extras=True)
        return {each.name: hints[each.name].__metadata__[-1] for each in fields(cls)}

    @abstractmethod
    def effect(self, test: NominalTest, result: str) -> float:
        """Return the standard deviation of a result [SI] that the factor causes, or minus it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LotFactor(Factor):
    """Standard deviations between lots of the level of e0, its slope, and the radius."""

    level: Annotated[Share, InSheet("balls", "", "restitution.value_u")] = None
    slope: Annotated[Slope, InSheet("balls", "", "restitution.slope_u")] = None
    radius: Annotated[Length, InSheet("balls", "", "radius_u")] = None
    streams = "lot", "lot.level"
    of_lot = True

    def effect(self, test: NominalTest, result: str) -> float:
        """Combine the effects of level, slope and radius."""
        line = test.ball.restitution
        level = test.by_level(result) * test.admitted_spread(line.value_u)
        return hypot(level, test.by_slope(result) * line.slope_u, test.radii[result])


@dataclass(frozen=True, slots=True, kw_only=True)
class StiffnessFactor(Factor):
    """Standard deviation between lots of the stiffness [share]."""

    spread: Annotated[Share, InSheet("balls", "", "stiffness_spread")] = None
    streams = ("lot.stiffness",)
    of_lot = True

    def effect(self, test: NominalTest, result: str) -> float:
        """Return the effect of the stiffness on e."""
        return test.slopes(result)[0] * test.derivatives[1] * test.ball.stiffness_spread


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreFactor(Factor):
    """Standard deviation between lots of the relative humidity of the store."""

    spread: Annotated[Share, InSheet("rigs", "bench", "store.humidity_spread")] = None
    streams = ("lot.store",)
    of_lot = True

    def effect(self, test: NominalTest, result: str) -> float:
        """Return the effect of the humidity by e0."""
        line, law = test.ball.restitution, test.ball.humidity
        stored = 0.0 if law is None else abs(law.slope) * line.value * test.humidity_spread
        return test.by_level(result) * test.e0 / line.value * test.admitted_spread(stored)


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationFactor(Factor):
    """Errors of all instruments, with the uncertainties of their data sheets."""

    streams = ("*.errors",)

    def effect(self, test: NominalTest, result: str) -> float:
        """Return the joint effect of all errors in the budget."""
        return test.calibrations[result]


@dataclass(frozen=True, slots=True, kw_only=True)
class WallFactor(Factor):
    """Mean and standard deviation of the rebound speed, relative to that from a rigid wall."""

    value: Annotated[Rebound, InSheet("rigs", "ball-wall", "wall_restitution")] = None
    spread: Annotated[Share, InSheet("rigs", "ball-wall", "wall_spread")] = None
    streams = ("ball-wall.wall",)

    def effect(self, test: NominalTest, result: str) -> float:
        """Return the effect of the measured e0."""
        return test.slopes(result)[1] * test.e0 * (self.spread or 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampFactor(Factor):
    """Mean and standard deviation of an unrecorded moment of inertia that turns with the bat."""

    value: Annotated[Inertia, InSheet("rigs", "astm-pivot", "pivot.clamp_inertia")] = None
    spread: Annotated[Inertia, InSheet("rigs", "astm-pivot", "pivot.clamp_spread")] = None
    streams = ("astm-pivot.clamp",)

    def effect(self, test: NominalTest, result: str) -> float:
        """Return the effect of the angular momentum that the recoil of the bat then lacks."""
        if test.procedure.reads != "recoil":
            return 0.0
        return test.slopes(result)[0] * (1 + test.e) / test.inertia * (self.spread or 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Factors(Spec):
    """The factors that vary. A factor that is left out is nominal in all laboratories.

    If a number of a factor is left out, the number of the data sheet is used.
    """

    lot: LotFactor | None = None
    stiffness: StiffnessFactor | None = None
    store: StoreFactor | None = None
    calibration: CalibrationFactor | None = None
    wall: WallFactor | None = None
    clamp: ClampFactor | None = None


# class of each factor, by its name
FACTORS: Mapping[str, type[Factor]] = {
    name: get_args(hint)[0] for name, hint in get_type_hints(Factors).items()
}


@dataclass(frozen=True, slots=True, kw_only=True)
class InterlabStudy(Spec):
    """Every procedure with every bat, in `exercises` sets of `laboratories` laboratories.

    Each laboratory tests the same nominal bat with `lots` lots of balls, `repeats` times with each.
    In addition, `alone` laboratories are simulated for each factor in which only this factor
    varies.
    """

    procedures: Annotated[tuple[str, ...], MinLen(1)]
    bats: Annotated[tuple[str, ...], MinLen(1)]
    laboratories: Annotated[Whole, Ge(2), Le(1000)]
    exercises: Annotated[Whole, Ge(1), Le(100_000)] = 1
    lots: Annotated[Whole, Ge(1), Le(20)] = 2
    repeats: Annotated[Whole, Ge(2), Le(100)] = 2
    alone: Annotated[Whole, Ge(0), Le(LABORATORIES)] = 0
    seed: Annotated[Whole, Ge(0), Le(LARGEST_SEED)]
    control: str | None = None  # control bat, tested in addition with the same lots
    factors: Factors

    def __post_init__(self) -> None:
        catalog.require_own_names("bats", self.bats)
        catalog.require_own_names("procedures", self.procedures)
        if self.alone == 1:
            raise ValueError("alone = 1 shows no scatter; allowed: 0, or at least 2")
        if not self.varied_factors:
            raise ValueError(f"factors: none is named; allowed: {', '.join(FACTORS)}")

    @property
    def varied_factors(self) -> tuple[str, ...]:
        """Names of the factors that vary."""
        return tuple(name for name in FACTORS if getattr(self.factors, name))

    @property
    def varied_streams(self) -> tuple[str, ...]:
        """Patterns of all random numbers, without the numbers of factors that are not named."""
        unnamed = (factor for name, factor in FACTORS.items() if name not in self.varied_factors)
        fixed = chain.from_iterable(factor.streams for factor in unnamed)
        return ("*", *(f"-{name}" for name in fixed))


def read_interlab(study: AnyDocument) -> Entry[InterlabStudy]:
    """Return the study in a file or mapping, with the sources of its numbers.

    Raises `InputError` if the file cannot be read, if a key is unknown, if a value is not allowed,
    or if a unit is wrong.
    """
    return catalog.read(*document_text(study, "study"), InterlabStudy)


def sheets_of(study: Entry[InterlabStudy], procedure: str, names: Sequence[str]) -> dict[Key, str]:
    """Return the text of each data sheet that the study changes, keyed by its kind and name.

    A key is, for example, ``("rigs", "ball-wall")``.

    Parameters
    ----------
    study
        The study, with the values of its factors.
    procedure
        Name of the procedure. Factors that belong to the production lot of the balls change the
        sheet of this procedure's ball.
    names
        Names of the factors to apply.

    Raises
    ------
    InputError
        The procedure is unknown, or a sheet does not contain the table of a value.
    """
    ball = catalog.load("procedures", procedure, Procedure).spec.ball
    document = parse_toml(study.text, "study")["factors"]
    sheets: dict[Key, dict[str, Any]] = {}
    places = ((name, *place) for name in names for place in FACTORS[name].places().items())
    for factor, key, place in places:
        if key not in document[factor]:
            continue
        sheet = place.kind, place.name or ball
        text, where = catalog.source(*sheet)
        content = sheets.setdefault(sheet, deepcopy(parse_toml(text, where)))
        *tables, last = place.key.split(".")
        for table in tables:
            if table not in content:
                raise InputError(where, table, None, f"is missing; {factor} needs it")
            content = content[table]
        content[last] = document[factor][key]
    return {key: toml_text(content) for key, content in sheets.items()}
