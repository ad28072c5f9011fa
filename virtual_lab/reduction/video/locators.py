"""Which way of locating a ball a command takes."""

from __future__ import annotations

from virtual_lab.reduction.video.regions import Locator

__all__ = ["locator"]


def locator(*, quick: bool) -> Locator:
    """Return OpenCV's own means alone, or the refinement."""
    from virtual_lab.reduction.video.quick import quick as by_opencv

    return by_opencv
