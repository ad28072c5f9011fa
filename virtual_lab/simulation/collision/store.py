"""Surrogates on disk: built once for a bat, a support and a box, found again by their hash."""

from __future__ import annotations

import hashlib
import os
import zipfile
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import numpy as np

from virtual_lab.catalog.specs import BatBody
from virtual_lab.drafts import draft_in
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.stepping import WINDOW
from virtual_lab.simulation.collision.surrogate import Box, Surrogate
from virtual_lab.simulation.physics.supports import Support

__all__ = ["cache_folder", "surrogate_of"]


def cache_folder() -> Path:
    """Return where surrogates are kept: ``VIRTUAL_LAB_CACHE``, or the user's cache folder."""
    own = os.environ.get("VIRTUAL_LAB_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "virtual-lab"


def surrogate_of(
    model: ModalModel,
    body: BatBody,
    support: Support,
    box: Box,
    *,
    tolerance: float,
    folder: Path | None = None,
) -> Surrogate:
    """Return the surrogate of the model of a bat, from disk where it was built before.

    A file that cannot be read is built again; a folder that cannot be written is done without.

    Raises
    ------
    InputError
        As `Surrogate.build`.
    """
    path = (
        folder or cache_folder()
    ) / f"surrogate-{_key(model, body, support, box, tolerance)}.npz"
    found = _read(path, box)
    if found is not None:
        return found
    built = Surrogate.build(model, box, tolerance=tolerance)
    _write(path, built)
    return built


def _key(model: ModalModel, body: BatBody, support: Support, box: Box, tolerance: float) -> str:
    """Return a hash of all that the coefficients depend on."""
    numbers = (model.modes.count, model.stiff.count, model.patch, repr(model.stepper), WINDOW)
    settings = (version("virtual-lab"), *numbers)
    held = type(support).__name__
    everything = (settings, held, asdict(body), asdict(support), asdict(box), tolerance)
    return hashlib.sha256(repr(everything).encode()).hexdigest()[:32]


def _read(path: Path, box: Box) -> Surrogate | None:
    try:
        with np.load(path) as stored:
            return Surrogate(
                box=box, coefficients=stored["coefficients"], error=float(stored["error"])
            )
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None


def _write(path: Path, built: Surrogate) -> None:
    try:
        with draft_in(path.parent) as draft:
            np.savez(
                draft / path.name, coefficients=built.coefficients, error=np.array(built.error)
            )
            (draft / path.name).replace(path)
    except OSError:
        return
