"""Who makes the blocks of a campaign: processes of this machine, or the workers of Dask."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
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

PATIENCE = 10  # s, for a scheduler to answer
Fault = str | InputError  # '' of nothing; an InputError ends the run
Outcomes = Iterator[tuple[int, Fault]]  # numbers of blocks, and what went wrong


def make_part(folder: str, number: int) -> Fault:
    """Make the part of a block; return what went wrong.

    That is an `InputError` for the folder, and for a disk that is full.
    """
    try:
        stamp = Path(folder) / STAMP
        campaign = _opened(folder, stamp.stat().st_mtime_ns if stamp.exists() else 0)
        block = campaign.block(number)
        sheets = {tuple(key.split("/", 1)): text for key, text in campaign.sheets.items()}
    except InputError as fault:
        return fault
    try:
        with catalog.sheets_in_place(cast("dict[Key, str]", sheets)):
            table = table_of(block, campaign.study.seed)
    except Exception as fault:  # whatever it is, the other blocks go on
        return f"{type(fault).__name__}: {' '.join(str(fault).split())}"
    try:
        write_part(table, campaign.parts, block)
    except OSError as fault:
        allowed = f"cannot be written ({fault.strerror}); what was made stays, resume later"
        return InputError("", "output folder", folder, allowed)
    return ""


def made_by(folder: Path, numbers: Sequence[int], who: int | str) -> Outcomes:
    """Yield blocks as they are made: by so many processes, or Dask's workers at an address.

    `InputError` where the scheduler does not answer, or no more.
    """
    if isinstance(who, str):
        return _by_dask(folder, numbers, who)
    if who > 1:
        return _by_processes(folder, numbers, who)
    return ((number, make_part(str(folder), number)) for number in numbers)


@lru_cache(maxsize=1)
def _opened(folder: str, _changed: int) -> Campaign:
    return Campaign.open(folder)


def _by_processes(folder: Path, numbers: Sequence[int], count: int) -> Outcomes:
    where = str(folder)
    with workers(count, where) as submit:
        yield from _in_turn(lambda number: submit(make_part, where, number), numbers, count)


def _by_dask(folder: Path, numbers: Sequence[int], address: str) -> Outcomes:
    dask = of_extra("distributed", "dask", "Dask")
    where = str(folder.absolute())
    getLogger("distributed.client").setLevel(CRITICAL)  # we say what is wrong, in one line
    known = {"timeout": PATIENCE, "set_as_default": False}
    try:
        with dask.Client(address, **known) as client, client.get_executor(pure=False) as pool:
            most = 2 * max(sum(client.nthreads().values()), 1)  # that none waits for the next
            yield from _in_turn(lambda one: pool.submit(make_part, where, one), numbers, most)
    except (CancelledError, OSError, ValueError) as fault:
        allowed = "does not answer; allowed: the address of a Dask scheduler, tcp://HOST:8786"
        raise InputError("", "dask", address, allowed) from fault


def _in_turn(submit: Callable[[int], Future[Fault]], numbers: Sequence[int], most: int) -> Outcomes:
    """Yield blocks as they end, where up to `most` are under way."""
    rest = iter(numbers)
    pending: dict[Future[Fault], int] = {}
    while True:
        pending |= {submit(number): number for number in islice(rest, most - len(pending))}
        if not pending:
            return
        for each in wait(pending, return_when=FIRST_COMPLETED).done:
            lost = each.exception()
            yield pending.pop(each), str(lost) if lost else each.result()
