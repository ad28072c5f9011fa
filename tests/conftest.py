"""Settings of all tests: examples from fixed seeds, and laboratories that are played once."""

from __future__ import annotations

import gc
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

# Threads of the linear algebra: for our small matrices they only wait for one another on a busy
# machine (the recoil fits took 20 times as long). The line must precede the import of numpy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

if TYPE_CHECKING:  # types only: the process that distributes the tests needs no laboratory
    from virtual_lab import lab
    from virtual_lab.simulation.stations.rig import Reality

# Byte code is kept: without it each process of the tests would compile all libraries again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Temporary files are kept in memory, if it has room: each entry of a log waits 30 ms for a disk.
# The folders of tests that pass are deleted at the end (pyproject.toml).
MEMORY, ROOM = Path("/dev/shm"), 4e9  # B
if MEMORY.is_dir() and shutil.disk_usage(MEMORY).free > ROOM:
    runs_scripts = not os.statvfs(MEMORY).f_flag & os.ST_NOEXEC
    os.environ.setdefault("TMPDIR", str(MEMORY if runs_scripts else tempfile.gettempdir()))
    tempfile.tempdir = None  # read again

# Tests leave few cycles: with Python's thresholds a twentieth of the processor time is spent on
# looking for them.
gc.set_threshold(50_000, 20)

pytest.register_assert_rewrite("tests.rigs.conformance")
settings.register_profile("fixed", derandomize=True, deadline=None, database=None)
settings.load_profile("fixed")

PROCEDURE = "astm-f1881"


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels before the worker processes start, as each would compile them all."""
    config = session.config
    if not hasattr(config, "workerinput") and config.getoption("numprocesses", 0):
        from tests.warming import warm_kernels

        try:
            warm_kernels(config.pluginmanager.get_plugin("terminalreporter").write_line)
        except KeyboardInterrupt:
            pytest.exit("interrupted while the numerical code was compiled")


def pytest_collection_finish() -> None:
    """Exempt modules and tests, which live to the end, from every later garbage collection."""
    gc.collect()
    gc.freeze()


Play = Callable[..., "lab.BatTest"]


@pytest.fixture(scope="session")
def played() -> Play:
    """Return a function that plays each test once and remembers it."""
    from tests.laboratories import certified

    def play(
        bat: str = "r161",
        reality: Reality | None = None,
        seed: int = 1,
        procedure: str = PROCEDURE,
    ) -> lab.BatTest:
        values = {} if reality is None else {"reality": reality}
        return certified(bat, procedure=procedure, seed=seed, **values)

    return play
