"""A day's time by keyboard alone, by a model of keystrokes over the real page."""

from pathlib import Path

import pytest

from tests.bench.browsing import opened, served
from tests.bench.keystrokes import by_enter, by_list


@pytest.mark.long
@pytest.mark.parametrize(
    ("scenario", "take", "minutes", "actions"),
    [("plain-day", by_enter, 25, 60), ("college-day", by_list, 45, 120)],
)
def test_a_day_by_keyboard_stays_within_its_minutes_and_actions(
    tmp_path: Path, scenario: str, take, minutes: float, actions: int
) -> None:
    with served(tmp_path / "day", scenario) as (day, address), opened() as browser:
        page = browser.new_page()
        page.set_default_navigation_timeout(180_000)  # ms: in a new clone it is compiled first
        page.goto(address)
        hands = take(page, day)
        assert day.desk.day.handed_in
        print(hands.row(scenario, len(day.desk.day.fired)))
    assert hands.minutes <= minutes
    assert hands.actions <= actions
