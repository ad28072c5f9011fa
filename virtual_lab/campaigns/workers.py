"""Who makes the blocks of a campaign: processes of this machine, or the workers of Dask."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from functools import lru_cache
from itertools import islice
from logging import CRITICAL, getLogger
from pathlib import Path
from queue import SimpleQueue
from subprocess import PIPE, Popen
from typing import Any, cast

from virtual_lab import catalog
from virtual_lab.campaigns.folder import Campaign
from virtual_lab.campaigns.parts import table_of, write_part
from virtual_lab.catalog.reading import Key
from virtual_lab.errors import InputError, missing_extra

THREADS = ("OMP", "OPENBLAS", "MKL", "NUMBA")
ONE_THREAD = {f"{each}_NUM_THREADS": "1" for each in THREADS} | {"VECLIB_MAXIMUM_THREADS": "1"}
PATIENCE = 10  # s, for a scheduler to answer
Outcomes = Iterator[tuple[int, str]]  # numbers of blocks, and what went wrong, '' if nothing


def make_part(folder: str, number: int) -> str:
    """Make the part of a block; return what went wrong with it, '' if nothing.

    `InputError` for what ends the run: the folder, or a disk that is full.
    """
    campaign = _opened(folder)
    block = campaign.block(number)
    sheets = {tuple(key.split("/", 1)): text for key, text in campaign.sheets.items()}
    try:
        with catalog.sheets_in_place(cast("dict[Key, str]", sheets)):
            table = table_of(block, campaign.study.seed)
    except Exception as fault:  # whatever it is, the other blocks go on
        return f"{type(fault).__name__}: {' '.join(str(fault).split())}"
    try:
        write_part(table, campaign.parts, block)
    except OSError as fault:
        allowed = f"cannot be written ({fault.strerror}); what was made stays, resume later"
        raise InputError("", "output folder", folder, allowed) from fault
    return ""


@lru_cache(maxsize=1)
def _opened(folder: str) -> Campaign:
    return Campaign.open(folder)


class Worker:
    """A process that makes parts, started at the first one, and anew when it died."""

    def __init__(self, folder: Path) -> None:
        self.command = [sys.executable, "-m", "virtual_lab.campaigns.worker", str(folder)]
        self.process: Popen[bytes] | None = None

    def make(self, number: int) -> str:
        """Let it make a part, as `make_part`; its death is a fault of the block."""
        if self.process is None:
            self.process = Popen(self.command, env=os.environ | ONE_THREAD, stdin=PIPE, stdout=PIPE)
        asked, answers = cast("Any", self.process.stdin), cast("Any", self.process.stdout)
        try:
            asked.write(b"%d\n" % number)
            asked.flush()
            answer = pickle.load(answers)
        except (OSError, ValueError, EOFError):
            return f"its worker ended with {self.end()}"
        if isinstance(answer, InputError):
            raise answer
        return str(answer)

    def end(self) -> int | None:
        """End the process, whatever it is about."""
        process, self.process = self.process, None
        if process is None:
            return None
        cast("Any", process.stdin).close()
        code = process.wait()
        cast("Any", process.stdout).close()
        return code


def by_processes(folder: Path, numbers: Sequence[int], count: int) -> Outcomes:
    """Yield blocks as so many processes make them, as `_in_turn`."""
    workers = [Worker(folder) for _ in range(count)]
    idle: SimpleQueue[Worker] = SimpleQueue()

    def make(number: int) -> str:
        worker = idle.get()
        try:
            return worker.make(number)
        finally:
            idle.put(worker)

    for each in workers:
        idle.put(each)
    with ThreadPoolExecutor(count) as pool:
        try:
            yield from _in_turn(lambda number: pool.submit(make, number), numbers, count)
        finally:
            for each in workers:
                each.end()


def by_dask(folder: Path, numbers: Sequence[int], address: str) -> Outcomes:
    """Yield blocks as the workers of a Dask scheduler make them, as `_in_turn`.

    `InputError` where the scheduler does not answer, or no more.
    """
    try:
        from distributed import Client
    except ImportError as fault:
        raise missing_extra("dask", "Dask") from fault
    where, gone = str(folder.absolute()), "answers no more; what was made stays, resume later"
    getLogger("distributed.client").setLevel(CRITICAL)  # we say what is wrong, in one line
    try:
        client = cast("Any", Client)(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as fault:
        allowed = "does not answer; allowed: the address of a Dask scheduler, tcp://HOST:8786"
        raise InputError("", "dask", address, allowed) from fault
    try:
        with client, client.get_executor(pure=False) as pool:
            ahead = 2 * max(sum(client.nthreads().values()), 1)  # that none waits for the next
            yield from _in_turn(lambda one: pool.submit(make_part, where, one), numbers, ahead)
    except (CancelledError, OSError) as fault:
        raise InputError("", "dask", address, gone) from fault


def _in_turn(submit: Callable[[int], Future[str]], numbers: Sequence[int], ahead: int) -> Outcomes:
    """Yield blocks as they end, each with what went wrong, '' if nothing; `ahead` are under way."""
    rest = iter(numbers)
    pending: dict[Future[str], int] = {}
    while True:
        pending |= {submit(number): number for number in islice(rest, ahead - len(pending))}
        if not pending:
            return
        for each in wait(pending, return_when=FIRST_COMPLETED).done:
            number, fault = pending.pop(each), each.exception()
            if isinstance(fault, InputError):
                raise fault
            yield number, str(fault) if fault else each.result()
