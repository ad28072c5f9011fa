"""Random numbers by (seed, name, block): the same bits whoever asks, in whatever order.

Everything random in a laboratory is drawn through `Draws`. `Streams` draws; `Quiet` answers
every request with the middle of the distribution, which turns any rig into its noise-free
self without a line of the rig knowing.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from math import prod
from typing import Protocol
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

__all__ = ["Draws", "Quiet", "Streams", "commitment"]

Array = NDArray[np.float64]
MANY = 4096  # numbers, which are worth compiled code


class Draws(Protocol):
    """Standardised random numbers, one independent stream for each (name, block)."""

    def normal(self, name: str, shape: int | tuple[int, ...] = (), block: int = 0) -> Array:
        """Return standard normal numbers."""
        ...

    def uniform(self, name: str, shape: int | tuple[int, ...] = (), block: int = 0) -> Array:
        """Return uniform numbers of zero mean between -1/2 and 1/2."""
        ...


@dataclass(frozen=True, slots=True)
class Streams:
    """Independent streams of one seed; no stream depends on what the others gave.

    Each `branch` of a seed has streams of its own: what one laboratory draws anew for each of
    its tests.
    """

    seed: int
    branch: tuple[int, ...] = ()

    def _bits(self, name: str, block: int) -> np.random.PCG64DXSM:
        key = (crc32(name.encode()), block, *self.branch)
        return np.random.PCG64DXSM(np.random.SeedSequence(self.seed, spawn_key=key))

    def normal(self, name: str, shape: int | tuple[int, ...] = (), block: int = 0) -> Array:
        bits = self._bits(name, block)
        count = prod(np.atleast_1d(shape).tolist())
        if count < MANY:
            return np.asarray(np.random.Generator(bits).standard_normal(shape))
        from virtual_lab.ziggurat import normal_numbers

        return normal_numbers(bits.random_raw, count).reshape(shape)

    def uniform(self, name: str, shape: int | tuple[int, ...] = (), block: int = 0) -> Array:
        return np.asarray(np.random.Generator(self._bits(name, block)).random(shape) - 0.5)


@dataclass(frozen=True, slots=True)
class Quiet:
    """No randomness: every draw is the mean of its distribution."""

    def normal(self, name: str, shape: int | tuple[int, ...] = (), block: int = 0) -> Array:
        return np.zeros(shape)

    uniform = normal


def commitment(salt: bytes, seed: int) -> str:
    """Return SHA-256(salt‖seed) in hexadecimal: binds a record to a seed without telling it."""
    return hashlib.sha256(salt + str(seed).encode()).hexdigest()
