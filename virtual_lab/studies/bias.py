"""The method's own bias: what is left of the error when nothing is random.

Ring, whole counts, drag and friction stay, and so do the steps of rule, scale and timer: each
reading is rounded once, always to the same side, and no scatter averages that out. Most of what
is left is this one draw of the rounding (it is in the budget); the rest is the reduction's.
"""

from __future__ import annotations

from virtual_lab import catalog
from virtual_lab.lab import TestSetup, certify_bat
from virtual_lab.measurement.model import QUANTITIES
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import Column
from virtual_lab.simulation.rig import Reality

__all__ = ["bias"]

COLUMNS = {"bat": Column("bat")} | {
    name: Column(name.replace("_", " "), form="+.1e") for name in QUANTITIES
}


def bias(
    procedure: str = "astm-f1881", *, progress: Progress = quiet
) -> Rows[dict[str, str | float | None]]:
    """Return a row a bat of the catalog: measured less true of every quantity.

    None where a bat gives no result: a scan may find no maximum.
    """
    rows, bats = [], catalog.names("bats")
    for number, bat in enumerate(bats):
        progress("bats", number, len(bats))
        tested = certify_bat(
            TestSetup.of(bat, procedure=procedure, seed=0, reality=Reality.NOISE_FREE)
        )
        measured, true = tested.certification.quantities, tested.sealed.measurand
        errors = {
            name: measured[name].value - true[name] if measured else None for name in QUANTITIES
        }
        rows.append({"bat": bat, **errors})
    return Rows(
        name="bias",
        title=f"by {procedure}, nothing random: measured less true",
        columns=COLUMNS,
        rows=rows,
    )
