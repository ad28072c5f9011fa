"""What every test shares: examples drawn from fixed seeds, and laboratories played once."""

import os
from collections.abc import Callable
from functools import cache

# Our matrices are small: threads of the linear algebra only wait for one another on a busy
# machine (the recoil fits took 20 times as long). Must stand before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

from virtual_lab import lab
from virtual_lab.simulation.rig import Reality

pytest.register_assert_rewrite("tests.rigs.conformance")
settings.register_profile("fixed", derandomize=True, deadline=None, database=None)
settings.load_profile("fixed")

PROCEDURE = "astm-f1881"
Play = Callable[..., lab.Tested]


@pytest.fixture(scope="session")
def played() -> Play:
    """Return a laboratory that plays each test once and remembers it."""

    @cache
    def play(
        bat: str = "r161",
        reality: Reality = Reality.REAL,
        seed: int = 1,
        procedure: str = PROCEDURE,
    ) -> lab.Tested:
        return lab.certify_bat(bat, procedure=procedure, seed=seed, reality=reality)

    return play
