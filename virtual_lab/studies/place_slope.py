"""Slope of e_A along the barrel at the impact position of a test, for the sheet of a procedure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.lab import Laboratory, TestSetup
from virtual_lab.lab.measurand import true_curve
from virtual_lab.measurement.procedure import Procedure, percussion_position
from virtual_lab.output.result import Rows
from virtual_lab.output.style import INTERVAL_GREY, as_drawn, page_figure
from virtual_lab.output.tables import column
from virtual_lab.parameters import AnyLaboratory
from virtual_lab.sheets import AnyBats, AnyProcedure, Instruments, entry_name, entry_names
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.stations.rig import Reality
from virtual_lab.units import INCH

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure


@dataclass(frozen=True, slots=True, kw_only=True)
class Slope:
    """Slope of one bat, or the mean or standard deviation over all bats, which have no position."""

    bat: str = column("bat")
    impact_position_in: float | None = column("position from the tip", "in")
    slope_per_in: float = column("slope of e_A", "1/in", "+.4f")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Slopes(Rows[Slope]):
    """Slopes of the bats, their mean and standard deviation, and the slope in the procedure."""

    on_sheet: tuple[float, float]  # slope of the procedure, and its standard uncertainty [1/in]

    def draw(self) -> PageFigure:
        """Draw the slope of each bat, and their mean, against the slope on the sheet."""
        *bats, mean, deviation = self.rows
        value, u = self.on_sheet
        with page_figure(1.3 + 0.25 * len(bats)) as figure:
            axes = figure.subplots()
            words = "slope on the sheet of the procedure ± $u$"
            axes.axvspan(value - u, value + u, color=INTERVAL_GREY, linewidth=0, label=words)
            axes.axvline(value, color="0.5", linewidth=0.6)
            names = [as_drawn(row.bat) for row in bats]
            axes.plot([row.slope_per_in for row in bats], names, "ok", label="bat")
            spread, words = deviation.slope_per_in, "mean ± standard deviation"
            axes.errorbar(mean.slope_per_in, words, xerr=spread, capsize=3, fmt="Dk", label=words)
            title = as_drawn(self.title).replace("e_A", "$e_A$")
            axes.set(title=title, ymargin=0.1, xlabel="slope of $e_A$ along the barrel, 1/in")
            axes.invert_yaxis()
            figure.legend(loc="outside lower center", ncols=3)
        return figure


def slope(
    bats: AnyBats = (),
    *,
    procedure: AnyProcedure = "astm-f1881",
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
) -> Slopes:
    """Show the slope of e_A.

    It is the slope along the barrel [1/in] at the impact position of a procedure. There is one row
    per bat, then one row for the mean and one for the standard deviation over the bats. Bats and
    ball have their nominal values. The procedure states the ball speed.

    Parameters
    ----------
    bats
        At least two bats: names in the catalog or .toml files. By default the four bats of Table I
        of the paper of 2003.

        In Python, sheets such as ``vl.bat("r161")`` are also allowed.
    procedure
        Procedure that tests one impact position: a name in the catalog or a .toml file.

        In Python, a sheet such as ``vl.procedure("bbcor")`` is also allowed.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.

    Raises
    ------
    InputError
        A name is unknown, only one bat is given, or the procedure scans the barrel.
    """
    procedure = entry_name(procedure)
    bats = entry_names(bats) or ("r161", "ea70", "barrel-loaded", "knob-loaded")
    if len(bats) < 2:
        raise InputError("", "bats", len(bats), "allowed: 2 or more, for a standard deviation")
    rows = [_slope(bat, procedure) for bat in bats]
    slopes = [row.slope_per_in for row in rows]
    statistics = {"mean": float(np.mean(slopes)), "deviation": float(np.std(slopes, ddof=1))}
    rows += [
        Slope(bat=name, impact_position_in=None, slope_per_in=value)
        for name, value in statistics.items()
    ]
    title = f"slope of e_A along the barrel at the impact position of {procedure}"
    rules = catalog.load("procedures", procedure, Procedure).spec
    on_sheet = (rules.place_slope * INCH, rules.place_slope_u * INCH)
    return Slopes(name="slope", title=title, rows=rows, on_sheet=on_sheet)


def _slope(bat: str, procedure: str) -> Slope:
    setup = TestSetup.of(
        bat, procedure=procedure, seed=0, reality=Reality.IDEAL, collision_model="modal"
    )
    laboratory = Laboratory.open(setup)
    rules, specimen = laboratory.rules.spec, laboratory.specimen
    if rules.scan is not None:
        raise InputError(
            "", "procedure", procedure, "allowed: one that tests at one impact position"
        )
    beam = beam_of(specimen.bat.body)
    inertial = {name: getattr(beam, name) for name in ("mass", "length", "z_cm", "inertia_cm")}
    place = percussion_position(inertial, rules.pivot_from_knob)
    step = 4e-3  # distance to either side [m]
    ends = place + step * np.array([-1.0, 1.0])
    curve = true_curve(laboratory.impact, specimen, rules, ends)
    rise = float(np.diff(curve.collision_efficiency)[0])
    return Slope(bat=bat, impact_position_in=place / INCH, slope_per_in=rise / (2 * step) * INCH)
