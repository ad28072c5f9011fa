"""Laboratories that many tests read, each played once per process; no test may change them."""

from dataclasses import replace
from functools import cache
from typing import Any

from tests.conftest import PROCEDURE
from virtual_lab import lab
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.stations.rig import Reality

__all__ = ["certified", "certify", "opened", "setup_of"]


def setup_of(bat: str, **choices: Any) -> lab.TestSetup:
    """Return a setup; `choices` are parameters of `lab.TestSetup.of` or fields of a setup."""
    fields = {key: choices.pop(key) for key in ("film", "lot", "motion", "test") if key in choices}
    return replace(lab.TestSetup.of(bat, **choices), **fields)


def opened(bat: str, **choices: Any) -> lab.Laboratory:
    """Return the laboratory of a setup; `choices` as for `setup_of`."""
    return lab.Laboratory.open(setup_of(bat, **choices))


def certify(bat: str, progress: Progress = quiet, **choices: Any) -> lab.BatTest:
    """Return the test of a setup; `choices` as for `setup_of`."""
    return lab.certify_bat(setup_of(bat, **choices), progress)


def certified(
    bat: str = "r161",
    *,
    procedure: str = PROCEDURE,
    seed: int = 1,
    reality: Reality = Reality.REAL,
    faults: tuple[str, ...] = (),
) -> lab.BatTest:
    """Return a test as `lab.certify_bat` plays it; equal arguments return the same object."""
    return _played(bat, procedure, seed, reality, faults)


@cache
def _played(
    bat: str, procedure: str, seed: int, reality: Reality, faults: tuple[str, ...]
) -> lab.BatTest:
    return certify(bat, procedure=procedure, seed=seed, reality=reality, faults=faults)
