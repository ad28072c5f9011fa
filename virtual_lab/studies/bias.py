"""Bias of the method: the error of a simulated test without randomness.

The test still includes vibration of the bat, encoder counts rounded to integers, drag, friction,
and the resolution of rule, scale and timer. Without scatter, rounding a reading always gives the
same error. Most of the bias is this rounding error, which the budget includes; the rest comes from
the reduction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab import catalog
from virtual_lab.lab import TestSetup, certify_bat
from virtual_lab.lab.measurand import STANDARD_BALL
from virtual_lab.measurement.procedure.model import QUANTITIES
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.output.tables import Column
from virtual_lab.parameters import AnyLaboratory
from virtual_lab.sheets import AnyProcedure, Instruments, entry_name
from virtual_lab.simulation.stations.rig import Reality

FORMULA = "formula_error"

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Biases(Rows[dict[str, str | float | None]]):
    """Systematic errors, one row per bat."""

    def draw(self) -> PageFigure:
        """Draw the errors as bars, one panel per quantity and one bar per bat."""
        with page_figure(1.4 + 0.2 * len(self.rows)) as figure:
            panels = figure.subplots(1, len(QUANTITIES), sharex=True, sharey=True)
            for axes, name in zip(panels, QUANTITIES, strict=True):
                biases = [row[f"{name}_bias"] for row in self.rows]
                errors = np.array(biases, dtype=float)  # None: NaN
                bats = [
                    f"{as_drawn(str(row['bat']))}{' (no result)' if bias is None else ''}"
                    for row, bias in zip(self.rows, biases, strict=True)
                ]
                axes.barh(bats, 1e3 * errors, color="0.4")
                axes.axvline(0, color="black", linewidth=0.6)
                axes.set_title(name.replace("_", "\n"))
            panels[0].invert_yaxis()
            figure.suptitle(as_drawn(self.title), fontsize=8)
            figure.supxlabel("measured minus true value, 10$^{-3}$", fontsize=8)
        return figure


def bias(
    procedure: AnyProcedure = "astm-f1881",
    *,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> Biases:
    """Show the error of the method alone.

    It is the measured minus the true value, without randomness. The table has one row per bat in
    the catalog and one column per quantity, such as ``restitution_bias``. An entry is None if the
    test of the bat gave no result, for example if a scan has no maximum. If the procedure converts
    the metric to a standard ball, ``formula_error`` is the metric by this formula minus that of the
    bat struck by the standard ball, both true.

    Parameters
    ----------
    procedure
        The test procedure: a name in the catalog or a .toml file.

        Or a sheet: ``vl.procedure("bbcor").with_(valid_hits=8)``.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with a message, the number of bats done, and the total. If it is not
        given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        The procedure is unknown, or a file cannot be used.
    """
    procedure = entry_name(procedure)
    rows, bats, table = [], catalog.names("bats"), dict[str, list[float]]()
    for number, bat in enumerate(bats):
        progress("bats", number, len(bats))
        tested = certify_bat(
            TestSetup.of(bat, procedure=procedure, seed=0, reality=Reality.NOISE_FREE)
        )
        measured, true = tested.certification.quantities, tested.sealed.measurand
        errors: dict[str, float | None] = {
            f"{name}_bias": measured[name].value - true[name] if measured else None
            for name in QUANTITIES
        }
        if tested.certification.procedure.standard_restitution is not None:
            errors[FORMULA] = true["metric"] - true[STANDARD_BALL] if measured else None
        for name, error in errors.items():
            if error is not None:
                table.setdefault(name, []).append(error)
        rows.append({"bat": bat, **errors})
    columns = {name: Column(name.replace("_", " "), form="+.1e") for name in table}
    return Biases(
        name="bias",
        title=f"measured minus true value by {procedure}, without randomness",
        columns={"bat": Column("bat")} | columns,
        words="\n".join(
            f"{columns[name].title}: {min(values):+.1e} to {max(values):+.1e} over all bats"
            for name, values in table.items()
        ),
        rows=rows,
    )
