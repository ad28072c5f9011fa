"""Workers that compute the parts of a campaign: processes of this machine, or Dask workers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from functools import lru_cache
from itertools import islice
from logging import CRITICAL, getLogger
from pathlib import Path
from typing import cast

from virtual_lab import catalog
from virtual_lab.campaigns.folder import STAMP, Campaign
from virtual_lab.campaigns.parts import table_of, write_part
from virtual_lab.catalog.reading import Key
from virtual_lab.errors import InputError, of_extra
from virtual_lab.processes import workers

PATIENCE = 10.0  # longest wait for a scheduler and its first worker [s]
NO_ANSWER = "does not answer; allowed: the address of a Dask scheduler, tcp://HOST:8786"
NO_WORKERS = "has no worker; start one: dask worker ADDRESS --nthreads 1"
Fault = str | InputError  # text of a fault, empty for none; an InputError ends the run
Outcomes = Iterator[tuple[int, Fault]]  # number and fault of each block


def make_part(folder: str, number: int) -> Fault:
    """Compute and write the part of the block `number`; return its fault, or "" if there is none.

    If the tests fail, the fault is a sentence. If the folder cannot be used or the part cannot be
    written, the fault is an `InputError`. This error is returned, not raised.
    """
    try:
        stamp = Path(folder) / STAMP
        campaign = _open(folder, stamp.stat().st_mtime_ns if stamp.exists() else 0)
        block = campaign.block(number)
        sheets = {tuple(key.split("/", 1)): text for key, text in campaign.sheets.items()}
    except InputError as fault:
        return fault
    try:
        with catalog.sheets_in_place(cast("dict[Key, str]", sheets)):
            table = table_of(block, campaign.study.seed, campaign.layout(block))
    except Exception as fault:  # any error, so that other blocks can continue
        return f"{type(fault).__name__}: {' '.join(str(fault).split())}"
    try:
        write_part(table, campaign.parts, block)
    except OSError as fault:
        allowed = (
            f"cannot be written ({fault.strerror}); finished parts stay; resume the campaign later"
        )
        return InputError("", "output folder", folder, allowed)
    return ""


def make_parts(folder: Path, numbers: Iterable[int], workers_or_address: int | str) -> Outcomes:
    """Make the part of each block of laboratories; yield number and fault of each block.

    A part is a file with the tests of one block. Number and fault are yielded as soon as the part
    is finished, so the order is arbitrary. The fault is "" if there is none. Otherwise it is a
    sentence, or an `InputError` that should end the run. `workers_or_address` is a number of
    processes, or the address of a Dask scheduler. Raises `InputError` if the extra ``dask`` is not
    installed, and if the scheduler does not answer or has no worker.
    """
    if isinstance(workers_or_address, str):
        return _by_dask(folder, numbers, workers_or_address)
    if workers_or_address > 1:
        return _by_processes(folder, numbers, workers_or_address)
    return ((number, make_part(str(folder), number)) for number in numbers)


@lru_cache(maxsize=1)
def _open(folder: str, _changed: int) -> Campaign:
    return Campaign.open(folder)


def _by_processes(folder: Path, numbers: Iterable[int], count: int) -> Outcomes:
    where = str(folder)
    with workers(count, where) as submit:
        yield from _in_parallel(lambda number: submit(make_part, where, number), numbers, count)


def _by_dask(folder: Path, numbers: Iterable[int], address: str) -> Outcomes:
    dask = of_extra("distributed", "dask", "Dask")
    where = str(folder.absolute())
    getLogger("distributed.client").setLevel(CRITICAL)  # errors are reported in one line instead
    options = {"timeout": PATIENCE, "set_as_default": False}
    threads = threads_at(address)
    try:
        with dask.Client(address, **options) as client:
            pool, most = client.get_executor(pure=False), 2 * threads  # so that no thread is idle
            yield from _in_parallel(
                lambda number: pool.submit(make_part, where, number),
                numbers,
                most,
                lambda: threads_at(address),
            )
    except (CancelledError, OSError) as fault:
        raise InputError("", "dask", address, NO_ANSWER) from fault


def threads_at(address: str) -> int:
    """Return the number of threads of the workers of a Dask scheduler, at least 1.

    Raises `InputError` if the scheduler does not answer or has no worker within `PATIENCE`.
    """
    with ThreadPoolExecutor(1) as beside:  # in a notebook this thread already runs an event loop
        return beside.submit(asyncio.run, _count_threads(address)).result()


async def _count_threads(address: str) -> int:
    dask = of_extra("distributed", "dask", "Dask")
    threads, allowed = 0, NO_ANSWER
    with suppress(TimeoutError):
        async with asyncio.timeout(PATIENCE):
            try:
                options = dask.Security().get_connection_args("client")
                async with dask.core.rpc(address, connection_args=options) as scheduler:
                    while not threads:
                        workers = (await scheduler.identity())["workers"].values()
                        threads = sum(worker["nthreads"] for worker in workers)
                        allowed = NO_WORKERS
                        await asyncio.sleep(0.1 if not threads else 0)
            except Exception as fault:  # any error that a wrong address may cause
                raise InputError("", "dask", address, NO_ANSWER) from fault
    if not threads:
        raise InputError("", "dask", address, allowed)
    return threads


def _in_parallel(
    submit: Callable[[int], Future[Fault]],
    numbers: Iterable[int],
    most: int,
    check: Callable[[], object] = lambda: None,
) -> Outcomes:
    """Yield the number and the fault of each block when it ends, at most `most` at a time.

    `check` is called whenever no block has ended for `PATIENCE` seconds.
    """
    remaining = iter(numbers)
    pending: dict[Future[Fault], int] = {}
    while True:
        pending |= {submit(number): number for number in islice(remaining, most - len(pending))}
        if not pending:
            return
        ended = wait(pending, PATIENCE, FIRST_COMPLETED).done
        if not ended:
            check()
        for each in ended:
            fault = each.exception()
            yield pending.pop(each), str(fault) if fault else each.result()
