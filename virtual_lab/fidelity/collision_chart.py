"""Chart of accuracy against run time of the collision models: error of e_A and time per shot.

A scene is one collision: impact position, speeds and ball. The chart has two panels with different
references. For the total error of a model (number of modes, mesh, interpolation and integration)
the reference has 120 modes. For the error of the integration alone, the reference has the same
modes as the model and is integrated with steps twelve times smaller. An error is the largest error
over random scenes on the barrel. A time is the shortest time of repeated batches. Scenes along the
whole bat show where a model fails.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.errors import InputError
from virtual_lab.fidelity.drawing import error_axes, label_points
from virtual_lab.fidelity.results import SpeedChart, least_time
from virtual_lab.lab.laboratory import EFFICIENCY_U
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.collision.ladder import SHARE
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel
from virtual_lab.simulation.collision.reference import Method, ReferenceModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import CollisionModel, Scenes
from virtual_lab.simulation.collision.stepping import STEPPER
from virtual_lab.simulation.collision.surrogate import Box, Surrogate
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.streams import Streams
from virtual_lab.units import INCH, MPH, Array

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

Row = dict[str, Any]
Efficiency = Callable[[Scenes], Array]
Ends = tuple[float, float]


class Question(StrEnum):
    """Reference of the errors, one per panel."""

    IN_ALL = "120 modes"
    SOLVING = "the same 20 modes, solved finer"


class Series(StrEnum):
    """Series of points with the same marker."""

    RIGID = "rigid"
    SURROGATE = "surrogate of the default"
    MODES = "modal, by number of modes"
    ELEMENTS = "modal, by degree of the elements"
    REFERENCE = "reference"
    STEPS = "ours"
    SCIPY = "solve_ivp"


MARKS = {  # marker, color
    Series.RIGID: ("s", "black"),
    Series.SURROGATE: ("d", "#009e73"),
    Series.MODES: ("o", "#0072b2"),
    Series.ELEMENTS: ("v", "#cc79a7"),
    Series.REFERENCE: ("P", "#5e3c99"),
    Series.STEPS: ("^", "#d55e00"),
    Series.SCIPY: ("X", "#666666"),
}
BARREL_IN, WHOLE_IN = (2.0, 12.0), (0.3, 33.0)  # ranges of random scenes: the barrel, the whole bat


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Numbers of modes and of scenes of the chart."""

    mode_counts: tuple[int, ...] = (4, 6, 8, 10, 14, 20, 30, 40)
    scenes: int = 400  # number of scenes for our models
    few: int = 40  # number for methods that take milliseconds per scene
    fewest: int = 6  # number for the reference
    batch: int = 8192  # number for the timing of our models


@dataclass(frozen=True, kw_only=True)
class Point:
    """A point of the chart: a method to compute e_A, its reference, and numbers of scenes."""

    panel: Question
    series: Series
    setting: str
    efficiency: Efficiency
    exact: Callable[[Ends, int], Array]  # reference e_A of `_scenes`
    scenes: int
    timed: int | None = None  # number of scenes for the timing; None means `scenes`


def collision_chart(progress: Progress = quiet, extent: Extent = Extent()) -> SpeedChart:
    """Return the chart of the collision models, one row per model and setting.

    Each row is computed from two sets of random scenes of the same size. A scene is one hit of the
    ball at the bat. The first set has hits on the barrel, 2 to 12 in from the tip. It gives the
    largest and the rms error of the collision efficiency e_A, and the processor time per shot [µs].
    The second set has hits along the whole bat. It gives two shares, 0 to 1. The first is the share
    of scenes in which the error of e_A exceeds the standard uncertainty that a certificate states
    for e_A. The second is the share of scenes that the model rejects.
    """
    rows = []
    for point in _points(catalog.load_bat("r161").spec.body, extent):
        progress(f"{point.series}: {point.setting}")
        barrel, whole = (_scenes(ends, point.scenes) for ends in (BARREL_IN, WHOLE_IN))
        error = np.abs(point.efficiency(barrel) - point.exact(BARREL_IN, point.scenes))
        answers = _answers(point.efficiency, whole)
        # False for NaN
        is_wrong = np.abs(answers - point.exact(WHOLE_IN, point.scenes)) > EFFICIENCY_U
        batch = _scenes(BARREL_IN, point.timed or point.scenes)
        _, seconds = least_time(partial(point.efficiency, batch))
        rows.append(
            {
                "held_against": point.panel.value,
                "series": point.series.value,
                "setting": point.setting,
                "scenes": point.scenes,
                "worst_error": float(error.max()),
                "rms_error": float(np.sqrt((error**2).mean())),
                "us_a_shot": seconds / len(batch) * 1e6,
                "off_along_the_bat": float(is_wrong.mean()),
                "refused_along_the_bat": float(np.isnan(answers).mean()),
            }
        )
    return SpeedChart(
        name="collision",
        title="Collision models: error and time, R161, 2 to 12 in, 60 to 160 mph (27 to 72 m/s)",
        rows=rows,
        figure=draw_collision,
    )


def _points(body: BatBody, extent: Extent) -> Iterator[Point]:
    default = ModalModel.of(body, Free())
    exact = _cache_exact(_of(ModalModel.of(body, Free(), 120)))
    for series, setting, efficiency in _models(body, default, extent.mode_counts):
        dear = series is Series.REFERENCE
        yield Point(
            panel=Question.IN_ALL,
            series=series,
            setting=setting,
            efficiency=efficiency,
            exact=exact,
            scenes=extent.fewest if dear else extent.scenes,
            timed=None if dear else extent.batch,
        )
    # without residual flexibility, because the methods of scipy solve the model in this form
    bare = replace(default, stiff=default.stiff.above(default.stiff.count))
    exact = _cache_exact(_of(replace(bare, stepper=STEPPER.refine(12.0))))
    for series, setting, model in _solvers(bare):
        dear = series is Series.SCIPY
        yield Point(
            panel=Question.SOLVING,
            series=series,
            setting=setting,
            efficiency=_of(model),
            exact=exact,
            scenes=extent.few if dear else extent.scenes,
            timed=None if dear else extent.batch,
        )


def _models(
    body: BatBody, default: ModalModel, counts: Sequence[int]
) -> Iterator[tuple[Series, str, Efficiency]]:
    yield Series.RIGID, "closed form", _of(RigidModel.of(body, Free()))
    for tolerance in (1e-3, 1e-4, 1e-5):
        surrogate = Surrogate.build(default, _box(), tolerance=tolerance)
        yield Series.SURROGATE, f"{surrogate.coefficients.size} nodes", surrogate.efficiency
    for count in counts:
        yield Series.MODES, f"{count} modes", _of(ModalModel.of(body, Free(), count))
    for degree in (4, 5):  # the default is 6
        modes = modes_of(body, Free(), order=degree)
        yield Series.ELEMENTS, f"degree {degree}", _of(ModalModel.within(modes, BENDING_MODES))
    yield Series.REFERENCE, "DOP853 1e-12", _of(ReferenceModel.of(body, Free()))


def _solvers(bare: ModalModel) -> Iterator[tuple[Series, str, CollisionModel]]:
    yield Series.STEPS, "default steps", bare
    for divisor in (2.0, 4.0):
        stepper = STEPPER.refine(divisor)
        yield Series.STEPS, f"steps / {divisor:g}", replace(bare, stepper=stepper)
    methods: tuple[tuple[Method, float], ...] = (
        ("RK45", 1e-4),
        ("RK45", 1e-6),
        ("DOP853", 1e-4),
        ("DOP853", 1e-7),
        ("LSODA", 1e-6),
        ("Radau", 1e-4),
    )
    for method, tolerance in methods:
        solver = ReferenceModel(
            modes=bare.modes, tolerance=tolerance, method=method, longest_step=10.0
        )
        yield Series.SCIPY, f"{method} {tolerance:.0e}", solver


def _of(model: CollisionModel) -> Efficiency:
    return lambda scenes: model.collide(scenes).collision_efficiency


def _cache_exact(efficiency: Efficiency) -> Callable[[Ends, int], Array]:
    """Return a function of a range [in] and a number of scenes that returns e_A.

    The function computes e_A once for each pair of arguments.
    """
    return cache(lambda ends_in, count: efficiency(_scenes(ends_in, count)))


def _answers(efficiency: Efficiency, scenes: Scenes) -> Array:
    """Return e_A of each scene, shape (scene,); NaN if the model rejects it."""
    efficiencies = np.full(len(scenes), np.nan)
    for i in range(len(scenes)):
        try:
            efficiencies[i] = efficiency(scenes.part(slice(i, i + 1)))[0]
        except InputError:
            continue
    return efficiencies


@cache
def usual_ball() -> BallSpec:
    """Return the ball baseball-2003 of the catalog. All charts and maps of collisions use it."""
    return catalog.load("balls", "baseball-2003", BallSpec).spec


def _box() -> Box:
    """Return the range of a surrogate that contains all scenes on the barrel."""
    ball = usual_ball()
    return Box(
        impact_position=(1.5 * INCH, 12.5 * INCH),
        relative_speed=(55 * MPH, 170 * MPH),
        ball_restitution=(0.43, 0.57),
        ball_mass=(0.98 * ball.mass, 1.02 * ball.mass),
        stiffness=ball.stiffness,
        exponent=ball.exponent,
    )


@cache
def _scenes(ends_in: Ends, count: int) -> Scenes:
    """Return `count` random scenes, uniformly distributed over positions [in] and speeds.

    `ends_in` are the ends of the range of positions from the tip [in]. The speeds are 60 to 160
    mph.
    """
    draws = Streams(1)

    def uniform(ends: Ends, name: str) -> Array:
        return np.asarray(ends[0] + (ends[1] - ends[0]) * (0.5 + draws.uniform(name, count)))

    place, speed = uniform(ends_in, "place") * INCH, uniform((60.0, 160.0), "speed") * MPH
    return Scenes.with_ball(usual_ball(), impact_position=place, relative_speed=speed)


def draw_collision(rows: list[Row], title: str) -> PageFigure:
    """Return a figure of the largest error of e_A against the time per shot [µs].

    `rows` are the rows of `collision_chart`. There is one panel per reference solution.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from virtual_lab.output.page_figure import PageFigure

    figure = PageFigure(figsize=(11.5, 5.8), dpi=150, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    panels = dict(zip(Question, figure.subplots(1, len(Question)), strict=True))
    panel_rows = {
        panel: [row for row in rows if row["held_against"] == panel] for panel in Question
    }
    for panel, axes in panels.items():
        _draw_panel(axes, panel_rows[panel], panel)
    figure.legend(loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    figure.suptitle(title, fontsize=11)
    canvas.draw()  # fixes the layout, which the labels need
    for panel, axes in panels.items():
        label_points(
            axes,
            [
                (row["us_a_shot"], row["worst_error"], row["setting"], MARKS[row["series"]][1])
                for row in panel_rows[panel]
            ],
        )
    return figure


def _draw_panel(axes: Any, rows: list[Row], panel: Question) -> None:
    """Draw the points, rings around models that fail, and the line of the allowed error."""
    first = panel is Question.IN_ALL
    for series, (marker, colour) in MARKS.items():
        series_rows = [row for row in rows if row["series"] == series]
        if series_rows:
            times, errors = zip(
                *((r["us_a_shot"], r["worst_error"]) for r in series_rows), strict=True
            )
            # the points of this series are different methods
            width = 0 if series is Series.SCIPY else 1
            axes.plot(times, errors, marker=marker, color=colour, linewidth=width, label=series)
    for key, ring, style, words in (
        ("off_along_the_bat", "#c00000", "solid", "error above u elsewhere on the bat"),
        ("refused_along_the_bat", "#e69f00", "dotted", "refuses scenes elsewhere on the bat"),
    ):
        failed = [(row["us_a_shot"], row["worst_error"]) for row in rows if row[key]]
        look = {"s": 110, "linewidths": 1.4, "zorder": 3, "facecolors": "none"}
        look |= {"edgecolors": ring, "linestyles": style}
        axes.scatter(*np.reshape(failed, (-1, 2)).T, label=words if first else None, **look)
    decides = SHARE * EFFICIENCY_U
    axes.axhline(decides, color="0.3", linestyle="--", linewidth=1)
    axes.annotate(
        f"allowed error: u / 10 = {decides:.0e}",
        (float(first), decides),
        xycoords=("axes fraction", "data"),
        xytext=(-4 if first else 4, 3),
        textcoords="offset points",
        ha="right" if first else "left",
        fontsize=7.5,
        color="0.3",
    )
    against = "of the model, against 120 modes" if first else "of the integration, same 20 modes"
    axes.set_title(f"error {against}", fontsize=10)
    error_axes(axes, "largest error of $e_A$")
    axes.margins(x=0.22, y=0.1)
