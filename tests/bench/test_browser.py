"""The page in a real browser: whole days, by keyboard alone, and what axe-core finds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.bench.browsing import FOCUSED, enter, faults_of, opened, served
from virtual_lab.bench.serving import ServedDay

WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 390, "height": 844}
LOOKS = [(WIDE, "light"), (NARROW, "dark"), (WIDE, "dark"), (NARROW, "light")]
Visit = Callable[..., tuple[ServedDay, Any]]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with opened() as browser:
        yield browser


@pytest.fixture
def visit(browser: Any, tmp_path: Path) -> Iterator[Visit]:
    """Serve a day and open its page; what a page complains of fails the test."""
    from contextlib import ExitStack

    complaints: list[str] = []
    with ExitStack() as stack:

        def visited(scenario: str = "plain-day", **look: Any) -> tuple[ServedDay, Any]:
            day, address = stack.enter_context(served(tmp_path / "day", scenario))
            context = browser.new_context(**{"viewport": WIDE, **look})
            context.set_default_timeout(10_000)
            stack.callback(context.close)
            page = context.new_page()
            page.on("pageerror", lambda fault: complaints.append(str(fault)))
            page.on(
                "console", lambda line: complaints.append(line.text) if line.type == "error" else 0
            )
            page.goto(address)
            return day, page

        yield visited
    assert [each for each in complaints if "422" not in each and "409" not in each] == []


def names(day: ServedDay) -> list[str]:
    return [event.action for event in day.kept.day.events]


def test_a_day_by_the_book_is_one_key(visit: Visit) -> None:
    """Enter on what has the focus: the page leads through the procedure, and each hit is judged."""
    day, page = visit()
    pressed, focus = 0, "Tare the scale"
    while focus != "debrief":
        if focus == "Give the verdict":
            page.get_by_label("verdict").first.select_option("PASS")
            page.get_by_role("button", name="Give the verdict").first.focus()
        focus = enter(page)
        pressed += 1
    assert pressed <= 60
    assert day.kept.day.verdict == "PASS"
    assert [chosen.accepted for chosen in day.kept.day.decisions.values()].count(True) == 6
    assert not day.kept.day.decisions[1].accepted  # the slow one
    assert "As it really was" in page.inner_text("#shot")
    page.keyboard.press("Enter")
    page.wait_for_url("**/debrief")
    assert "Verdict given: PASS" in page.inner_text("main")


def test_a_fault_is_found(visit: Visit) -> None:
    """Tuesday: a gate stands elsewhere; who gauges it sees so, reduces with it and says so."""
    day, page = visit("tuesday")
    page.locator("#rig summary").click()
    page.get_by_role("button", name="Gauge the gate distances").click()
    shown = page.inner_text("#display")
    assert "gate 2, gauged" in shown
    page.get_by_label("reduce with").select_option("gauge")
    page.get_by_role("button", name="Gauge the gate distances").click()
    page.locator("#notebook > summary").click()
    page.get_by_label("what is wrong").fill("gate-moved")
    page.get_by_label("how sure [%]").fill("0,9")
    page.get_by_role("button", name="Note a doubt").click()
    assert names(day) == ["gauge-gates", "gauge-gates", "note-doubt"]
    assert day.kept.day.events[-1].arguments == {"doubt": "gate-moved", "confidence": 0.9}
    page.locator("#result > summary").click()
    page.get_by_label("verdict").select_option("INVALID")
    page.get_by_role("button", name="Give the verdict").click()
    page.get_by_role("button", name="Hand the day in").click()
    page.get_by_role("link", name="debrief").click()
    assert "named it" in page.inner_text("main")


def test_a_careless_day_is_kept_whole(visit: Visit) -> None:
    """Double clicks, the way back, two tabs, a shot before anything is measured: no entry twice."""
    day, page = visit()
    page.get_by_role("button", name="Tare the scale").first.dblclick()
    page.wait_for_selector("#display dl, #display p:has-text('Done')")
    assert names(day) == ["tare"]
    other = page.context.new_page()
    other.goto(page.url)
    page.get_by_role("button", name="Weigh the bat").first.click()
    other.get_by_role("button", name="Weigh the bat").first.click()
    assert "entry 3 is next" in other.inner_text("[role=alert]")
    other.reload()
    page.go_back()
    page.get_by_role("button", name="Tap the bat").click()
    page.locator("#rig summary").click()
    page.locator("#rig").get_by_role("button", name="Load, make ready and fire").click()
    assert "is not known yet" in page.inner_text("[role=alert]")
    page.locator("#set-place-place").fill("1e99")
    page.locator("#set-place-place").press("Enter")
    assert "allowed: numbers from 0 to 1500" in page.inner_text("[role=alert]")
    assert page.evaluate("document.activeElement.id") == "set-place-place"
    assert page.input_value("#set-place-place") == "1e99"
    assert names(day) == ["tare", "weigh-bat", "tap-bat"]
    page.get_by_role("button", name="Fire at the bat").click()
    assert "load-ball comes first" in page.inner_text("[role=alert]")


def test_a_phone_and_a_keyboard_are_enough(visit: Visit) -> None:
    """390 px, reduced motion, no pointer: a day whose hits are fired and judged in one go."""
    day, page = visit(viewport=NARROW, reduced_motion="reduce", color_scheme="dark")
    focus = "Tare the scale"
    while focus != "Load, make ready and fire":
        focus = enter(page)
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") == 0
    for key in ("Tab", "5"):  # how many balls
        page.keyboard.press(key)
    for key in ("Tab", "Tab", " "):  # stop at the first oddity; accept what is within
        page.keyboard.press(key)
    focus = enter(page)
    assert focus == "Reject 2"
    assert page.is_hidden(".play")
    to_controls(page, "moment")
    before = page.get_attribute(".bat", "transform")
    page.keyboard.press("End")
    assert page.get_attribute(".bat", "transform") != before
    to_controls(page, "cursor")
    page.keyboard.press("PageUp")
    assert "counts" in page.get_attribute("#cursor", "aria-valuetext")
    page.reload()
    focus = enter(page)
    while focus == "Load, make ready and fire" or focus.startswith("Accept"):
        focus = enter(page)
    assert focus == "Reduce the hits"
    focus = enter(page)
    page.keyboard.press("Tab")
    page.keyboard.press("P")
    page.keyboard.press("Shift+Tab")
    enter(page)
    assert enter(page) == "debrief"
    assert day.kept.day.handed_in


def to_controls(page: Any, name: str) -> None:
    """Tab on until a control has the focus."""
    for _ in range(80):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == name:
            return
    raise AssertionError(f"no way by keyboard to {name}")


@pytest.mark.parametrize(
    "every", [False, pytest.param(True, marks=pytest.mark.long)], ids=["in-turn", "every-look"]
)
def test_axe_finds_nothing_on_any_state(visit: Visit, every: bool) -> None:
    """Empty, refused, fired, handed in; notebook, debrief, certificate, a page that says no.

    Each state in one look after the other; the long test takes each in all four.
    """
    _, page = visit()
    found: dict[str, list[str]] = {}
    texts: dict[str, str] = {}
    states: list[str] = []

    def look(state: str) -> None:
        states.append(state)
        for size, theme in LOOKS if every else LOOKS[len(states) % 2 :: 2][:1]:
            page.set_viewport_size(size)
            page.emulate_media(color_scheme=theme)
            if faults := faults_of(page):
                found[f"{state}, {size['width']} px, {theme}"] = faults

    def press(name: str) -> None:
        page.get_by_role("button", name=name).first.click()

    look("empty")
    page.goto(page.url + "debrief")
    look("not yet")
    page.go_back()
    page.locator("#swing-amplitude").fill("<script>")
    press("Swing the bat")
    look("refused")
    page.goto(page.url.removesuffix("do"))
    for _ in range(12):
        page.wait_for_function(FOCUSED)
        enter(page)
    press("Load, make ready and fire")
    page.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")
    look("fired")
    page.get_by_label("how many balls").first.fill("9")
    press("Accept 1")
    page.get_by_label("how many balls").first.fill("9")
    page.get_by_label("stop at the first oddity").first.uncheck()
    page.get_by_label("accept what is within").first.check()
    press("Load, make ready and fire")
    press("Reject")
    press("Reduce the hits")
    look("reduced")
    page.get_by_label("verdict").first.select_option("PASS")
    press("Give the verdict")
    press("Hand the day in")
    look("handed in")
    page.goto(page.url + "notebook")
    look("notebook")
    for name in ("debrief", "certificate"):  # nothing runs in these, so their text is looked at
        texts[name] = page.context.request.get(page.url.replace("notebook", name)).text()
    page.goto("about:blank")
    for name, text in texts.items():
        page.set_content(text)
        look(name)
    assert found == {}


def test_without_its_script_the_page_does_the_same(visit: Visit) -> None:
    day, page = visit(java_script_enabled=False)
    page.get_by_role("button", name="Tare the scale").first.click()
    page.get_by_role("button", name="Weigh the bat").first.click()
    assert names(day) == ["tare", "weigh-bat"]
    assert "reading 1" in page.inner_text("#display")
