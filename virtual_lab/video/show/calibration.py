"""A calibration as text, as the file for `track`, and as a figure (`virtual-lab calibrate`)."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.output.style import page_figure
from virtual_lab.video.calibration.calibrating import Calibrated, lengths_of
from virtual_lab.video.calibration.plane import relative_u_of

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

NOTES = {
    "matrix": "pixels",
    "rotation": "from the axes of the plane view to those of the camera, rad",
    "plane_height_m": "Z of the ball's plane: negative above the board, as Z points into it",
    "relative_scale_u": "relative u of lengths in that plane if its height is exact",
}
HEAD = """\
# Written by virtual-lab calibrate. X is to the right in the plane view, Y down, Z away from the
# camera, from the board's middle. Add here, above the tables: frames_per_second, exposure_s,
# ball_diameter_m, timestamps, drag_per_m, each with its _u.

lens_blur_px = {blur:.3g}  # standard deviation, in the plane view

[camera]
"""


def calibration_toml(result: Calibrated) -> str:
    """Return the text of a calibration file (TOML) for `virtual-lab track`."""
    entries = asdict(result.model)
    fit = entries.pop("fit")
    lines = [*map(_entry, entries, entries.values()), "", "[camera.fit]"]
    lines += map(_entry, fit, fit.values())
    return HEAD.format(blur=result.lens_blur) + "\n".join(lines) + "\n"


def calibration_document(result: Calibrated) -> dict[str, Any]:
    """Return the calibration as a dictionary that can be written as JSON."""
    across, down = lengths_of(result.model) / (np.array(result.model.image_size) / 2)
    return {
        "camera": asdict(result.model),
        "metres_per_pixel": {"across": float(across), "down": float(down)},
        "lens_blur_px": result.lens_blur,
        "plane_view": result.plane,
        "views": result.views,
        "corners_left_out": int(result.solved.left_out.sum()),
        "warnings": list(result.warnings),
    }


def calibration_text(result: Calibrated) -> str:
    """Return the calibration as lines of text, with one line per warning at the end."""
    model, fit = result.model, result.model.fit
    assert fit is not None
    (fx, _, cx), (_, fy, cy), _ = model.matrix
    across, down = 1e3 * lengths_of(model) / (np.array(model.image_size) / 2)
    k1, k2, p1, p2, k3 = map(with_uncertainty, model.distortion, fit.distortion_u)
    far = float(np.linalg.norm(model.translation_m))
    rms, worst = max((rms, name) for name, rms in result.views.items())
    lines = [
        f"{fit.board}: {fit.views} pictures, {fit.corners} corners, residuals "
        f"{fit.rms_px:.2g} pixels rms",
        _line("focal length, pixels", *map(with_uncertainty, (fx, fy), fit.focal_u_px)),
        _line("center, pixels", *map(with_uncertainty, (cx, cy), fit.centre_u_px)),
        _line("k1, k2", k1, k2),
        _line("p1, p2", p1, p2),
        *([_line("k3", k3)] if fit.distortion_u[4] else []),
        _line("lens blur, pixels", f"{result.lens_blur:.2g}", "standard deviation"),
        _line("scale across and down, mm per pixel", f"{across:.6f}", f"{down:.6f}"),
        _line("relative u of lengths", f"{relative_u_of(model):.1e}", "with that of the height"),
        _line("  if the height is exact", f"{model.relative_scale_u:.1e}"),
        _line("camera to board, m", with_uncertainty(far, fit.translation_u_m[2])),
        _line("plane view", Path(result.plane).name),
        _line("largest residuals", f"{rms:.2g} pixels rms", Path(worst).name),
    ]
    return "\n".join([*lines, *(f"  warning: {each}" for each in result.warnings)])


def _line(name: str, *values: str) -> str:
    return f"  {name:<37}{', '.join(values)}"


def _entry(key: str, value: Any) -> str:
    note = f"  # {NOTES[key]}" if key in NOTES else ""
    # JSON and TOML have the same notation for numbers, strings and lists.
    return f"{key} = {json.dumps(value)}{note}"


def draw_calibration(result: Calibrated) -> PageFigure:
    """Return a figure with the residual of each corner: an arrow at the corner's position."""
    solved, (wide, high) = result.solved, result.model.image_size
    plane_view = solved.view == [*result.views].index(result.plane)
    with page_figure(6.6 * high / wide + 0.8, 7.6) as figure:
        axes = figure.add_subplot()
        arrows = axes.quiver(
            *solved.places.T,
            *solved.residuals.T,
            color=np.where(plane_view, "#d55e00", "#0072b2"),
            angles="xy",
            scale_units="xy",
            # An arrow as long as the rms has 2 % of the width of the picture.
            scale=max(solved.rms, 1e-6) / (0.02 * wide),
            width=0.0012,
            headwidth=4,
        )
        words = f"rms per axis, {solved.rms:.2g} pixels"
        axes.quiverkey(arrows, 0.95, 1.03, solved.rms, words, labelpos="W")
        axes.set(xlim=(-0.5, wide - 0.5), ylim=(high - 0.5, -0.5), aspect="equal")
        axes.set(xlabel="x, pixels", ylabel="y, pixels")
        axes.set_title("residuals of the corners\norange: plane view", loc="left")
    return figure
