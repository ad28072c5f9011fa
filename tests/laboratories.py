"""Laboratories that many tests read, each played once per process; no test may change them."""

from functools import cache
from typing import Any

from tests.conftest import PROCEDURE
from virtual_lab import lab
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.stations.rig import Reality

__all__ = ["certified", "certify", "opened"]


def opened(bat: str, **choices: Any) -> lab.Laboratory:
    """Return the laboratory of a setup; `choices` are those of `lab.TestSetup.of`."""
    return lab.Laboratory.open(lab.TestSetup.of(bat, **choices))


def certify(bat: str, progress: Progress = quiet, **choices: Any) -> lab.BatTest:
    """Return the test of a setup; `choices` are those of `lab.TestSetup.of`."""
    return lab.certify_bat(lab.TestSetup.of(bat, **choices), progress)


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
