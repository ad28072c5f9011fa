"""Figures of curves along a bat as PNG."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from virtual_lab.output.rounding import with_axis_unit
from virtual_lab.output.style import as_drawn, page_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from virtual_lab.output.page_figure import PageFigure

COLOURS = ("black", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
DASHES = ("-", "--", ":", "-.")
PLACE = "impact position from the barrel tip $z$, in"


def draw_profile(table: pd.DataFrame, title: str) -> PageFigure:
    """Draw Fig. 2 of the paper: two panels of quantities against the impact position.

    The upper panel shows the bat-ball restitution e, the recoil factor r, and the collision
    efficiency e_A. The lower panel shows e_A, the bat speed v_bat, and the batted-ball speed v_f.
    The speeds are in mph.

    Parameters
    ----------
    table
        The `BatProfile.table`, one row per impact position.
    title
        Title of the figure.
    """
    with page_figure(6.6, 6.0) as figure:
        above, below = figure.subplots(2, 1, sharex=True)
        plot_profile(above, below, table)
        above.set_title(as_drawn(title))
    return figure


def plot_profile(above: Axes, below: Axes, table: pd.DataFrame) -> None:
    """Plot e, r and e_A in `above`, and e_A, v_bat and v_f in `below`.

    e is the bat-ball restitution, r the recoil factor, e_A the collision efficiency, v_bat the bat
    speed, and v_f the batted-ball speed. `table` is the `BatProfile.table`. The speeds are in mph.
    """
    z = table["impact_position_in"]
    for column, label, dash in (
        ("restitution", "$e$", "-"),
        ("recoil_factor", "$r$", ":"),
        ("collision_efficiency", "$e_A$", "--"),
    ):
        above.plot(z, table[column], dash, color="black", label=label)
    above.set_ylabel("$e$, $r$, $e_A$")
    for column, label, dash in (
        ("bat_speed_mph", "$v_{bat}$", ":"),
        ("batted_speed_mph", "$v_f$", "-"),
    ):
        below.plot(z, table[column], dash, color="black", label=label)
    beside = below.twinx()
    beside.spines["right"].set_visible(True)
    beside.plot(z, table["collision_efficiency"], "--", color="black")
    below.plot([], [], "--", color="black", label="$e_A$ (right scale)")
    beside.set_ylabel("$e_A$")
    below.set(xlabel=PLACE, ylabel=with_axis_unit("speed", "mph"))
    for axes in (above, below):
        axes.grid(True, linewidth=0.3)
        axes.legend(loc="lower center", ncols=3)


def draw_comparison(curves: pd.DataFrame) -> PageFigure:
    """Draw BPF, e_A and v_f of several bats in three panels (the paper's Figs. 3 and 4).

    BPF is the bat performance factor, e_A the collision efficiency, and v_f the batted-ball speed
    in mph. BPF and e_A are drawn for the first swing exponent n only. With the standard ball they
    do not depend on n, because the ball-wall restitution of this ball does not depend on speed.

    Parameters
    ----------
    curves
        The `BatComparison.curves`. The swing exponent is None for the law of constant energy.
    """
    with page_figure(8.0, 7.2) as figure:
        panels = figure.subplots(3, 1, sharex=True)
        plot_comparison(panels, curves)
        for axes in (panels[0], panels[2]):
            axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure


def plot_comparison(panels: Sequence[Axes], curves: pd.DataFrame) -> None:
    """Plot BPF, e_A and v_f [mph] of several bats in three panels, from top to bottom.

    BPF is the bat performance factor, e_A the collision efficiency, and v_f the batted-ball speed.
    `curves` are the `BatComparison.curves`. BPF and e_A are plotted for the first swing exponent
    only.
    """
    from pandas import isna

    bats, exponents = curves["bat"].unique(), curves["swing_exponent"].unique()
    for i, bat in enumerate(bats):
        name = as_drawn(bat)
        for j, n in enumerate(exponents):
            # pandas stores None as NaN, which is unequal to itself
            same = curves["swing_exponent"].isna() if isna(n) else curves["swing_exponent"] == n
            curve = curves[(curves["bat"] == bat) & same]
            swung = "constant energy" if isna(n) else f"$n={n:g}$"
            look: dict[str, Any] = {
                "color": COLOURS[i % len(COLOURS)],
                # different line styles for the bats, as far as there are enough
                "linestyle": DASHES[(i + j) % len(DASHES)],
            }
            if j == 0:
                panels[0].plot(
                    curve["impact_position_in"], curve["bat_performance_factor"], label=name, **look
                )
                panels[1].plot(
                    curve["impact_position_in"], curve["collision_efficiency"], label=name, **look
                )
            panels[2].plot(
                curve["impact_position_in"],
                curve["batted_speed_mph"],
                label=f"{name}, {swung}",
                **look,
            )
    for axes, label in zip(panels, ("BPF", "$e_A$", with_axis_unit("$v_f$", "mph")), strict=True):
        axes.set_ylabel(label)
        axes.grid(True, linewidth=0.3)
    panels[2].set(xlabel=PLACE)
