"""Repairs: what each mends, that nothing else changes, and that the day ends as a sound one."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.bench.days import PLACE_MM, PLAIN, apparatus, asked, play_actions
from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import ready_steps
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.operators import Look, Operator, operator_of
from virtual_lab.bench.day.readings import suspected_faults
from virtual_lab.bench.day.table import (
    action_table,
    detectable,
    preparation,
    remedy_of,
    repairs,
)
from virtual_lab.bench.machines.stored_day import run_operator

NO_REMEDY = {"bat-cracked"}
FEW = ("scale-not-tared", "encoder-slip", "gate-misses", "aim-along")
SHOTS = 4


def mending(fault: str) -> Operator:
    """Return who finds a fault by its checks, puts it right and makes its checks again."""
    remedy = remedy_of(fault)
    assert remedy is not None
    name, given = remedy
    sheet = action_table().actions[name]

    def fires(look: Look) -> Iterator[Action]:
        yield action_of("set-place", {"place": PLACE_MM})
        for shot in range(SHOTS):
            yield action_of("load-ball", {"ball": shot + 1})
            yield from map(action_of, (*ready_steps(look().day), "fire"))

    def taken_so(look: Look) -> Iterator[Action]:
        yield from map(action_of, preparation())
        checks = [each for each in detectable()[fault].actions if each not in preparation()]
        shoots = "fire" in checks
        checks = [each for each in checks if each not in {*ready_steps(look().day), "fire"}]
        yield from map(action_of, checks)
        if shoots:
            yield from fires(look)
        assert fault in {row.fault for row in suspected_faults(look())}
        if fault == "ball-worn-out":
            worn = next(row for row in suspected_faults(look()) if row.fault == fault)
            yield action_of(name, {**given, "ball": worn.words[0]})
        else:
            yield action_of(name, dict(given))
        yield from (action_of(each) for each in sheet.again if look().day.times(each))
        yield from map(action_of, checks)
        if shoots:
            yield from fires(look)

    return taken_so


def whole_again(fault: str) -> bool:
    desk = Desk(run_operator(apparatus(fault), mending(fault)))
    return fault not in {row.fault for row in suspected_faults(desk)}


@pytest.mark.parametrize("fault", FEW)
def test_a_repair_removes_the_sign_of_its_fault(fault: str) -> None:
    assert whole_again(fault)


@pytest.mark.long
@pytest.mark.parametrize("fault", sorted(set(detectable()) - NO_REMEDY - set(FEW)))
def test_every_repair_removes_the_sign_of_its_fault(fault: str) -> None:
    assert whole_again(fault)


def test_every_fault_has_its_remedy_but_a_cracked_bat() -> None:
    assert {name for name in detectable() if remedy_of(name) is None} == NO_REMEDY
    sheets = action_table().actions
    for sheet in repairs().values():
        assert set(sheet.mends) <= set(detectable())
        assert set(sheet.again) <= sheets.keys()


def test_a_needless_repair_says_so_and_costs_time() -> None:
    sound, broken = (
        play_actions(apparatus(*faults), [action_of("tighten-coupling")])
        for faults in ((), ("encoder-slip",))
    )
    assert sound.events[0].shown[0] == ("repair", "nothing was broken", "")
    assert broken.events[0].shown[0] == ("repair", "repaired", "")
    assert sound.seconds == broken.seconds == repairs()["tighten-coupling"].minutes > 0


def test_a_repaired_laboratory_draws_as_a_sound_one() -> None:
    """The same shot of the same ball, to the last count; the records before it are others."""
    mended = asked([PLAIN[0], ("tighten-coupling", {}), *PLAIN[1:]])
    one = play_actions(apparatus("encoder-slip"), mended)
    other = play_actions(apparatus(), asked(PLAIN))
    first, second = (
        [event.records for event in day.events if event.records] for day in (one, other)
    )
    assert first == second


def test_a_day_with_a_fault_ends_in_a_right_verdict() -> None:
    """An expert notes it, mends it, rejects the shots before and fires again."""
    day = run_operator(apparatus("gate-misses"), operator_of("expert"))
    done = [event.action for event in day.events]
    assert done.index("note-doubt") < done.index("align-gates") < done.index("reduce")
    before = day.decisions[0]
    assert not before.accepted
    assert "before the repair" in before.because
    assert day.verdict == "PASS"
