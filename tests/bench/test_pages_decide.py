"""Faults are found from the text of the pages alone, and none is found on a sound day."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from tests.bench.inspector import faults_on, margins
from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.operators import PREPARATION, Look
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.day.table import MAKE_READY, detectable
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.keeping import laboratory_of, taken
from virtual_lab.bench.pages.page import day_page
from virtual_lab.errors import InputError

CHECKS = (
    "weigh-check-mass",
    "reweigh-balls",
    "swing-clamp",
    "tap-bat",
    "fire-check-ball",
    "gauge-gates",
    "measure-pivot",
    "compare-clock",
    "fire-check-cylinder",
)
SHOTS = {"plain-day": 6, "college-day": 10}
NO_ENCODER = {  # at the BBCOR rig, which has none
    "bat-not-at-rest",
    "bearing-friction",
    "encoder-half-counts",
    "encoder-play",
    "encoder-slip",
}
EACH = [
    (scenario, fault)
    for scenario in SHOTS
    for fault in detectable()
    if scenario == "plain-day" or fault not in NO_ENCODER
]
FEW = (3, 11)  # of EACH, taken in the suite beside the sound days
LEAST_LIMIT, LEAST_FAULT = 4.0, 6.5  # u; limits are printed to two digits of u
ROUNDED = 0.95


def looker(shots: int) -> object:
    """Return who makes every check and fires some balls, whatever is shown."""

    def taken_so(look: Look) -> Iterator[Action]:
        yield from map(action_of, (*PREPARATION, *CHECKS))
        for shot in range(shots):
            place = None if look().missing else look().next_place
            yield action_of("set-place", {"place": round((place or 0.163) * 1e3, 3)})
            yield action_of("load-ball", {"ball": shot % 12 + 1})
            yield from map(action_of, (*MAKE_READY, "fire"))
        yield from map(action_of, ("tap-bat", "recheck-balls"))

    return taken_so


def page_of(scenario: str, fault: str | None, seed: int) -> str:
    today = replace(load_scenario(scenario).spec, faults=(fault,) if fault else ())
    machines = Apparatus(laboratory_of(today, seed, b""))
    day = taken(machines, looker(SHOTS[scenario]))  # type: ignore[arg-type]
    return day_page(Desk(day), today.briefing())


def check(scenario: str, fault: str, seeds: range) -> int:
    """Return on how many days a page shows a fault, each time far enough off."""
    found = 0
    for seed in seeds:
        page = page_of(scenario, fault, seed)
        found += fault in faults_on(page)
        beyond = [off for of, limit, off in margins(page) if of == fault and off > limit]
        assert all(off >= LEAST_FAULT * ROUNDED for off in beyond), (fault, seed, beyond)
    return found


@pytest.mark.parametrize("seed", [101, 102, 103])
def test_a_sound_page_shows_no_fault_and_its_limits_are_far(seed: int) -> None:
    page = page_of("plain-day", None, seed)
    assert faults_on(page) == set()
    assert min(limit for _, limit, _ in margins(page)) >= LEAST_LIMIT * ROUNDED


@pytest.mark.parametrize(("scenario", "fault"), [EACH[at] for at in range(*FEW)])
def test_a_page_shows_a_fault(scenario: str, fault: str) -> None:
    assert check(scenario, fault, range(200, 201)) == 1


@pytest.mark.long
@pytest.mark.parametrize(("scenario", "fault"), EACH)
def test_pages_show_each_fault_on_97_of_100_days(scenario: str, fault: str) -> None:
    assert check(scenario, fault, range(200, 300)) >= 97


@pytest.mark.long
@pytest.mark.parametrize("scenario", SHOTS)
def test_sound_pages_alarm_on_3_of_300_days_at_the_most(scenario: str) -> None:
    alarms = sum(bool(faults_on(page_of(scenario, None, seed))) for seed in range(1000, 1300))
    assert alarms <= 3


@pytest.mark.parametrize("fault", sorted(NO_ENCODER))
def test_a_rig_without_an_encoder_has_none_of_its_faults(fault: str) -> None:
    with pytest.raises(InputError, match="it befalls astm-pivot"):
        page_of("college-day", fault, 1)
