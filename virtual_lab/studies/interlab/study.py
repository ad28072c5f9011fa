"""The file of an interlaboratory study: its design, and the factors that vary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge, Le, MinLen

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.reading import Key
from virtual_lab.catalog.specs import Dimension, Spec, Whole
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml, read_text
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.sheets import toml_text
from virtual_lab.streams import LABORATORIES, LARGEST_SEED

Share = Annotated[float | None, Ge(0), Le(0.1), Dimension("number")]
# for each factor and key in the study: kind and name of the sheet that has this number, and its key
# there
PLACES: Mapping[tuple[str, str], tuple[str, str, str]] = {
    ("lot", "level"): ("balls", "", "restitution.value_u"),
    ("lot", "slope"): ("balls", "", "restitution.slope_u"),
    ("lot", "radius"): ("balls", "", "radius_u"),
    ("stiffness", "spread"): ("balls", "", "stiffness_spread"),
    ("store", "spread"): ("rigs", "bench", "store.humidity_spread"),
    ("wall", "value"): ("rigs", "ball-wall", "wall_restitution"),
    ("wall", "spread"): ("rigs", "ball-wall", "wall_spread"),
    ("clamp", "value"): ("rigs", "astm-pivot", "pivot.clamp_inertia"),
    ("clamp", "spread"): ("rigs", "astm-pivot", "pivot.clamp_spread"),
}
# patterns of the names of the random numbers that belong to each factor, see `Selected`
NAMES: Mapping[str, tuple[str, ...]] = {
    "lot": ("lot", "lot.level"),
    "stiffness": ("lot.stiffness",),
    "store": ("lot.store",),
    "calibration": ("*.errors",),
    "wall": ("ball-wall.wall",),
    "clamp": ("astm-pivot.clamp",),
}
OF_LOTS = ("lot", "stiffness", "store")  # factors of a lot; all others are of a laboratory


@dataclass(frozen=True, slots=True, kw_only=True)
class LotFactor(Spec):
    """Standard deviations between lots of the level of e0, its slope, and the radius."""

    level: Share = None
    slope: Annotated[float | None, Ge(0), Dimension("slope of speed")] = None
    radius: Annotated[float | None, Ge(0), Dimension("length")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SpreadFactor(Spec):
    """Standard deviation between lots of the stiffness [share], or of the humidity of the store."""

    spread: Share = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationFactor(Spec):
    """Errors of all instruments, with the uncertainties of their data sheets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WallFactor(Spec):
    """Mean and standard deviation of the rebound speed, relative to that from a rigid wall."""

    value: Annotated[float | None, Ge(0.5), Le(1), Dimension("number")] = None
    spread: Share = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampFactor(Spec):
    """Mean and standard deviation of an unrecorded moment of inertia that turns with the bat."""

    value: Annotated[float | None, Ge(0), Dimension("inertia")] = None
    spread: Annotated[float | None, Ge(0), Dimension("inertia")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Factors(Spec):
    """The factors that vary. A factor that is left out is nominal in all laboratories.

    If a number of a factor is left out, the number of the data sheet is used.
    """

    lot: LotFactor | None = None
    stiffness: SpreadFactor | None = None
    store: SpreadFactor | None = None
    calibration: CalibrationFactor | None = None
    wall: WallFactor | None = None
    clamp: ClampFactor | None = None


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
        if not self.named:
            raise ValueError(f"factors: none is named; allowed: {', '.join(NAMES)}")

    @property
    def named(self) -> tuple[str, ...]:
        """Names of the factors that vary."""
        return tuple(each.name for each in fields(Factors) if getattr(self.factors, each.name))

    @property
    def varied(self) -> tuple[str, ...]:
        """Patterns of all random numbers, without the numbers of factors that are not named."""
        fixed = chain.from_iterable(names for key, names in NAMES.items() if key not in self.named)
        return ("*", *(f"-{name}" for name in fixed))


def read_interlab(path: Path) -> Entry[InterlabStudy]:
    """Return the study in a file, with the sources of its numbers.

    Raises `InputError` if the file cannot be read, if a key is unknown, if a value is not allowed,
    or if a unit is wrong.
    """
    return catalog.read(read_text(path), str(path), InterlabStudy)


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
    for (factor, key), (kind, name, place) in PLACES.items():
        if factor not in names or key not in document[factor]:
            continue
        sheet = kind, name or ball
        text, where = catalog.source(*sheet)
        content = sheets.setdefault(sheet, deepcopy(parse_toml(text, where)))
        *tables, last = place.split(".")
        for table in tables:
            if table not in content:
                raise InputError(where, table, None, f"is missing; {factor} needs it")
            content = content[table]
        content[last] = document[factor][key]
    return {key: toml_text(content) for key, content in sheets.items()}
