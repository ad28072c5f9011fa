"""Reproducible random numbers, addressed by (seed, branch, name) and (laboratory, slot, index).

A slot is the number of a shot, or of a reading, in its laboratory. A random number depends only on
its address, not on earlier draws, rounds, batches or the order of actions.

Every random number of a laboratory is drawn through `Draws`. `Streams` draws random numbers.
`Quiet` returns the center of each distribution, which makes any rig noise-free without a change of
its code.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cache, lru_cache
from math import prod
from struct import unpack
from types import EllipsisType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.errors import InputError
from virtual_lab.parameters import LARGEST_SEED, SEED_BITS

__all__ = [
    "LABORATORIES",
    "LARGEST_SEED",
    "SEED_BITS",
    "Draws",
    "Owner",
    "Quiet",
    "Selected",
    "Slots",
    "Streams",
    "commitment",
    "generator",
    "in_turn",
    "of_owners",
    "require_seed",
]

Array = NDArray[np.float64]
Slots = NDArray[np.int_]
# laboratory of each row, as an index into a block of laboratories; ... for a single laboratory
Owner = NDArray[np.int_] | EllipsisType
LABORATORIES = 2**32  # largest number of laboratories in one study


def of_owners(values: ArrayLike, owner: Owner) -> Any:
    """Return one value per shot, (shot, ...), from one value per laboratory, (laboratory, ...).

    `owner` is the index of the laboratory of each shot, (shot,). For a single laboratory `owner` is
    Python's `Ellipsis`. `values` are then returned unchanged, and a number remains a number.
    """
    return np.asarray(values)[owner][()]


def owners_and_slots(laboratories: tuple[int, ...], count: int) -> tuple[Owner, Slots]:
    """Return the owner and the slot of `count` consecutive readings in each laboratory of a block.

    The owner of a reading is the index of its laboratory in the block. The slot of a reading is its
    number in this laboratory, from 0 to `count` - 1. Owner and slot select the random numbers of
    the reading.

    For a block of n laboratories, `laboratories` is ``(n,)``. Both results then have n times
    `count` elements, sorted by laboratory. For a single laboratory outside a block, `laboratories`
    is ``()``. The slots then have the shape (count,), and the owner is Python's `Ellipsis` object.
    """
    slots = np.tile(np.arange(count), laboratories)
    return (np.arange(*laboratories).repeat(count) if laboratories else ...), slots


class Draws(Protocol):
    """Standardized random numbers, independent by name, laboratory, slot and index in the slot.

    For one laboratory and n `slots`, whole numbers from 0, the result has the shape (n, *shape),
    and each row depends only on its slot. Without `slots` the numbers of slot 0 are returned with
    the shape `shape`. For n laboratories the result has a leading axis (n,) with one row per
    laboratory, and `slots`, if stated, has the shape (n,).
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

    def at(self, owner: Owner) -> Self:
        """Return the draws with one row per shot, from the laboratories that own the shots."""
        ...


@dataclass(frozen=True, slots=True)
class Streams:
    """The random numbers of one or more laboratories of a study.

    The study has a `seed`, a number of up to 128 bits. Its laboratories have numbers of 32 bits.
    Each `branch` of a seed has different random numbers, for example each test of one laboratory.

    Raises `InputError` for a seed outside 128 bits or a laboratory number outside 32 bits.
    """

    seed: int
    branch: tuple[int, ...] = ()
    laboratory: int | Slots = 0  # or (n,)

    def __post_init__(self) -> None:
        require_seed(self.seed)
        numbers = np.asarray(self.laboratory)
        wrong = numbers[(numbers < 0) | (numbers >= LABORATORIES)]
        if wrong.size:
            raise InputError("draws", "laboratory", wrong[0], "allowed: 0 to 2^32 - 1")

    def normal(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        return self._numbers(name, shape, slots, True)

    def uniform(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        return self._numbers(name, shape, slots, False)

    def at(self, owner: Owner) -> Self:
        if owner is ...:
            return self
        return replace(self, laboratory=of_owners(self.laboratory, owner))

    def _numbers(
        self, name: str, shape: int | tuple[int, ...], slots: Slots | None, normal: bool
    ) -> Array:
        trailing = (shape,) if isinstance(shape, int) else shape
        leading, per_slot = _leading(self.laboratory, slots), prod(trailing)
        numbers = np.ascontiguousarray(self.laboratory, dtype=np.int64)  # at least one axis
        if slots is None:
            rows = np.zeros(prod(leading), np.int64)
        else:
            rows = np.ascontiguousarray(slots, dtype=np.int64)
        out = np.empty(rows.size * per_slot)
        key = _key(self.seed, self.branch, name)
        if not _kernel()(key, numbers, rows, per_slot, normal, out):
            raise InputError("draws", name, slots, "allowed as slots: 0 to 2^32 - 1")
        return out.reshape(leading + trailing)


@dataclass(frozen=True, slots=True)
class Quiet:
    """Draws without randomness: every number is 0, the mean of its distribution."""

    laboratory: int | Slots = 0  # or (n,)

    def normal(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        trailing = (shape,) if isinstance(shape, int) else shape
        return np.zeros(_leading(self.laboratory, slots) + trailing)

    uniform = normal

    def at(self, owner: Owner) -> Self:
        return replace(self, laboratory=of_owners(self.laboratory, owner))


@dataclass(frozen=True, slots=True)
class Selected:
    """Draws in which only numbers with certain names are random, to study one source of variation.

    Every other number is the mean of its distribution.
    """

    random: Draws
    quiet: Draws
    # patterns of the random names (`fnmatch`), such as ``*.errors``; ``-lot`` excludes a name
    names: tuple[str, ...]

    def normal(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        return self._draws(name).normal(name, shape, slots)

    def uniform(
        self, name: str, shape: int | tuple[int, ...] = (), slots: Slots | None = None
    ) -> Array:
        return self._draws(name).uniform(name, shape, slots)

    def at(self, owner: Owner) -> Self:
        return replace(self, random=self.random.at(owner), quiet=self.quiet.at(owner))

    def _draws(self, name: str) -> Draws:
        excluded = any(
            fnmatchcase(name, pattern[1:]) for pattern in self.names if pattern[:1] == "-"
        )
        random = any(fnmatchcase(name, pattern) for pattern in self.names)
        return self.random if random and not excluded else self.quiet


def _leading(laboratory: int | Slots, slots: Slots | None) -> tuple[int, ...]:
    """Return the leading axes of draws for these laboratories and slots."""
    leading = np.shape(laboratory)
    if slots is None:
        return leading
    if leading not in ((), np.shape(slots)):
        raise InputError("draws", "slots", np.shape(slots), f"allowed: one per row, {leading}")
    return np.shape(slots)


def require_seed(seed: int) -> None:
    """Raise `InputError` for a seed that is not between 0 and 2^128 - 1."""
    if not 0 <= seed <= LARGEST_SEED:
        raise InputError("", "seed", seed, f"allowed: whole numbers from 0 to 2^{SEED_BITS} - 1")


def commitment(salt: bytes, seed: int) -> str:
    """Return the commitment to a seed, as 64 hexadecimal digits.

    The commitment is the SHA-256 hash of the bytes of `salt`, followed by the decimal digits of the
    seed as text. It can be published before a test, because it does not reveal a random seed of 128
    bits. Anyone who learns salt and seed later can verify that the seed is the published one.
    """
    return hashlib.sha256(salt + str(seed).encode()).hexdigest()


def generator(seed: int, name: str, block: int) -> np.random.Generator:
    """Return a numpy generator for the random numbers of one block, selected by seed and name.

    It is used for distributions that numpy samples by rejection. `block` is a whole number from 0.
    The same arguments give the same numbers. Generators that differ in seed, name or block are
    independent. Raises `InputError` for a seed that is not between 0 and 2^128 - 1.
    """
    require_seed(seed)
    digest = hashlib.blake2b(f"{seed}/{name}".encode(), digest_size=16).digest()
    key = np.frombuffer(digest, "<u8")
    return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, block, 0]))


@lru_cache(4096)  # keys of recent laboratories and names
def _key(seed: int, branch: tuple[int, ...], name: str) -> tuple[int, int, int]:
    """Return three words of 32 bits: the BLAKE2b hash of seed, branch and name."""
    owner = "/".join(map(str, (seed, *branch, name)))
    digest = hashlib.blake2b(owner.encode(), digest_size=12).digest()
    words: tuple[int, int, int] = unpack("<3I", digest)
    return words


@cache
def _kernel() -> Any:
    from virtual_lab.streams.philox import fill

    return fill
