"""Frames decoded by a thread of their own while those before them are looked at."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from queue import Full, Queue
from threading import Event, Thread
from typing import TypeVar

__all__ = ["ahead"]

Item = TypeVar("Item")

ROOM = 2  # items decoded before they are asked for
PATIENCE = 0.1  # s between looks whether anybody still reads


def ahead(items: Iterator[Item]) -> Iterator[Item]:
    """Yield items in order, made in a thread; what it raises is raised here."""
    queue: Queue[tuple[Item | None, BaseException | None]] = Queue(ROOM)
    left = Event()

    def put(item: Item | None, fault: BaseException | None = None) -> None:
        while not left.is_set():
            with suppress(Full):
                queue.put((item, fault), timeout=PATIENCE)
                break

    def work() -> None:
        try:
            for item in items:
                put(item)
                if left.is_set():
                    return
            put(None, StopIteration())
        except BaseException as fault:
            put(None, fault)

    thread = Thread(target=work, daemon=True)
    thread.start()
    try:
        while True:
            item, fault = queue.get()
            if isinstance(fault, StopIteration):
                return
            if fault is not None:
                raise fault
            assert item is not None
            yield item
    finally:
        left.set()
        thread.join()
