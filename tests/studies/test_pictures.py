"""Pictures of studies: the numbers in the axes are those of the rows, made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from virtual_lab.output.result import StudyResult
from virtual_lab.studies.bats.ball_law import LawTable
from virtual_lab.studies.bats.text import LawRow, peak_position
from virtual_lab.studies.bias import Biases
from virtual_lab.studies.coverage import Coverage, CoverageTable
from virtual_lab.studies.place_slope import Slope, Slopes

NOTHING: dict[str, Any] = dict.fromkeys(Coverage.__dataclass_fields__, 0)


def panels(result: StudyResult) -> list[Any]:
    """Return the axes of the picture of a result."""
    return result.plot().axes


def test_the_coverage_picture_shows_its_table() -> None:
    """The interval is not symmetric; of 100 laboratories per tenth, 90 to 99 hold the value."""
    about = NOTHING | {"quantity": "metric", "laboratories": 1000}
    shares = {"coverage": 0.96, "coverage_low": 0.90, "coverage_high": 0.98}
    by_u, by_dof = (0.9, None, *[0.95] * 8), (1.0, *[0.94] * 9)
    tenths_of = {"coverage_by_u": dict(enumerate(by_u)), "coverage_by_dof": dict(enumerate(by_dof))}
    row = Coverage(**about | shares | tenths_of)
    quantities, tenths = panels(CoverageTable(name="coverage", title="", rows=[row]))
    ((limits,),) = (bar.get_segments() for bar in quantities.collections)
    assert quantities.lines[0].get_xdata() == pytest.approx([96])
    assert limits[:, 0] == pytest.approx([90, 98])
    assert [line.get_xdata()[0] for line in quantities.lines if line.get_color() == "0.5"] == [95]
    of_u, of_dof = (line.get_ydata() for line in tenths.lines[-2:])
    assert of_u == pytest.approx([90, np.nan, *[95] * 8], nan_ok=True)
    assert of_dof == pytest.approx([100, *[94] * 9])
    (band,) = tenths.patches
    assert (band.get_y(), band.get_y() + band.get_height()) == pytest.approx((90, 99))


def test_the_sensitivity_picture_shows_its_table() -> None:
    curves = {
        "impact_position_in": [5.0, 6.0],
        "restitution": [0.49, 0.48],
        "batted_speed_mph": [104.0, 102.0],
    }
    peaks = {
        "peak_restitution": 0.5,
        "peak_restitution_position_in": 5.2,
        "peak_batted_speed_mph": 105.0,
        "peak_batted_speed_position_in": 5.4,
    }
    law = {"law": "power law", "exponent": 1.5, "stiffness": 0, "wall_time_ms": 0}
    row = LawRow(bat="r161", wall_force_kn=0, peaks=peaks, **law)
    axes = panels(LawTable(name="sensitivity", title="", rows=[row], curves=[curves]))
    for panel, name in zip(axes, ("restitution", "batted_speed_mph"), strict=True):
        curve, peak = (line.get_xydata().ravel() for line in panel.lines)
        assert curve == pytest.approx(
            np.transpose([curves["impact_position_in"], curves[name]]).ravel()
        )
        assert peak == pytest.approx([peaks[peak_position(name)], peaks[f"peak_{name}"]])


def test_the_slope_picture_shows_its_table() -> None:
    slopes = {"r161": -0.01, "ea70": 0.03, "mean": 0.01, "deviation": 0.02}
    rows = [Slope(bat=bat, impact_position_in=None, slope_per_in=at) for bat, at in slopes.items()]
    (axes,) = panels(Slopes(name="slope", title="", rows=rows, on_sheet=(0.006, 0.014)))
    (band,), (bar,) = axes.patches, axes.collections
    assert (band.get_x(), band.get_x() + band.get_width()) == pytest.approx((-0.008, 0.02))
    points = [list(line.get_xdata()) for line in axes.lines if line.get_marker() in ("o", "D")]
    assert points == [[-0.01, 0.03], [0.01]]
    assert bar.get_segments()[0][:, 0] == pytest.approx([-0.01, 0.03])


def test_the_bias_picture_shows_its_table() -> None:
    words = "bat_performance_factor collision_efficiency restitution recoil_factor ball_restitution"
    names = words.split()
    rows = [
        {"bat": "r161"} | {f"{name}_bias": 1e-3 * (at - 2) for at, name in enumerate(names)},
        {"bat": "ea70"} | dict.fromkeys(f"{name}_bias" for name in names),
    ]
    drawn = panels(Biases(name="bias", title="", rows=rows))
    drawn[0].figure.draw_without_rendering()
    bats = [label.get_text() for label in drawn[0].get_yticklabels()]
    assert bats == ["r161", "ea70 (no result)"]
    for at, axes in enumerate(drawn):
        assert axes.get_title("left").replace("\n", "_") == names[at]
        assert [bar.get_width() for bar in axes.patches] == pytest.approx(
            [at - 2, np.nan], nan_ok=True
        )
        assert [list(line.get_xdata()) for line in axes.lines] == [[0, 0]]  # no error
