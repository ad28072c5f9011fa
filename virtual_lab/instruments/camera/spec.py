"""What data sheets say of a camera and its sensor, and how what stands before it looks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

from annotated_types import Ge, Gt, Le, Lt

from virtual_lab.specs import Dimension, PositiveLength, PositiveNumber, Spec, SpreadNumber

__all__ = ["BallLook", "SensorSpec"]

Share = Annotated[float, Ge(0), Le(1), Dimension("number")]
Count = Annotated[int, Gt(0), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSpec(Spec):
    """A sensor in the terms of EMVA 1288; electrons are photoelectrons."""

    columns: Count
    rows: Count
    pixel: PositiveLength
    quantum_efficiency: Annotated[float, Gt(0), Le(1), Dimension("number")]
    full_well: PositiveNumber  # [e]
    gain: PositiveNumber  # grey values an electron
    gain_u: SpreadNumber  # relative
    read_noise: SpreadNumber  # [e]
    dark_current: Annotated[float, Ge(0), Dimension("rate")]  # [e/s]
    photo_response: SpreadNumber  # its non-uniformity, PRNU: relative, pixel to pixel
    dark_signal: SpreadNumber  # its non-uniformity, DSNU: pixel to pixel [e]
    black_level: SpreadNumber  # grey value without light
    bits: Annotated[int, Ge(1), Le(16), Dimension("number")]
    whole_counts: bool = True

    @property
    def full_scale(self) -> int:
        """The greatest grey value."""
        return int(2**self.bits - 1)

    def ideal(self) -> Self:
        """Return a sensor of alike pixels that shows real numbers and adds no noise of its own."""
        return replace(
            self,
            gain_u=0.0,
            read_noise=0.0,
            dark_current=0.0,
            photo_response=0.0,
            dark_signal=0.0,
            whole_counts=False,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BallLook(Spec):
    """How a ball looks: its albedo, and how its seam is darker."""

    albedo: Share
    seam_contrast: Share  # how much darker the seam is, as a share; 0: a plain ball
    seam_width: PositiveNumber = 0.14  # half of it, stitches and all, in radii of the ball
    neck: Annotated[float, Gt(0), Lt(1), Dimension("number")] = (
        0.34  # half, between seams, in radii
    )
