"""What holds a bat on a machine: where its axis is, and how high the bat lies in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Holder", "HolderSpec"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HolderSpec(Spec):
    """As it was set up and surveyed."""

    from_knob: Annotated[float, Gt(0), Dimension("length")]
    place_u: Annotated[float, Ge(0), Dimension("length")]
    height_u: Annotated[float, Ge(0), Dimension("length")]  # of the bat above the line of fire

    def ideal(self) -> Self:
        """Return the holder that holds the bat exactly where it should be."""
        return replace(self, place_u=0.0, height_u=0.0)


@dataclass(frozen=True, slots=True)
class Holder:
    """The holder of one laboratory, true places drawn once."""

    spec: HolderSpec
    from_knob: float
    height: float

    @classmethod
    def commission(cls, spec: HolderSpec, draws: Draws, name: str) -> Self:
        place, height = draws.normal(f"{name}.errors", (2,))
        return cls(
            spec, spec.from_knob + spec.place_u * float(place), spec.height_u * float(height)
        )

    def calibration(self) -> dict[str, Estimate]:
        """Return what the laboratory knows: the axis from the knob, the bat above the line."""
        return {
            "from_knob": Estimate(value=self.spec.from_knob, u=self.spec.place_u),
            "height": Estimate(value=0.0, u=self.spec.height_u),
        }

    def errors(self) -> dict[str, float]:
        """Return the true constants, to be sealed."""
        return {"from_knob": self.from_knob, "height": self.height}
