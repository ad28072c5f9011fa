"""Curvature of a result along the barrel; with scattered impact places it causes a bias."""

from __future__ import annotations

import numpy as np

from virtual_lab.lab.laboratory import Laboratory
from virtual_lab.lab.measurand import true_curve


def curvatures(laboratory: Laboratory, place: float) -> dict[str, float]:
    """Return d²/dz² [1/m²] of the metric (as ``metric``) and of the quantities at a place [m]."""
    step = 4e-3  # m
    places = place + step * np.array([-1.0, 0.0, 1.0])
    procedure = laboratory.rules.spec
    curve = true_curve(laboratory.impact, laboratory.specimen, procedure, places)
    values = curve.quantities | {"metric": curve.metric()}
    return {name: float(np.diff(row, 2)[0]) / step**2 for name, row in values.items()}
