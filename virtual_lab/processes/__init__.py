"""Distribution of work to processes of this computer, each with one thread.

A worker imports the modules of the functions that it calls, but not the script that started it. The
script therefore needs no ``if __name__ == "__main__"``.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from subprocess import DEVNULL, PIPE, Popen
from threading import Lock
from typing import Any, Protocol, TypeVar, cast

Answer = TypeVar("Answer")
THREADS = ("OMP", "OPENBLAS", "MKL", "NUMBA")
ONE_THREAD = {f"{each}_NUM_THREADS": "1" for each in THREADS} | {"VECLIB_MAXIMUM_THREADS": "1"}


class WorkerLostError(Exception):
    """A worker process ended during its work."""


class Submit(Protocol):
    """Function that submits a call of a module-level function to the next free worker."""

    def __call__(self, function: Callable[..., Answer], *arguments: Any) -> Future[Answer]: ...


class Worker:
    """A process that carries out calls. It starts at the first call, and again after a crash."""

    def __init__(self, words: str = "") -> None:
        """Prepare a worker whose command line contains `words`, which identify it."""
        self.command = [sys.executable, "-m", "virtual_lab.processes.worker", words]
        self.process: Popen[bytes] | None = None
        self.dismissed = False
        self.starting = Lock()  # one thread may dismiss the worker while another starts it

    def call(self, function: Callable[..., Answer], *arguments: Any) -> Answer:
        """Return the result of a function called in the process, or raise its exception.

        Raises `WorkerLostError` if the process ended during the call or the worker is dismissed.
        """
        call = pickle.dumps((function, arguments))
        with self.starting:
            if self.dismissed:
                raise WorkerLostError("its worker was dismissed")
            if self.process is None:
                errors = None if sys.stderr else DEVNULL  # without a terminal there is no stderr
                one_thread = os.environ | ONE_THREAD
                self.process = Popen(
                    self.command, env=one_thread, stdin=PIPE, stdout=PIPE, stderr=errors
                )
            calls, answers = cast("Any", self.process.stdin), cast("Any", self.process.stdout)
        try:
            calls.write(len(call).to_bytes(8, "big") + call)
            calls.flush()
            answer, fault = pickle.load(answers)
        except (OSError, EOFError, ValueError, pickle.UnpicklingError):  # ValueError: closed pipe
            raise WorkerLostError(f"its worker ended with {self.end()}") from None
        if fault is not None:
            raise fault
        return cast("Answer", answer)

    def end(self) -> int | None:
        """End the process, even during a call. Return its exit code, or None without a process.

        The next call starts another one.
        """
        with self.starting:
            process, self.process = self.process, None
        if process is None:
            return None
        with process, suppress(OSError):
            cast("Any", process.stdin).close()  # ends the process
        return process.returncode

    def dismiss(self) -> None:
        """End the process, even during a call, and refuse further calls."""
        with self.starting:
            self.dismissed = True
        self.end()


@contextmanager
def workers(count: int, words: str = "") -> Iterator[Submit]:
    """Yield a function that submits calls to `count` worker processes.

    The yielded function takes a module-level function and its arguments, and returns a `Future` of
    the result. The future raises the exception of the call, or `WorkerLostError` if the process
    ended during the call. At the end of the context all processes end, even during a call. `words`
    are added to their command lines, to identify them. Raises `ValueError` if `count` is below 1.
    """
    processes = [Worker(words) for _ in range(count)]
    idle: SimpleQueue[Worker] = SimpleQueue()

    def call(function: Callable[..., Answer], *arguments: Any) -> Answer:
        worker = idle.get()
        try:
            return worker.call(function, *arguments)
        finally:
            idle.put(worker)

    for each in processes:
        idle.put(each)
    with ThreadPoolExecutor(count) as pool:
        try:
            yield lambda function, *arguments: pool.submit(call, function, *arguments)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for each in processes:
                each.dismiss()
            pool.shutdown()
