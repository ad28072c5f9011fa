"""Faults are found from the text of the pages alone, and none is found on a sound day."""

from __future__ import annotations

import pytest

from tests.bench.inspected import (
    EACH,
    FAULTY,
    NO_ENCODER,
    SHOTS,
    SOUND,
    Inspected,
    inspected,
    page_of,
)
from tests.bench.inspector import faults_on, margins, rows
from virtual_lab.errors import InputError

FEW = (3, 10)  # of EACH, taken in the suite beside one of another rig and the sound days
LEAST_LIMIT, LEAST_FAULT = 4.0, 6.5  # u; limits are printed to two digits of u
ROUNDED = 0.95


def check(scenario: str, fault: str, days: int) -> Inspected:
    """Show an inspector some days; where readings are beyond their limits the largest is by far."""
    found = inspected(scenario, fault, range(FAULTY, FAULTY + days))
    assert not found.least_off < LEAST_FAULT * ROUNDED, found
    return found


@pytest.mark.parametrize("seed", [101, 102, 103])
def test_a_sound_page_shows_no_fault_and_its_limits_are_far(seed: int) -> None:
    page = page_of("plain-day", None, seed)
    assert faults_on(page) == set()
    assert min(limit for _, limit, _ in margins(page)) >= LEAST_LIMIT * ROUNDED


@pytest.mark.parametrize(("scenario", "fault"), [EACH[at] for at in range(*FEW)])
def test_a_page_shows_a_fault(scenario: str, fault: str) -> None:
    assert check(scenario, fault, 1).found == 1


def test_readings_beyond_their_limit_come_first() -> None:
    """One page of a rig without an encoder: nothing is asked of one, and nothing shown."""
    page = page_of("college-day", "gate-misses", FAULTY)
    within = [row[1] for row in rows(page[page.index('id="checks"') :])]
    assert len(within) > 20
    assert "beyond" in within[0]
    assert not any("beyond" in each for each in within[1:])
    assert "Blocking time, first gate / last gate" in page
    assert "Residual [counts]" not in page
    assert ">Zero the encoder</button>" not in page


@pytest.mark.long
@pytest.mark.parametrize(("scenario", "fault"), EACH)
def test_pages_show_each_fault_on_97_of_100_days(scenario: str, fault: str) -> None:
    assert check(scenario, fault, 100).found >= 97


@pytest.mark.long
@pytest.mark.parametrize("scenario", SHOTS)
def test_sound_pages_alarm_on_3_of_300_days_at_the_most(scenario: str) -> None:
    found = inspected(scenario, None, range(SOUND, SOUND + 300))
    assert found.alarms <= 3
    assert found.least_limit >= LEAST_LIMIT * ROUNDED


@pytest.mark.parametrize("fault", sorted(NO_ENCODER))
def test_a_rig_without_an_encoder_has_none_of_its_faults(fault: str) -> None:
    with pytest.raises(InputError, match="no fault of the rig"):
        page_of("college-day", fault, 1)
