"""Choice among candidate plans: those that reach a target u, the cheapest first.

The axes of all arrays are those of `Forecast.u`: sets of exchanged instruments, then the four
counts. Each count increases along its axis. The first entry, with no exchange and the smallest
counts, is the present laboratory.
"""

from __future__ import annotations

from math import log2

import numpy as np

from virtual_lab.units import Array, Mask

Index = tuple[int, ...]


def cheapest(u: Array, cost: Array, target: float, most: int) -> list[Index]:
    """Return the indices of the cheapest plans with a u of at most `target`, the cheapest first.

    A plan exchanges a set of instruments and has four counts: hits, final hits, balls and wall
    hits. A plan is left out if it would still reach the target with one exchange fewer, or with the
    next smaller value of one count. Plans of equal cost are sorted by their number of exchanges,
    then by u. The list is empty if no plan reaches the target.

    Parameters
    ----------
    u
        u of each plan in the unit of `target`, shape (set of exchanges, hits, final hits, balls,
        wall hits). The counts increase along their axes. Set number s exchanges instrument k if bit
        k of s is 1.
    cost
        Cost of each plan in any unit, in the shape of `u`.
    target
        Largest allowed u.
    most
        Largest number of indices to return.
    """
    return _rank(irreducible(u <= target), u, cost)[:most]


def cheapest_single_change(u: Array, cost: Array, target: float) -> Index | None:
    """Return the index of the cheapest plan that reaches the target with a single change.

    The change is the exchange of one instrument, or a larger value of one count. The result is None
    if no such plan reaches the target. The arguments are those of `cheapest`.
    """
    changed = [np.arange(size) > 0 for size in u.shape]
    changes = np.sum(np.meshgrid(*changed, indexing="ij"), axis=0)
    exchanges = _exchanges(u).reshape(-1, *(1,) * (u.ndim - 1))
    single = (changes == 1) & (exchanges <= 1) & (u <= target)
    return next(iter(_rank(single, u, cost)), None)


def cheapest_with_fewer(u: Array, cost: Array, target: float, exchanges: int) -> Index | None:
    """Return the index of the cheapest plan that reaches the target with fewer exchanges.

    It exchanges fewer than `exchanges` instruments. The result is None if there is no such plan.
    The other arguments are those of `cheapest`.
    """
    fewer = _exchanges(u).reshape(-1, *(1,) * (u.ndim - 1)) < exchanges
    return next(iter(_rank(fewer & (u <= target), u, cost)), None)


def irreducible(reaches: Mask) -> Mask:
    """Return a mask of the plans that reach a target and cannot be reduced.

    A plan consists of these choices:

    * the instruments that are exchanged;
    * four counts: hits, final hits, balls and wall hits.

    A plan can be reduced if a smaller plan would still reach the target. A smaller plan has one
    exchanged instrument fewer, or the next smaller value of one count.

    `reaches` is the mask of all plans that reach the target. Both masks have the shape of `u` in
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
