"""Choice among candidate plans: those that reach a target u, the cheapest first.

The axes of all arrays are those of `Forecast.u`: sets of exchanged instruments, then the counts in
ascending order. The first entry, of no exchange and the smallest counts, is the present laboratory.
"""

from __future__ import annotations

from math import log2

import numpy as np

from virtual_lab.units import Array, Mask

Index = tuple[int, ...]


def cheapest(u: Array, cost: Array, target: float, most: int) -> list[Index]:
    """Return the indices of the cheapest plans that reach the target u, the cheapest first.

    A plan is left out if it would still reach the target with one exchange fewer, or with one count
    a step smaller. Of plans with equal costs, the one with fewer exchanges comes first, then the
    one with the smaller u.

    Parameters
    ----------
    u
        u of each plan in the unit of `target`, shape (set of exchanges, hits, final hits, balls,
        wall hits). Bit k of the number of a set is 1 if instrument k is exchanged.
    cost
        Cost of each plan in any unit, in the shape of `u`.
    target
        Largest u.
    most
        Largest number of indices to return.
    """
    return _rank(irreducible(u <= target), u, cost)[:most]


def cheapest_single_change(u: Array, cost: Array, target: float) -> Index | None:
    """Return the index of the cheapest plan that differs from the present laboratory in one thing.

    The plan exchanges one instrument or raises one count, by any number of steps. The result is
    None if no such plan reaches the target. The arguments are those of `cheapest`.
    """
    changed = [np.arange(size) > 0 for size in u.shape]
    changes = np.sum(np.meshgrid(*changed, indexing="ij"), axis=0)
    exchanges = _exchanges(u).reshape(-1, *(1,) * (u.ndim - 1))
    single = (changes == 1) & (exchanges <= 1) & (u <= target)
    return next(iter(_rank(single, u, cost)), None)


def irreducible(reaches: Mask) -> Mask:
    """Return a mask of the plans that reach a target, but not with fewer changes.

    A plan is False if it would still reach the target with one exchange fewer, or with one count a
    step smaller. `reaches` marks all plans that reach the target. Its shape is that of `u` in
    `cheapest`.
    """
    needed = reaches.copy()
    for axis in range(1, reaches.ndim):
        above, below = (
            tuple(part if at == axis else slice(None) for at in range(reaches.ndim))
            for part in (slice(1, None), slice(None, -1))
        )
        needed[above] &= ~reaches[below]
    sets = np.arange(len(reaches))
    for bit in range(round(log2(sets.size))):
        with_it = sets[sets >> bit & 1 == 1]
        needed[with_it] &= ~reaches[with_it - (1 << bit)]
    return needed


def _rank(mask: Mask, u: Array, cost: Array) -> list[Index]:
    indices = np.argwhere(mask)
    at = tuple(indices.T)
    order = np.lexsort((u[at], _exchanges(u)[indices[:, 0]], cost[at]))
    return [tuple(row) for row in indices[order].tolist()]


def _exchanges(u: Array) -> Array:
    """Return the number of exchanged instruments of each set, (set,)."""
    sets = np.arange(len(u))
    return np.asarray(np.sum(sets[:, None] >> np.arange(len(u).bit_length()) & 1, axis=1))
