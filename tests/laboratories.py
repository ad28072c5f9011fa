"""Laboratories that many tests look at, each played once in a process: to be read, not changed."""

from functools import cache

from tests.conftest import PROCEDURE
from virtual_lab import lab
from virtual_lab.simulation.rig import Reality

__all__ = ["certified"]


def certified(
    bat: str = "r161",
    *,
    procedure: str = PROCEDURE,
    seed: int = 1,
    reality: Reality = Reality.REAL,
    faults: tuple[str, ...] = (),
) -> lab.Tested:
    """Return a test as `lab.certify_bat` plays it, the same object to all who ask for it."""
    return _played(bat, procedure, seed, reality, faults)


@cache
def _played(
    bat: str, procedure: str, seed: int, reality: Reality, faults: tuple[str, ...]
) -> lab.Tested:
    return lab.certify_bat(bat, procedure=procedure, seed=seed, reality=reality, faults=faults)
