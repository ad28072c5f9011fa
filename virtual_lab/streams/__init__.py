"""Random numbers by (seed, branch, name) and by (laboratory, slot, index): the same bits always.

A slot is the number of a shot in its laboratory, or of a reading. A number depends on nothing that
was drawn before it or beside it: not on rounds, batches or the order of actions.

Everything random in a laboratory is drawn through `Draws`. `Streams` draws; `Quiet` answers
every request with the middle of the distribution, which turns any rig into its noise-free
self without a line of the rig knowing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from math import prod
from struct import unpack
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError

__all__ = ["LABORATORIES", "Draws", "Quiet", "Slots", "Streams", "commitment"]

Array = NDArray[np.float64]
Slots = NDArray[np.int_]
LABORATORIES = 2**32  # that one study can count


class Draws(Protocol):
    """Standardised random numbers, independent by name, slot and index within the slot.

    With `slots` (n,), whole numbers from 0, the numbers are (n, *shape) and each row depends on
    its own slot alone; without, they are those of slot 0, of `shape`.
    """

    def normal(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        """Return standard normal numbers."""
        ...

    def uniform(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        """Return uniform numbers of zero mean between -1/2 and 1/2."""
        ...


@dataclass(frozen=True, slots=True)
class Streams:
    """The numbers of one laboratory of a study.

    The study has a `seed`, a whole number of any size, and its laboratories are counted, by whole
    numbers of 32 bits. Each `branch` of a seed has numbers of its own: what one laboratory draws
    for each of its tests.

    Raises `InputError` for a laboratory that cannot be counted.
    """

    seed: int
    branch: tuple[int, ...] = ()
    laboratory: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.laboratory < LABORATORIES:
            raise InputError("draws", "laboratory", self.laboratory, "allowed: 0 to 2^32 - 1")

    def normal(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        return self._numbers(name, shape, slots, True)

    def uniform(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        return self._numbers(name, shape, slots, False)

    def _numbers(
        self, name: str, shape: int | tuple[int, ...], slots: Slots | None, normal: bool
    ) -> Array:
        each = shape if isinstance(shape, int) else prod(shape)
        rows = np.ascontiguousarray([0] if slots is None else slots, dtype=np.int64)
        out = np.empty(rows.size * each)
        key = _key(self.seed, self.branch, name)
        if not _kernel()(key, self.laboratory, rows, each, normal, out):
            raise InputError("draws", name, slots, "allowed as slots: 0 to 2^32 - 1")
        return out.reshape(_laid(shape, slots))


@dataclass(frozen=True, slots=True)
class Quiet:
    """No randomness: every draw is the mean of its distribution."""

    def normal(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        return np.zeros(_laid(shape, slots))

    uniform = normal


def commitment(salt: bytes, seed: int) -> str:
    """Return SHA-256(salt‖seed) in hexadecimal: binds a record to a seed without telling it."""
    return hashlib.sha256(salt + str(seed).encode()).hexdigest()


def _laid(shape: int | tuple[int, ...], slots: Slots | None) -> tuple[int, ...]:
    own = (shape,) if isinstance(shape, int) else shape
    return own if slots is None else (len(slots), *own)


@lru_cache(4096)  # keys of some laboratories
def _key(seed: int, branch: tuple[int, ...], name: str) -> tuple[int, int, int]:
    """Return three words of 32 bits: BLAKE2b of what the numbers belong to."""
    owner = "/".join(map(str, (seed, *branch, name)))
    digest = hashlib.blake2b(owner.encode(), digest_size=12).digest()
    words: tuple[int, int, int] = unpack("<3I", digest)
    return words


@cache
def _kernel() -> Callable[..., Any]:
    from virtual_lab.streams.philox import fill

    return fill
