"""A fault: hooks that change the station, the plan, the specimen or the records of a test day.

A fault changes true values or written records, never the reduction. The calibrations remain those
that the laboratory believes in, unless the fault concerns the calibrations themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.simulation.instruments import FittedStation
from virtual_lab.simulation.stations.rig import Rig, RigOutput, ShotPlan, Specimen, Stage, Station
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

Hook = Callable[[Station], Station | None]


class FaultContext(NamedTuple):
    """Context in which a record is changed: station, plan and random numbers."""

    stage: Stage
    station: Station
    plan: ShotPlan
    play: RigOutput
    draws: Draws
    fault: str  # name of the fault, part of the names of its random numbers

    def chance(self, part: str = "", shape: tuple[int, ...] = ()) -> NDArray[np.float64]:
        """Return uniform random numbers from 0 to 1 for each shot, (shot, *shape)."""
        name = f"fault.{self.fault}{part}"
        return self.draws.uniform(name, shape, self.plan.slot) + 0.5

    def random_mask(self, share: float) -> NDArray[np.bool_]:
        """Return a mask of the shots in which an intermittent fault occurs, (shot,).

        `share` is the mean share of these shots.
        """
        return np.asarray(self.chance() < share)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault: hooks that change stations, plans or records. A None hook changes nothing."""

    name: str
    stage: Stage | None = Stage.IMPACT  # stage of the test that it affects; None: all stages
    # function that returns the faulty station, or None if the station cannot have the fault
    station: Hook | None = None
    specimen: Callable[[Specimen], Specimen] | None = None  # bat and balls that are really used
    plan: Callable[[ShotPlan], ShotPlan] | None = None  # plan that the machine really carries out
    channel: str = ""  # channel of the changed record, which an impact rig must have
    record: Callable[[Any, FaultContext], Mapping[str, Any]] | None = None  # changed arrays
    calibration: Callable[[Mapping[str, Estimate]], Mapping[str, Estimate]] | None = None

    def acts_at(self, stage: Stage) -> bool:
        """Return whether the fault affects a stage."""
        return self.stage in (None, stage)

    def possible_at(self, rig: Rig, station: Station) -> bool:
        """Return whether an impact rig with this station can have the fault."""
        if not self.acts_at(Stage.IMPACT):
            return True
        if self.channel:
            return self.channel in rig.channels
        return self.station is None or self.station(station) is not None


def change_constant(part: str, constant: str, *, times: float = 1.0, plus: float = 0.0) -> Hook:
    """Return a hook for `Fault.station` that changes a true constant but not its calibration.

    `part` is the name of the instrument. The true value of its `constant` is multiplied by `times`
    and then increased by `plus` [SI]. If the instrument has several constants of that name (name_0,
    name_1, …), only the last one is changed. The hook returns the changed station, or None for a
    station without the instrument or the constant.
    """

    def hook(station: Station) -> Station | None:
        instrument = instrument_of(station, part)
        true = getattr(instrument, "true", {})
        keys = [key for key in true if key.rstrip("_0123456789") == constant]
        if not keys:
            return None
        values = {keys[-1]: true[keys[-1]] * times + plus}
        return with_instrument(station, part, instrument.with_true(**values))

    return hook


def change_sheet(part: str, **values: float) -> Hook:
    """Return a hook for `Fault.station` that changes values on the data sheet of an instrument.

    `part` is the name of the instrument, and `values` are the new values [SI] by their keys on the
    sheet. The hook returns the changed station, or None if the station does not have the
    instrument, or if a key is missing on the data sheet.
    """

    def hook(station: Station) -> Station | None:
        spec = getattr(instrument_of(station, part), "spec", None)
        if spec is None or not values.keys() <= {one.name for one in fields(spec)}:
            return None
        return with_sheet(station, part, **values)

    return hook


def instrument_of(station: Station, part: str) -> Any:
    """Return the instrument `part` of a station, or None if the station does not have it.

    The result is also None if the station is not a `FittedStation`.
    """
    return station.instruments().get(part) if isinstance(station, FittedStation) else None


def with_instrument(station: Station, part: str, instrument: Any) -> Station:
    """Return a copy of the station with its instrument `part` replaced by `instrument`.

    Raises `KeyError` if the station has no such instrument, and `AttributeError` if it is not a
    `FittedStation`.
    """
    fitted: Any = station
    changed: Station = fitted.with_instrument(part, instrument)
    return changed


def with_sheet(station: Station, part: str, **changes: Any) -> Station:
    """Return a copy of the station with `changes` [SI] in the data sheet of the instrument `part`.

    The true constants and the certificate of the instrument do not change. Raises `AttributeError`
    if the station has no such instrument, and `TypeError` for a key that is not on the sheet.
    """
    instrument = instrument_of(station, part)
    spec = replace(instrument.spec, **changes)
    return with_instrument(station, part, replace(instrument, spec=spec))
