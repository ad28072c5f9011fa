"""The stated uncertainties of a laboratory, compared with the errors on the days of its twin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import Certification
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.tables import column
from virtual_lab.studies.twin.days import SIDE_BY_SIDE, TwinDays
from virtual_lab.units import Array

TOLERANCE = 0.1  # largest harmless relative error of u; its coverage then errs by less than 2 %


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinQuantity:
    """The stated uncertainty of one quantity beside the errors of the twin's days."""

    quantity: str = column("quantity")
    value: float = column("value", "SI", ".5g")
    u: float = column("stated u", "SI", ".3g")
    error_sd: float = column("sd of the errors", "SI", ".3g")
    error_sd_low: float = column("  at least", "SI", ".3g")  # 95 % interval of the sd
    error_sd_high: float = column("  at most", "SI", ".3g")
    u_ratio: float = column("u / sd", form=".3f")
    mean_z: float = column("mean error", "u", "+.3f")
    mean_z_se: float = column("  its standard error", "u", ".3f")
    finding: str = column("u is")

    @classmethod
    def of(cls, quantity: str, value: float, u: float, errors: Array) -> TwinQuantity:
        """Return the row of a quantity from the errors of the days, (day,)."""
        sd, dof = float(errors.std(ddof=1)), errors.size - 1
        low, high = (sd * float(np.sqrt(dof / chdtri(dof, p))) for p in (0.025, 0.975))
        finding = "right"
        if u < low * (1 - TOLERANCE):
            finding = "too small"
        elif u > high * (1 + TOLERANCE):
            finding = "too large"
        return cls(
            quantity=quantity,
            value=value,
            u=u,
            error_sd=sd,
            error_sd_low=low,
            error_sd_high=high,
            u_ratio=u / sd,
            mean_z=float(errors.mean()) / u,
            mean_z_se=sd / u / float(np.sqrt(errors.size)),
            finding=finding,
        )


def compare_quantities(
    certification: Certification, playing: TwinDays, days: int, progress: Progress = quiet
) -> tuple[list[TwinQuantity], int]:
    """Return one row per quantity, the metric first, and the number of days without a valid result.

    A row compares the stated standard uncertainty u of a quantity with the errors of this quantity
    on simulated days. Only days with a valid result are used. On these days, the instruments record
    only summary values, such as speeds, and not every edge and count.

    Parameters
    ----------
    certification
        The test. It must have a metric.
    playing
        Generator of simulated days. It simulates a copy of the laboratory (its twin), made from the
        laboratory's records.
    days
        Number of days to simulate.
    progress
        Function that is called with a message, the number of days done, and the total.

    Raises
    ------
    InputError
        Fewer than half of the days give a valid result.
    """
    assert certification.metric is not None
    stated = {"metric": certification.metric, **certification.quantities}
    stated.pop(certification.procedure.metric, None)  # equals the metric
    errors: dict[str, list[Array]] = {name: [] for name in stated}
    played = 0
    numbers = SIDE_BY_SIDE + np.arange(days)  # the days before them give the scatter
    for begin in range(0, days, SIDE_BY_SIDE):
        block = playing.play(numbers[begin : begin + SIDE_BY_SIDE])
        sound = block.certified.sound
        for name, parts in errors.items():
            error = block.certified.results[name].value - block.measurands[name]
            parts.append(error[sound])
        played += sound.size
        progress("days", played, days)
    valid = sum(part.size for part in errors["metric"])
    if valid < days / 2:
        allowed = f"only {valid} of {days} days of its twin give a valid result; needs half of them"
        raise InputError("", "folder", None, allowed)
    rows = [
        TwinQuantity.of(name, budget.value, budget.u, np.concatenate(errors[name]))
        for name, budget in stated.items()
    ]
    return rows, days - valid
