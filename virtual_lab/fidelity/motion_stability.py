"""Maps of the steps at which pymunk is accurate, alone and as a model of the motion.

A cell consists of a few shots with contact times spread evenly over a step. The bat is rigid with
one radius, at rest, and hit 6 in from its tip. In the map of slop (allowed overlap) the bat is
swung and the ball comes at an angle. In the map of iterations the impact is 20 in from the tip. The
error is the error of the ball's velocity after the contact, divided by the speed of approach. The
reference is the closed form. Settings that the model rejects are computed too, to test the
rejection.
"""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from typing import Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.fidelity.drawing import State, draw_maps, maps_text
from virtual_lab.fidelity.motion_chart import STARTS, Carrier, Start
from virtual_lab.fidelity.naive_pymunk import Shape, naive_errors, rod_scene
from virtual_lab.fidelity.results import StabilityMap
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.motion.closed_form import play_closed_form
from virtual_lab.simulation.motion.played import Target
from virtual_lab.simulation.motion.pymunk_scene import PymunkSettings, carry
from virtual_lab.simulation.motion.scene import ShotScene
from virtual_lab.units import INCH, MPH

Row = dict[str, Any]
STEPS = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
BOUNDS = {  # largest relative error; above 0.5 the ball passed the bat or gained energy
    State.GOOD: 1e-4,
    State.INACCURATE: 0.5,
}


class MotionAxis(StrEnum):
    """Quantity that varies across a map."""

    SPEED = "speed [mph]"
    PLACE = "position from the tip [in]"
    ACROSS = "offset from the axis [mm]"
    SLOP = "allowed overlap (slop) [m]"
    ITERATIONS = "iterations per step"


AXES: dict[MotionAxis, tuple[float, ...]] = {
    MotionAxis.SPEED: (10, 20, 40, 60, 90, 120, 160, 200),
    MotionAxis.PLACE: (0.2, 0.5, 0.8, 1.1, 2, 6, 12, 20),
    MotionAxis.ACROSS: (0, 0.1, 1, 3, 10, 20, 40, 60),
    MotionAxis.SLOP: (0, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1),
    MotionAxis.ITERATIONS: (1, 2, 3, 5, 8, 10, 20, 50),
}


def motion_stability(progress: Progress = quiet) -> StabilityMap:
    """Return maps of the accuracy of plain pymunk and of our pymunk model of the motion.

    pymunk is a library for the motion of rigid bodies. Each of the two models has five maps, one
    per quantity in `MotionAxis`. A cell of a map is one combination of a value of this quantity and
    a time step.

    There is one row per cell. A row states:

    * the map, the model, the value of the quantity and the time step [s];
    * the state (good, inaccurate or unstable) and the number of shots;
    * ``worst_error``: largest error of the ball's velocity, divided by the speed of approach; None
      if it is not finite;
    * ``refused``: whether our model rejects the settings of the cell. Rejected cells are computed
      too. For plain pymunk the value is always False.
    """
    rows = []
    for method in (Carrier.ALONE, Carrier.OURS):
        for axis, values in AXES.items():
            progress(f"{method}: {axis}")
            rows += [_cell(axis, method, step, value) for step in STEPS for value in values]
    title = (
        "Rebound by plain pymunk and by our pymunk model of the motion; error of the velocity of "
        f"the ball over the speed of approach: good, at most {BOUNDS[State.GOOD]:.0e}; unstable, "
        f"above {BOUNDS[State.INACCURATE]:g}"
    )
    return StabilityMap(
        title="stability of the motion",
        text=maps_text(rows, "steps [s]"),
        rows=rows,
        picture=partial(draw_maps, title=title, states=State, down="step [s]"),
    )


def _cell(axis: MotionAxis, method: Carrier, step: float, value: float) -> Row:
    """Return the row of a cell."""
    speed = (value if axis is MotionAxis.SPEED else 60.0) * MPH
    # Iterations matter near the handle, where the load on the joint is large.
    place = 20 * INCH if axis is MotionAxis.ITERATIONS else 6 * INCH
    start = STARTS[Start.SWUNG] if axis is MotionAxis.SLOP else {"z": place}
    starts: dict[MotionAxis, dict[str, float]] = {
        MotionAxis.PLACE: {"z": value * INCH},
        MotionAxis.ACROSS: {"y": value * 1e-3},
    }
    settings = PymunkSettings(
        step=step,
        slop=value if axis is MotionAxis.SLOP else 1e-5,
        iterations=int(value) if axis is MotionAxis.ITERATIONS else 10,
    )
    shots = 8 if method == Carrier.ALONE else 3
    scene = rod_scene(start | starts.get(axis, {}), speed, step, shots)
    true = play_closed_form(scene).first(Target.BAT)
    refused = False
    if method == Carrier.OURS:
        refused = _is_refused(scene, settings)
        played = carry(scene, settings).first(Target.BAT)
        gap = np.linalg.norm(np.array(played.state[3:6]) - np.array(true.state[3:6]), axis=0)
    else:
        shapes: dict[MotionAxis, Shape] = {
            MotionAxis.PLACE: "round tip",
            MotionAxis.ACROSS: "section",
        }
        gap = naive_errors(
            scene,
            step,
            iterations=settings.iterations,
            slop=settings.slop,
            shape=shapes.get(axis, "side"),
        )
    worst = float(np.max(gap / true.speed))
    state = next((state for state, most in BOUNDS.items() if worst <= most), State.UNSTABLE)
    row = {
        "map": axis.value,
        "method": method.value,
        "value": value,
        "step": step,
        "refused": refused,
    }
    error = worst if np.isfinite(worst) else None
    return row | {"state": state.value, "shots": shots, "worst_error": error}


def _is_refused(scene: ShotScene, settings: PymunkSettings) -> bool:
    try:
        settings.check(scene)
    except InputError:
        return True
    return False
