"""What a fault is: what it changes at the seams where a day in the laboratory can go wrong.

A fault changes what is true or what is written down, never what a reduction makes of it; the
calibrations stay as the laboratory believes them unless the fault is in the believing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.simulation.instruments import FittedStation
from virtual_lab.simulation.rig import Rig, RigOutput, ShotPlan, Specimen, Stage, Station
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

Standing = Callable[[Station], Station | None]


class FaultContext(NamedTuple):
    """A plan that was played, before its records are filed."""

    stage: Stage
    station: Station
    plan: ShotPlan
    play: RigOutput
    draws: Draws
    fault: str  # under whose name its chances are drawn

    def chance(self, part: str = "", shape: tuple[int, ...] = ()) -> NDArray[np.float64]:
        """Return numbers from 0 to 1 of each shot, (shot,) or (shot, *shape)."""
        name = f"fault.{self.fault}{part}"
        return self.draws.uniform(name, shape, self.plan.slot) + 0.5

    def some(self, share: float) -> NDArray[np.bool_]:
        """Return which shots a fault that comes and goes strikes, a `share` of them, (shot,)."""
        return np.asarray(self.chance() < share)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One thing that goes wrong, and what it makes of what comes by; None is sound."""

    name: str
    stage: Stage | None = Stage.IMPACT  # at which it acts; None: at all
    # what really stands there instead of a station; None where that offers no such thing
    station: Standing | None = None
    specimen: Callable[[Specimen], Specimen] | None = None  # the bat and the balls on the rig
    plan: Callable[[ShotPlan], ShotPlan] | None = None  # what the machine really does
    channel: str = ""  # whose record is changed, and that an impact rig must have
    record: Callable[[Any, FaultContext], Mapping[str, Any]] | None = None  # arrays as written down
    calibration: Callable[[Mapping[str, Estimate]], Mapping[str, Estimate]] | None = None

    def acts_at(self, stage: Stage) -> bool:
        """Return whether it changes anything at a stage."""
        return self.stage in (None, stage)

    def befalls(self, rig: Rig, station: Station) -> bool:
        """Return whether it can befall an impact rig, by what that and its station offer."""
        if not self.acts_at(Stage.IMPACT):
            return True
        if self.channel:
            return self.channel in rig.channels
        return self.station is None or self.station(station) is not None


def constant_off(part: str, constant: str, *, times: float = 1.0, plus: float = 0.0) -> Standing:
    """Return what makes a true constant of an instrument differ from its calibration.

    Of several that are numbered it is the last.
    """

    def standing(station: Station) -> Station | None:
        instrument = instrument_of(station, part)
        true = getattr(instrument, "true", {})
        keys = [key for key in true if key.rstrip("_0123456789") == constant]
        if not keys:
            return None
        off = {keys[-1]: true[keys[-1]] * times + plus}
        return fitted_with(station, part, instrument.altered(**off))

    return standing


def sheet_off(part: str, **values: float) -> Standing:
    """Return what makes an instrument differ from its sheet."""

    def standing(station: Station) -> Station | None:
        spec = getattr(instrument_of(station, part), "spec", None)
        if spec is None or not values.keys() <= {one.name for one in fields(spec)}:
            return None
        return other_sheet(station, part, **values)

    return standing


def instrument_of(station: Station, part: str) -> Any:
    """Return an instrument of a station by its name, None where it offers none."""
    return station.instruments().get(part) if isinstance(station, FittedStation) else None


def fitted_with(station: Station, part: str, instrument: Any) -> Station:
    """Return the station with another instrument of this name."""
    fitted: Any = station
    changed: Station = fitted.with_instrument(part, instrument)
    return changed


def other_sheet(station: Station, part: str, **changes: Any) -> Station:
    """Return a station one of whose instruments is not what its sheet says."""
    instrument = instrument_of(station, part)
    spec = replace(instrument.spec, **changes)
    return fitted_with(station, part, replace(instrument, spec=spec))
