"""Worker processes: their answers, their errors and their ends."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from virtual_lab.errors import InputError
from virtual_lab.processes import ONE_THREAD, Worker, WorkerLostError, workers


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    worker = Worker("tests")
    yield worker
    worker.end()


def test_a_worker_that_dies_is_reported_and_replaced(worker: Worker) -> None:
    assert worker.call(abs, -2) == 2
    first = worker.process
    with pytest.raises(WorkerLostError, match="its worker ended with 3"):
        worker.call(os._exit, 3)
    assert worker.process is None
    assert worker.call(max, 4, 5) == 5
    assert worker.process is not first


def test_an_error_of_a_call_is_raised_here_and_the_worker_continues(worker: Worker) -> None:
    with pytest.raises(ValueError, match="invalid literal"):
        worker.call(int, "x")
    with pytest.raises(InputError, match="knots"):
        worker.call(_refuse, "knots")
    assert worker.call(abs, -1) == 1


def _refuse(unit: str) -> None:
    raise InputError("", "unit", unit, "allowed: mph")


def test_printed_text_is_no_answer(worker: Worker) -> None:
    assert worker.call(print, "aside") is None


def test_a_worker_has_one_thread(worker: Worker) -> None:
    assert {worker.call(os.getenv, name) for name in ONE_THREAD} == {"1"}


def test_workers_share_calls_and_end_with_the_context() -> None:
    with workers(2) as submit:
        answers = [submit(pow, number, 2) for number in range(20)]
        assert [each.result() for each in answers] == [number**2 for number in range(20)]
        numbers = {submit(os.getpid).result() for _ in range(2)}
        late, later = [submit(time.sleep, 60) for _ in range(2)], submit(time.sleep, 60)
        while not all(each.running() for each in late):
            time.sleep(0.01)
    assert all(isinstance(each.exception(), WorkerLostError) for each in late)
    assert later.cancelled()
    for number in numbers:
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


def test_a_worker_dismissed_between_two_calls_or_before_one_is_lost(worker: Worker) -> None:
    """A context may end after a call has begun and before it has written its request."""
    assert worker.call(abs, -1) == 1
    assert worker.process is not None
    assert worker.process.stdin is not None
    worker.process.stdin.close()
    with pytest.raises(WorkerLostError):
        worker.call(abs, -2)
    worker.dismiss()
    with pytest.raises(WorkerLostError, match="dismissed"):
        worker.call(abs, -3)
    assert worker.process is None


def test_a_script_without_a_main_guard_can_use_workers(tmp_path: Path) -> None:
    """Python's own pools import the script again in each process; these do not."""
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent("""
            from virtual_lab.processes import workers
            with workers(2) as submit:
                print(submit(abs, -3).result())
        """)
    )
    ran = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert (ran.stdout, ran.stderr) == ("3\n", "")
