"""Work shared out to processes of this machine, each with one thread.

They import what they are asked to call and not the caller's script, which so needs no guard.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from subprocess import PIPE, Popen
from threading import Lock
from typing import Any, Protocol, TypeVar, cast

Answer = TypeVar("Answer")
THREADS = ("OMP", "OPENBLAS", "MKL", "NUMBA")
ONE_THREAD = {f"{each}_NUM_THREADS": "1" for each in THREADS} | {"VECLIB_MAXIMUM_THREADS": "1"}


class WorkerLostError(Exception):
    """A worker that ended over its work."""


class Submit(Protocol):
    """Takes a function that a module has, and its arguments; the workers call it in turn."""

    def __call__(self, function: Callable[..., Answer], *arguments: Any) -> Future[Answer]: ...


class Worker:
    """A process that answers calls, started at the first one, and anew when it died."""

    def __init__(self, words: str = "") -> None:
        """Prepare one whose command line has these words, by which it can be told."""
        self.command = [sys.executable, "-m", "virtual_lab.processes.worker", words]
        self.process: Popen[bytes] | None = None
        self.dismissed = False
        self.starting = Lock()  # a call starts a process while another thread may dismiss

    def call(self, function: Callable[..., Answer], *arguments: Any) -> Answer:
        """Return what a function answers, or raise what it raises.

        `WorkerLostError` where the process ended meanwhile, or the worker is dismissed.
        """
        call = pickle.dumps((function, arguments))
        with self.starting:
            if self.dismissed:
                raise WorkerLostError("its worker was dismissed")
            if self.process is None:
                self.process = Popen(
                    self.command, env=os.environ | ONE_THREAD, stdin=PIPE, stdout=PIPE
                )
            asked, answers = cast("Any", self.process.stdin), cast("Any", self.process.stdout)
        try:
            asked.write(len(call).to_bytes(8, "big") + call)
            asked.flush()
            answer, fault = pickle.load(answers)
        except (OSError, EOFError, ValueError, pickle.UnpicklingError):  # ValueError: a closed pipe
            raise WorkerLostError(f"its worker ended with {self.end()}") from None
        if fault is not None:
            raise fault
        return cast("Answer", answer)

    def end(self) -> int | None:
        """End the process, whatever it is about; the next call starts another."""
        with self.starting:
            process, self.process = self.process, None
        if process is None:
            return None
        with process, suppress(OSError):
            cast("Any", process.stdin).close()  # which ends it
        return process.returncode

    def dismiss(self) -> None:
        """End the process, whatever it is about, and answer no more calls."""
        with self.starting:
            self.dismissed = True
        self.end()


@contextmanager
def workers(count: int, words: str = "") -> Iterator[Submit]:
    """Start so many processes; they end with the context, whatever they are about."""
    own = [Worker(words) for _ in range(count)]
    idle: SimpleQueue[Worker] = SimpleQueue()

    def call(function: Callable[..., Answer], *arguments: Any) -> Answer:
        worker = idle.get()
        try:
            return worker.call(function, *arguments)
        finally:
            idle.put(worker)

    for each in own:
        idle.put(each)
    with ThreadPoolExecutor(count) as pool:
        try:
            yield lambda function, *arguments: pool.submit(call, function, *arguments)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for each in own:
                each.dismiss()
            pool.shutdown()
