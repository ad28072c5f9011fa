"""The method's own bias: what is left of the error when nothing is random.

Ring, whole counts, drag and friction stay, and so do the steps of rule, scale and timer: each
reading is rounded once, always to the same side, and no scatter averages that out. Most of what
is left is this one draw of the rounding (it is in the budget); the rest is the reduction's.
"""

from __future__ import annotations

from typing import Any

from virtual_lab import catalog
from virtual_lab.lab import TestSetup, certify_bat
from virtual_lab.measurement.model import QUANTITIES
from virtual_lab.simulation.rig import Reality

__all__ = ["bias"]


def bias(procedure: str = "astm-f1881") -> list[dict[str, Any]]:
    """Return a row a bat of the catalog: measured less true of every quantity.

    None where a bat gives no result: a scan may find no maximum.
    """
    rows = []
    for bat in catalog.names("bats"):
        setup = TestSetup.of(bat, procedure=procedure, seed=0, reality=Reality.NOISE_FREE)
        tested = certify_bat(setup)
        measured, true = tested.certification.quantities, tested.sealed.measurand
        errors = {
            name: measured[name].value - true[name] if measured else None for name in QUANTITIES
        }
        rows.append({"bat": bat, **errors})
    return rows
