"""How long a day takes by keyboard: keystrokes counted on the real page, times by a model.

The keystroke-level model of Card, Moran and Newell (1983): K for a key, M for what is thought
before each action, each field and each hit that is looked at, and R, the time until the next page
is there, measured. ``python -m tests.bench.study keyboard`` prints the table.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from tests.bench.browsing import FOCUSED
from virtual_lab.bench.day.table import action_table, preparation
from virtual_lab.bench.entrance.served_day import ServedDay

__all__ = ["K", "Keyboard", "M", "by_enter", "by_list"]

K, M = 0.28, 1.35  # s: of an average typist, and of one thought
FARTHEST = 400  # keys to a control
WHERE = """name => {
  const kinds = 'a[href], button, input:not([type=hidden]), select, summary, [tabindex="0"]';
  const all = [...document.querySelectorAll(kinds)]
    .filter(each => each.checkVisibility() && !each.classList.contains('skip'));
  const words = each => (each.labels?.[0] ?? each).textContent.trim();
  const wanted = all.findIndex(each => words(each).startsWith(name));
  return [wanted, all.indexOf(document.activeElement)];
}"""  # of all that Tab comes to: where a control is, and where the focus


@dataclass
class Keyboard:
    """What was pressed on a page, and how long its answers took."""

    page: Any
    keys: int = 0
    thoughts: int = 0
    actions: int = 0
    waited: float = 0.0  # s

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)
            self.keys += 1

    def to(self, name: str) -> None:
        """Tab to a control whose words begin so, the shorter way; it must be there."""
        for _ in range(FARTHEST):
            wanted, now = self.page.evaluate(WHERE, name)
            assert wanted >= 0, f"no way by keyboard to {name}"
            if wanted == now:
                return
            self.press("Tab" if wanted > now else "Shift+Tab")
        raise AssertionError(f"no way by keyboard to {name}")

    def open(self, part: str) -> None:
        """Open a part of the page that is closed."""
        if not self.page.evaluate(f"document.getElementById('{part}').open"):
            self.to(self.page.inner_text(f"#{part} > summary h2"))
            self.press("Enter")

    def enter(self) -> None:
        """Press what has the focus: an action."""
        self.page.wait_for_selector(FOCUSED, state="attached")
        began = time.perf_counter()
        with self.page.expect_navigation():
            self.page.keyboard.press("Enter")
        self.waited += time.perf_counter() - began
        self.keys += 1
        self.actions += 1
        self.thoughts += 1

    def do(self, name: str) -> None:
        """Do an action by its own button."""
        sheet = action_table().actions[name]
        self.open(sheet.part)
        self.to(sheet.title)
        self.enter()

    @property
    def minutes(self) -> float:
        return (self.keys * K + self.thoughts * M + self.waited) / 60

    def row(self, name: str, shots: int) -> str:
        return (
            f"{name:<12}{self.actions:>9}{shots:>7}{self.keys:>7}{self.thoughts:>10}"
            f"{self.waited:>10.1f}{self.minutes:>9.1f}"
        )


HEAD = "day           actions  shots   keys  thoughts waited, s  minutes"


def by_enter(page: Any, day: ServedDay) -> Keyboard:
    """Take a guided day: what has the focus is what comes next; each hit is judged alone."""
    hands = Keyboard(page)
    while not day.desk.day.reduced:
        hands.enter()
    _end(hands, day)
    return hands


def by_list(page: Any, day: ServedDay) -> Keyboard:
    """Take a day by the list of the procedure: as many shots at a time as there may be."""
    hands = Keyboard(page)
    for name in preparation():
        hands.do(name)
    while day.desk.next_position is not None:
        hands.open("rig")
        hands.to("number of balls")
        hands.press(*"12")
        hands.to("stop after a shot outside")
        hands.press(" ")
        hands.to("accept hits within")
        hands.press(" ")
        hands.thoughts += 1
        hands.enter()
        for shot, why in enumerate(day.desk.reasons):
            if why and shot not in day.desk.day.decisions:
                hands.to(f"Reject {shot + 1}")
                hands.enter()
    hands.do("reduce")
    _end(hands, day)
    return hands


def _end(hands: Keyboard, day: ServedDay) -> None:
    hands.thoughts += len(day.desk.day.fired) + 1  # each hit was looked at, and the result
    if not hands.page.evaluate("Boolean(document.querySelector('.next'))"):
        hands.open("result")
    hands.to("verdict")
    hands.press(day.desk.certification.verdict.value[0])
    hands.to("Give the verdict")
    hands.enter()
    hands.do("hand-in")
