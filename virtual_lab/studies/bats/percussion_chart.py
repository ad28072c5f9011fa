"""Chart of e_A along the barrel of a pivoted bat: errors above, load on the axis below."""

from __future__ import annotations

from typing import TYPE_CHECKING

from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.studies.bats.curves import PLACE

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.output.page_figure import PageFigure

COLOURS = {"recoil": "#0072b2", "rebound": "#d55e00", "plain": "#009e73", "loose": "#cc79a7"}


def draw_percussion(table: pd.DataFrame, percussion_in: float, bat: str) -> PageFigure:
    """Draw three panels against the impact position: errors of e_A, shifts of e_A, and impulses.

    e_A is the collision efficiency. The errors are the rms differences of measured and true e_A;
    the upper panel also shows the stated u. The shifts are caused by the bearing of the pivot. The
    impulses act on the axis of the pivot.

    Parameters
    ----------
    table
        Table of the `PercussionStudy`, one row per impact position.
    percussion_in
        Center of percussion [in from the tip].
    bat
        Name of the bat, for the title.
    """
    table = table.astype(float)  # None (no detected rebound) becomes NaN
    # Close to the center of percussion only a loose bearing has an effect.
    apart = (table["impact_position_in"] - percussion_in).abs()
    rows = table[~apart.between(1e-6, 0.1, inclusive="neither")]
    z = rows["impact_position_in"]

    with page_figure(7.6, 7.6) as figure:
        errors, shifts, loads = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 2))
        for name, mark in (("recoil", "o"), ("rebound", "s")):
            colour = COLOURS[name]
            rms, u = 1e3 * rows[f"{name}_rms_error"], 1e3 * rows[f"{name}_rms_u"]
            errors.plot(z, rms, mark, color=colour, label=f"by {name}: rms error")
            errors.plot(z, u, "-", color=colour, label=f"by {name}: stated $u$")
        errors.set(ylabel="error of $e_A$, 10$^{-3}$", ylim=(0, None))
        figure.suptitle(
            f"{as_drawn(bat)} on its pivot: error of $e_A$ against impact position", fontsize=10
        )
        beside = errors.twinx()
        beside.spines["right"].set_visible(True)
        beside.plot(
            z, 100 * rows["rebounds_detected"], ":", color="0.4", label="rebounds detected (right)"
        )
        beside.set(ylabel="rebounds detected, %", ylim=(0, 100))
        handles = [*errors.get_legend_handles_labels()[0], *beside.get_lines()]
        errors.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
        plain, loose = "plain bearing, friction 0.09", "loose bearing, clearance ±0.2 mm"
        rigid, loose_shift = 1e3 * rows["plain_shift"], 1e3 * table["loose_shift"]
        shifts.plot(z, rigid, "^-", markersize=4, color=COLOURS["plain"], label=plain)
        every = table["impact_position_in"]
        shifts.plot(every, loose_shift, "D", markersize=4, color=COLOURS["loose"], label=loose)
        shifts.set_ylabel("shift of $e_A$\nby recoil, 10$^{-3}$")
        shifts.legend(loc="best")
        loads.plot(z, rows["reaction_ns"], "o-", markersize=4, color="black", label="on the axis")
        loads.set_ylabel("impulse on\nthe axis, N s")
        ringing = loads.twinx()
        ringing.spines["right"].set_visible(True)
        ringing.plot(
            z, rows["ring_mrad"], "--", color="0.4", label="vibration at the encoder (right)"
        )
        ringing.set(ylabel="amplitude of\nvibration, mrad", ylim=(0, None))
        loads.legend(handles=[*loads.get_lines(), *ringing.get_lines()], loc="upper center")
        loads.set_xlabel(PLACE)
        for axes in (errors, shifts, loads):
            axes.grid(True, linewidth=0.3)
            axes.axvline(percussion_in, color="0.6", linewidth=0.8, zorder=0)
        shifts.annotate(
            "center of\npercussion",
            (percussion_in, 0.12),
            xycoords=("data", "axes fraction"),
            xytext=(8, 0),
            textcoords="offset points",
            fontsize=7,
            color="0.4",
        )
        for axes in (shifts, loads):
            axes.axhline(0, color="0.6", linewidth=0.6, zorder=0)
    return figure
