"""The reduction without compiled code, and mistakes planted in its equations."""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from virtual_lab.measurement.reduction import kinematics, shot_algebra

__all__ = ["plant", "reduce_arrays"]


def reduce_arrays(
    settings: Any, sets: Any, balls: Any, ball: np.ndarray, shots: Any, results: Any
) -> None:
    """Compute the results of `kinematics.reduce_sets` by `reduce_shot` on whole arrays."""
    of_ball = tuple(np.take_along_axis(each, ball, axis=-1) for each in balls)
    constants = kinematics.ShotConstants(*sets)
    for arrays, values in zip(
        results, kinematics.reduce_shot(settings, constants, of_ball, shots), strict=True
    ):
        if arrays.size:
            for array, value in zip(arrays, values, strict=True):
                array[...] = value


def plant(monkeypatch: pytest.MonkeyPatch, name: str, wrong: Callable[..., Any]) -> None:
    """Replace an equation of `kinematics` in every module that imports it; nothing is compiled."""
    right = getattr(kinematics, name)
    for module in list(sys.modules.values()):
        if module.__name__.startswith("virtual_lab") and vars(module).get(name) is right:
            monkeypatch.setattr(module, name, wrong)
    monkeypatch.setattr(shot_algebra, "compiled_reduction", lambda: reduce_arrays)
