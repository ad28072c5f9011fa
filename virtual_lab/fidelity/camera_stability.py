"""Maps of the conditions under which the methods to locate a ball work.

A cell consists of a few pictures of a plain ball, or of a stitched ball in one light, at positions
spread over a pixel. A position is *wrong without a flag* if its error exceeds five stated standard
uncertainties and the method raised no flag. For dropped frames a cell consists of a few flights
without time stamps, and the error is the error of the speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import Any

import numpy as np

from virtual_lab.fidelity.camera_drops import dropped_frames
from virtual_lab.fidelity.camera_errors import score_positions, wrong_unsaid
from virtual_lab.fidelity.camera_estimators import EDGE, ESTIMATORS
from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import Batch, Case
from virtual_lab.fidelity.drawing import PictureState, draw_maps, maps_text
from virtual_lab.fidelity.results import StabilityMap
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.video.locate.located import Located

Row = dict[str, Any]
BALLS: dict[str, Case] = {
    "plain": Case(),
    "stitched, soft light": Case(stitched=True, light="soft"),
    "stitched, back light": Case(stitched=True, light="back"),
    "stitched, hard side light": Case(stitched=True, light="hard side"),
}
AXES: dict[str, tuple[str, tuple[float, ...]]] = {
    "contrast / noise": ("snr", (3, 5, 10, 27, 96)),
    "radius of the ball [px]": ("radius", (5, 8, 15, 30, 60)),
    "shift during the exposure [px]": ("blur", (0, 2, 6, 15, 30, 60, 120)),
    "share of the ball outside the frame": ("cut", (0, 0.05, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75)),
    "share of the ball behind the bat": ("covered", (0.02, 0.05, 0.1, 0.25, 0.45, 0.6)),
    "exposure / correct exposure": ("exposure", (0.2, 0.5, 1, 1.3, 1.5, 2, 3, 5)),
    "number of hot pixels": ("hot", (0, 10, 30, 100, 300, 1000)),
    "relative amplitude of the flicker": ("flicker", (0, 0.02, 0.05, 0.1, 0.2, 0.4)),
    "relative error of the start radius": ("radius_off", (-0.2, -0.1, -0.02, 0.02, 0.1, 0.2, 0.4)),
    "error of the start position [px]": ("start_off", (0.5, 2, 5, 10, 15)),
}


def camera_stability(progress: Progress = quiet) -> StabilityMap:
    """Return maps that show where the methods to locate a ball work, one row per cell of a map.

    A row has the same keys as in `picture_cells`. An additional map shows the effect of dropped
    frames. In the rows of this map, ``rms_unflagged`` is the relative error of a speed.
    ``pictures``, ``unsaid``, ``flagged`` and ``lost`` then count balls instead of pictures.
    """
    rows = picture_cells(progress)
    progress("frames dropped")
    return _maps(rows + dropped_frames())


def _maps(rows: list[dict[str, Any]]) -> StabilityMap:
    title = (
        "Locating the ball: state of each cell; numbers: pictures that are wrong without a flag"
        f"\n{_summary(rows)}"
    )
    return StabilityMap(
        title="stability of the camera",
        text=f"{maps_text(rows, PictureState, ('method', 'ball'))}\n\n{_summary(rows)}",
        rows=rows,
        picture=lambda cells: draw_maps(
            sorted(cells, key=itemgetter("method")),
            title=title,
            states=PictureState,
            line_of=lambda row: f"{row['method']}: {row['ball']}",
            abreast=4,
        ),
    )


def picture_cells(
    progress: Progress = quiet,
    axes: Mapping[str, tuple[str, Sequence[float]]] = AXES,
    balls: Mapping[str, Case] = BALLS,
) -> list[Row]:
    """Return one row per combination of condition, ball and method.

    A condition is one value of a quantity, such as the contrast. The conditions of one quantity
    form a map. There are two methods to locate the ball: the convex hull and the edge fit.

    A row has these keys:

    * ``map``: name of the map.
    * ``value``: value of the quantity.
    * ``ball``, ``method``: names of the ball and of the method.
    * ``state``: a value of `PictureState`.
    * ``rms_unflagged``: rms error along an axis in pictures without a flag [px]; None if there are
      no such pictures.
    * ``pictures``: number of all pictures.
    * ``unsaid``: number of pictures with a wrong position and no flag.
    * ``flagged``: number of pictures with a position and a flag.
    * ``lost``: number of pictures without a position.

    Parameters
    ----------
    progress
        Function that is called with the name of each map.
    axes
        Maps, keyed by name. A map has the name of the field of `Case` that varies, and its values.
    balls
        Case of each ball, keyed by ball name. The field of a map is changed in each case.
    """
    rows: list[Row] = []
    for axis, (name, values) in axes.items():
        progress(axis)
        for value in values:
            change = {name: int(value) if name == "hot" else value}
            for ball, case in balls.items():
                cell_case = replace(case, phases=4, repeats=4, **change)  # type: ignore[arg-type]
                batch = pictures(cell_case, block=len(rows))  # different pictures in each cell
                for method in ("convex hull", EDGE):
                    located = ESTIMATORS[method](batch.inputs)
                    position = {"map": axis, "value": value, "method": method, "ball": ball}
                    rows.append(position | _cell(batch, located))
    return rows


def unsaid_share(rows: list[Row], method: str) -> float:
    """Return the share of a method's pictures that are wrong without a flag, 0 to 1.

    `rows` are the rows of `picture_cells`. Raises `ZeroDivisionError` if no row has the method.
    """
    method_rows = [row for row in rows if row["method"] == method]
    return float(
        sum(row["unsaid"] for row in method_rows) / sum(row["pictures"] for row in method_rows)
    )


def _summary(rows: list[Row]) -> str:
    methods = dict.fromkeys(row["method"] for row in rows)
    shares = ", ".join(f"{method} {unsaid_share(rows, method):.2%}" for method in methods)
    return f"wrong (error above 5 u) without a flag, over all maps: {shares}"


def _cell(batch: Batch, located: Located) -> Row:
    """Return the state of a cell, its rms error [px], and its numbers of pictures."""
    whole = score_positions(batch, located)
    unsaid = int(wrong_unsaid(batch, located).sum())
    clean = np.isfinite(located.x) & (located.flags == 0)
    errors = np.stack([located.x - batch.x, located.y - batch.y])[:, clean]
    rms = float(np.sqrt(np.mean(errors**2))) if clean.any() else None
    if unsaid:
        state = PictureState.UNSAID
    elif whole.lost >= 0.5:
        state = PictureState.LOST
    elif rms is None or whole.lost + whole.flagged >= 0.5:
        state = PictureState.FLAGGED
    else:  # good: within 0.02 px, or close to the limit of the noise
        state = (
            PictureState.GOOD if rms <= max(0.02, 1.5 * batch.limit) else PictureState.INACCURATE
        )
    count = len(batch.x)
    return {
        "state": state.value,
        "rms_unflagged": rms,
        "pictures": count,
        "unsaid": unsaid,
        "flagged": round(whole.flagged * count),
        "lost": round(whole.lost * count),
    }
