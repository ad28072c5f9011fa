"""Where the stepping of the modal rung holds: maps of the step against what may strain it.

A cell is a handful of scenes, on a bat of either sort, followed in one bare pass: none is redone,
however little the pass trusts it. Errors in e_A are against the same modes followed one by one.
Steps are factors on the default's, the modes' and the ball's alike. Beside them stands the default
as shipped, with its second tries. Steps that the program refuses are taken all the same, to see
whether it is right to; of scenes that it gives no result for there is nothing to be held against.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.fidelity.results import StabilityMap
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.tables import table_text
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel, collide_bats
from virtual_lab.simulation.collision.scene import EnergySplit, Scenes
from virtual_lab.simulation.collision.splitting import Splitting
from virtual_lab.simulation.collision.stepping import (
    FINE,
    WINDOW,
    CollisionBatch,
    Followed,
    InStep,
    OneByOne,
    Stepper,
)
from virtual_lab.simulation.physics.supports import Clamped, Free, Pinned, Support
from virtual_lab.streams import Streams
from virtual_lab.units import INCH, MPH

__all__ = ["collision_stability"]

Array = NDArray[np.float64]
Marked = NDArray[np.bool_]
Column = list[tuple[ModalModel, Scenes]]  # a batch of `collide_bats`
BATS, BALL = ("r161", "ea70"), "baseball-2003"
FACTORS = (0.25, 0.5, 0.7, 0.85, 1.0, 1.15, 1.3, 1.5, 2.0, 3.0, 3.5, 4.0)
SHIPPED = "as shipped"  # in place of a factor
PLACES_IN = (1.0, 4.0, 6.5, 10.0, 16.0, 24.0)
SPEEDS_MPH, MANY_SPEEDS_MPH = (60.0, 160.0), (20.0, 45.0, 70.0, 95.0, 120.0, 160.0)
EXPONENTS = (1.0, 1.5)
COMPRESSION = 0.012  # m, a usual one
GOOD, NOTICED = "good", "inaccurate, and the pass doubts it"
INACCURATE, UNSTABLE = "inaccurate, unnoticed", "unstable"
NO_RESULT = "no result is given"
MARKS = {GOOD: ".", NOTICED: "?", INACCURATE: "o", UNSTABLE: "X", NO_RESULT: "-"}
COLOURS = {
    GOOD: "#6baed6",
    NOTICED: "#fee391",
    INACCURATE: "#f16913",
    UNSTABLE: "#800026",
    NO_RESULT: "#d9d9d9",
}
HATCH = "//"
LAST_PHASE = 10.5  # rad a step, of the growth drawn
EMPTY: dict[str, Any] = {
    "state": NO_RESULT,
    "scenes": 0,
    "off": 0,
    "doubted": 0,
    "worst_error": None,
    "worst_unnoticed_error": None,
    "worst_leak": None,
    "swung_back": 0,
}
TOLERANCE = FINE.tolerance  # of a good cell: what the default promises
RUNAWAY = 2.0  # |e_A| that no collision has
LEAK = 0.1  # share of the energy lost or won that no collision is worth


MODES, PLACE, SPEED = "bending modes", "z [in]", "speed [mph]"
STIFFNESS, EXPONENT = "stiffness of the ball, over the usual", "exponent of the ball"
RESTITUTION, MASS = "e0 of the ball", "mass of the ball, over the usual"
SUPPORT, CONTACTS = "support of the bat", "contacts"
SUPPORTS: dict[str, Support] = {
    "free": Free(),
    "pinned 28 in": Pinned(28 * INCH),
    "on 1e6 N/m": Pinned(28 * INCH, 1e6),
    "clamped 33 in": Clamped(33 * INCH),
    "clamped 25 in": Clamped(25 * INCH),
}
POOL, POOL_SEED, HARDEST = 3000, 5, 100.0  # scenes that those of so many contacts are picked from
AXES: dict[str, tuple[Any, ...]] = {
    MODES: (4, 6, 8, 10, 14, 20, 26, 32, 40),
    PLACE: (0.5, 1, 2, 3, 4.5, 6, 8, 11, 15, 20, 25, 30),
    SPEED: (0.1, 0.3, 1, 3, 10, 30, 60, 90, 120, 160, 200),
    STIFFNESS: (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100),
    EXPONENT: (1, 1.1, 1.25, 1.5, 1.75, 2, 2.5, 3),
    RESTITUTION: (0.005, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1),
    MASS: (0.01, 0.1, 0.3, 0.6, 1, 2, 5, 10, 30, 100),
    SUPPORT: tuple(SUPPORTS),
    CONTACTS: (1, 2, 3, 4, 5, 6),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class OnePass:
    """A first try that is taken as it comes."""

    stepper: InStep

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> Followed:
        """Follow all contacts that begin within `window` [s] of the first touch."""
        followed, doubted = self.stepper.one_pass(struck, window)
        none = np.zeros_like(followed.failure)
        return replace(followed, redone=doubted.astype(np.int64), failure=none)


class Boundless(Splitting):
    """A scheme that is taken at any step, to see what its limit is good for."""

    @cached_property
    def limit(self) -> float:
        """None."""
        return inf


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnOutcome:
    """Of all scenes of a column."""

    efficiency: Array
    leak: Array  # share of the energy that does not close
    doubted: Marked  # that the default steps again
    given_up: Marked  # before the first release
    swung_back: Marked


def collision_stability(progress: Progress = quiet) -> StabilityMap:
    """Return the maps; their rows are those of `collision_cells`."""
    return _maps(collision_cells(progress))


def _maps(rows: list[dict[str, Any]]) -> StabilityMap:
    return StabilityMap(
        title="stability of the collision", text=_maps_text(rows), rows=rows, picture=_draw
    )


def collision_cells(progress: Progress = quiet) -> list[dict[str, Any]]:
    """Return a row a cell: its place, its state, its worst errors in e_A and leak of energy.

    Of a refused one these are what it would have come to.
    """
    rows = []
    for axis, values in AXES.items():
        progress(axis)
        columns = [_column(axis, value) for value in values]
        exact = [_exact(column) for column in columns]
        for step, stepper, refused in _steppers():
            for value, column, true in zip(values, columns, exact, strict=True):
                found = _outcome(column, stepper) if true else None
                cell = _cell(found, true, step == SHIPPED) if found and true else EMPTY
                row = {"map": axis, "value": value, "step": step, "refused": refused}
                rows.append(row | cell)
    return rows


def _maps_text(rows: list[dict[str, Any]]) -> str:
    """Return a table a map for a terminal, the states by their marks."""
    key = ", ".join(f"{mark} {state}" for state, mark in MARKS.items())
    parts = [f"down, steps over the default's; {key}; in brackets refused, and what it would be"]
    for axis in AXES:
        own = [row for row in rows if row["map"] == axis]
        table = []
        for step in dict.fromkeys(row["step"] for row in own):
            marks = [(row["value"], _mark(row)) for row in own if row["step"] == step]
            table.append({"step": step} | {_head(value): mark for value, mark in marks})
        if any(row["swung_back"] for row in own):
            late = [row for row in own if row["step"] == SHIPPED]
            table.append(
                {"step": "swung back"} | {_head(row["value"]): row["swung_back"] for row in late}
            )
        parts.append(f"{axis}\n{table_text(table)}")
    return "\n\n".join(parts)


def _head(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _mark(row: dict[str, Any]) -> str:
    mark = MARKS[row["state"]]
    return f"({mark})" if row["refused"] else mark


def _steppers() -> Iterator[tuple[str, Stepper, bool]]:
    """Yield name, stepper, and whether the program itself refuses it."""
    scheme = FINE.splitting
    boundless = Boundless(order=scheme.order, kicks=scheme.kicks, drifts=scheme.drifts)
    for factor in FACTORS:
        try:
            stepper, refused = FINE.finer(1 / factor), False
        except InputError:
            stepper, refused = replace(FINE, splitting=boundless).finer(1 / factor), True
        yield f"{factor:g}", OnePass(stepper=stepper), refused
    yield SHIPPED, FINE, False


def _column(axis: str, value: Any) -> Column:
    """Return the bats and scenes of one column: all as usual but one thing."""
    if axis == CONTACTS:
        return _meeting(int(value))
    ball = catalog.load("balls", BALL, BallSpec).spec
    exponents = (value,) if axis == EXPONENT else EXPONENTS if axis in (PLACE, SPEED) else (1.0,)
    speeds = (value,) if axis == SPEED else MANY_SPEEDS_MPH if axis == PLACE else SPEEDS_MPH
    place, speed, exponent = (
        grid.ravel()
        for grid in np.meshgrid(
            np.array([value] if axis == PLACE else PLACES_IN) * INCH,
            np.array(speeds) * MPH,
            exponents,
        )
    )
    usual = Scenes.with_ball(ball, impact_position=place, relative_speed=speed)
    harder = value if axis == STIFFNESS else 1.0
    scenes = replace(
        usual,
        exponent=exponent,
        # whatever the exponent, the same force at a usual compression
        stiffness=harder * ball.stiffness * COMPRESSION ** (ball.exponent - exponent),
        ball_mass=usual.ball_mass * (value if axis == MASS else 1.0),
        ball_restitution=np.full(len(usual), value)
        if axis == RESTITUTION
        else usual.ball_restitution,
    )
    count = int(value) if axis == MODES else BENDING_MODES
    support = value if axis == SUPPORT else "free"
    return [(_model(bat, support, count), scenes) for bat in BATS]


def _meeting(contacts: int) -> Column:
    """Return as many scenes as usual in which ball and bat meet so often, if there are."""
    column = []
    for bat in BATS:
        pool, met = _pool(bat)
        some = np.flatnonzero(met == contacts)[: len(PLACES_IN) * len(SPEEDS_MPH)]
        column.append((_model(bat, "free", BENDING_MODES), pool.part(some)))
    return column


@cache
def _pool(bat: str) -> tuple[Scenes, NDArray[np.int64]]:
    """Return scenes all along a bat with usual and harder balls, and how often they meet."""
    ball = catalog.load("balls", BALL, BallSpec).spec
    draws = Streams(POOL_SEED)
    place, speed, harder = (draws.uniform(name, POOL) + 0.5 for name in ("z", "speed", "harder"))
    usual = Scenes.with_ball(
        ball,
        impact_position=(0.3 + 29.7 * place) * INCH,
        relative_speed=(SPEEDS_MPH[0] + (SPEEDS_MPH[1] - SPEEDS_MPH[0]) * speed) * MPH,
    )
    pool = replace(usual, stiffness=usual.stiffness * HARDEST**harder)
    return pool, _model(bat, "free", BENDING_MODES).collide(pool).contacts


@cache
def _model(bat: str, support: str, count: int) -> ModalModel:
    return ModalModel.of(catalog.load_bat(bat).spec.body, SUPPORTS[support], count)


def _exact(column: Column) -> ColumnOutcome | None:
    """Return what is true of a column; None where the program gives no result."""
    try:
        return _outcome(column, OneByOne())
    except InputError:
        return None


def _outcome(column: Column, stepper: Stepper) -> ColumnOutcome:
    (first, scenes), *others = column
    with np.errstate(all="ignore"):  # what runs away overflows
        parts = collide_bats([(replace(first, stepper=stepper), scenes), *others])
        shares = [[getattr(part.energy, one.name) for one in fields(EnergySplit)] for part in parts]
        return ColumnOutcome(
            efficiency=np.concatenate([part.collision_efficiency for part in parts]),
            leak=np.concatenate([np.abs(np.sum(share, axis=0) - 1) for share in shares]),
            doubted=np.concatenate([part.redone > 0 for part in parts]),
            given_up=np.concatenate([part.contacts == 0 for part in parts]),
            swung_back=np.concatenate([part.swung_back for part in parts]),
        )


def _cell(found: ColumnOutcome, true: ColumnOutcome, shipped: bool) -> dict[str, Any]:
    """Return the state of a cell and of how many scenes what is said."""
    error = np.abs(found.efficiency - true.efficiency)
    # no comparison holds of a nan
    held = (np.abs(found.efficiency) <= RUNAWAY) & (found.leak <= LEAK) | found.given_up
    good = error <= TOLERANCE
    unnoticed = ~good if shipped else ~good & ~found.doubted
    state = GOOD if good.all() else INACCURATE if unnoticed.any() else NOTICED
    known = error[~found.doubted | shipped]
    return {
        "state": state if held.all() else UNSTABLE,
        "scenes": len(error),
        "off": int((~good).sum()),
        "doubted": int(found.doubted.sum()),
        "worst_error": _worst(error),
        "worst_unnoticed_error": _worst(known),
        "worst_leak": _worst(found.leak[~found.given_up]),
        "swung_back": int(true.swung_back.sum()),
    }


def _worst(values: Array) -> float | None:
    """Return the greatest; None where one is beyond numbers, which JSON has no word for."""
    worst = float(values.max(initial=0.0))
    return worst if isfinite(worst) else None


def _draw(rows: list[dict[str, Any]], path: Path) -> None:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    figure = Figure(figsize=(19.5, 8.6), dpi=110, layout="constrained")
    panels = figure.subplots(2, 5).ravel()
    for axis, axes in zip(AXES, panels, strict=False):
        _draw_map(axes, axis, [row for row in rows if row["map"] == axis])
    _draw_growth(panels[-1])
    keys: list[Any] = [Patch(color=colour, label=state) for state, colour in COLOURS.items()]
    keys.append(Patch(fill=False, hatch=HATCH, edgecolor="0.5", label="refused as past the limit"))
    keys.append(Line2D([], [], color="black", linewidth=2, label="the default's step"))
    figure.legend(handles=keys, loc="outside lower center", ncols=7, frameon=False, fontsize=9)
    title = (
        "Stepping of the modal rung: up to 24 scenes a cell in one bare pass, and as shipped; "
        f"good: all of them to {TOLERANCE:.0e} in $e_A$, else how many are not"
    )
    figure.suptitle(title, fontsize=11)
    figure.savefig(path)


def _draw_map(axes: Any, name: str, rows: list[dict[str, Any]]) -> None:
    from matplotlib.patches import Rectangle
    from matplotlib.patheffects import withStroke

    values = list(dict.fromkeys(row["value"] for row in rows))
    steps = list(dict.fromkeys(row["step"] for row in rows))
    # what is shipped stands apart from the steps
    heights = [i + (step == SHIPPED) / 2 for i, step in enumerate(steps)]
    for row in rows:
        corner = (values.index(row["value"]) - 0.5, heights[steps.index(row["step"])] - 0.5)
        colour = COLOURS[row["state"]]
        look: dict[str, Any] = {"facecolor": colour, "edgecolor": "white", "linewidth": 1.0}
        if row["refused"]:
            look |= {"hatch": HATCH, "edgecolor": "0.6", "linewidth": 0.0}
        axes.add_patch(Rectangle(corner, 1, 1, **look))
        if row["off"]:
            ink = "white" if row["state"] == UNSTABLE else "black"
            middle = (corner[0] + 0.5, corner[1] + 0.47)
            label = axes.annotate(row["off"], middle, ha="center", va="center", fontsize=6.5)
            label.set(color=ink, path_effects=[withStroke(linewidth=2.5, foreground=colour)])
    box = (-0.5, heights[steps.index("1")] - 0.5)
    axes.add_patch(Rectangle(box, len(values), 1, fill=False, linewidth=2, zorder=3, clip_on=False))
    axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_ylim(-0.5, heights[-1] + 0.5)
    heads = [_head(value).replace(" ", "\n", 1) for value in values]
    axes.set_xticks(range(len(values)), heads, fontsize=7)
    axes.set_yticks(heights, steps, fontsize=8)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_xlabel(name, fontsize=9)
    axes.set_ylabel("step over the default's", fontsize=9)


def _draw_growth(axes: Any) -> None:
    """Draw what a step multiplies an oscillator by: where the limits come from."""
    phases = np.linspace(0.0, LAST_PHASE, 40_001)
    scheme = FINE.splitting
    growth, limit = scheme.growth(phases) - 1, f"limit {scheme.limit:.3f}"
    axes.semilogy(phases, np.where(growth > 1e-7, growth, 1e-7), color="C0", label=limit)
    axes.axvline(FINE.mode_step, color="C0", linestyle=":", linewidth=1.2)
    axes.set_xlim(0, LAST_PHASE)
    axes.set_ylim(1e-5, 1e4)
    axes.set_xlabel("phase a step [rad]; dotted: the default", fontsize=9)
    axes.set_ylabel("growth of an oscillator a step, less 1", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(True, which="major", linewidth=0.3)
    axes.legend(fontsize=8, loc="upper left", framealpha=1, edgecolor="none")
