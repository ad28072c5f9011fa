"""Arrays that share their first axis: selection, joining, and the declared fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
import pytest

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.lab import RoundRobin
from virtual_lab.measurement import certification
from virtual_lab.studies.plan.sample import sample_of
from virtual_lab.units import Array, Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner(AlignedArrays):
    count: np.ndarray
    seen: Mask

    aligned: ClassVar = EVERY_FIELD


@dataclass(frozen=True, slots=True, kw_only=True)
class Outer(AlignedArrays):
    time: Array  # (shot, gate)
    inner: Inner
    constants: Mapping[str, Inner]
    radar: Any
    distances: Array  # distances of the rig's gates, (gate,)
    offset: Array | float = 0.0

    aligned: ClassVar = ("time", "inner", "constants", "radar", "offset")


@dataclass(frozen=True)
class Radar:
    """Readings of another package, with no method but `part`."""

    speed: Array

    def part(self, chosen: Any) -> Radar:
        return Radar(self.speed[chosen])


def outer(shots: int = 3) -> Outer:
    number = np.arange(shots)
    inner = Inner(count=number + 1, seen=number >= 0)
    return Outer(
        time=10.0 * number[:, None] + np.arange(3),
        inner=inner,
        constants={"k": inner},
        radar=Radar(0.5 * number),
        distances=np.arange(3.0),
    )


@pytest.mark.parametrize(
    "rows", [slice(1, 3), np.array([1, 2]), np.array([False, True, True])], ids=str
)
def test_a_selection_has_the_chosen_rows(rows: Any) -> None:
    selection = outer().select(rows)
    assert selection.time.tolist() == [[10, 11, 12], [20, 21, 22]]
    assert selection.inner.count.tolist() == selection.constants["k"].count.tolist() == [2, 3]
    assert selection.radar.speed.tolist() == [0.5, 1.0]
    assert selection.distances.tolist() == [
        0,
        1,
        2,
    ]  # array that has the length of the shots by chance
    assert selection.offset == 0.0


def test_a_missing_row_has_no_values() -> None:
    selection = outer().select(np.array([[2, -1]]))
    assert selection.time.shape == (1, 2, 3)
    assert selection.time[0, 0].tolist() == [20, 21, 22]
    assert np.isnan(selection.time[0, 1]).all()
    assert selection.inner.count.tolist() == [[3, 0]]
    assert selection.inner.seen.tolist() == [[True, False]]


def test_selecting_a_single_row_removes_its_axis() -> None:
    assert outer().select(1).time.tolist() == [10, 11, 12]


def test_parts_are_joined_row_by_row() -> None:
    whole = outer()
    halves = [whole.inner.select(slice(0, 1)), whole.inner.select(slice(1, 3))]
    joined = Inner.concatenate(halves)
    assert joined.count.tolist() == [1, 2, 3]
    assert joined.seen.dtype == bool


def lengths(value: Any, met: set[str]) -> set[int]:
    """Return the numbers of rows of the declared fields, at any depth; add class names to `met`."""
    if isinstance(value, np.ndarray):
        return {len(value)}
    if isinstance(value, Mapping):
        return set().union(*(lengths(each, met) for each in value.values()))
    if not isinstance(value, AlignedArrays):
        return set()
    kind = type(value)
    met.add(kind.__name__)
    names = [each.name for each in fields(kind)]  # type: ignore[arg-type]
    chosen = names if kind.aligned == EVERY_FIELD else kind.aligned
    return set().union(*(lengths(getattr(value, name), met) for name in chosen))


def used_kinds(base: type[AlignedArrays]) -> set[str]:
    """Return the names of the classes below `base` that are no base themselves."""
    below = base.__subclasses__()
    bases = {kind.__name__ for kind in below if kind.__subclasses__()}
    return set().union(*map(used_kinds, below), {kind.__name__ for kind in below}) - bases


def test_the_declared_fields_of_a_certification_have_one_length(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The test checks each selection in a block, and the results of the block."""
    original, met = AlignedArrays.select, set[str]()

    def spied(self: AlignedArrays, rows: Any) -> AlignedArrays:
        assert len(lengths(self, met)) == 1, type(self)
        return original(self, rows)

    monkeypatch.setattr(AlignedArrays, "select", spied)
    monkeypatch.setattr(certification, "CACHED", 1)  # one laboratory per part, so each is selected
    block = next(RoundRobin.of("r161", "astm-f1881").blocks(3, seed=1))
    block.of(1)
    certified = block.certified
    for budgets in certified.results.values():
        assert lengths(budgets, met) == {3}
    assert lengths(certified.readings.flights.raw, met) == {certified.reduced.owner.size}
    assert lengths(sample_of(block), met) == {3}
    assert used_kinds(AlignedArrays) - {"Inner", "Outer"} == met
