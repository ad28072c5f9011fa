"""The page in a real browser: whole days, by keyboard alone, and what axe-core finds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.bench.browsing import FOCUSED, enter, faults_of, opened, served
from tests.bench.days import PLAIN, Asked, asked
from virtual_lab.bench.day.table import preparation
from virtual_lab.bench.entrance.served_day import ServedDay

WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 390, "height": 844}
LOW = {"width": 1280, "height": 800}
LOOKS = [(WIDE, "light"), (NARROW, "dark"), (WIDE, "dark"), (NARROW, "light")]
Visit = Callable[..., tuple[ServedDay, Any]]
LOADED = """async () => {
  const loaded = new DOMParser().parseFromString(await (await fetch('/')).text(), 'text/html');
  const text = page => ['title', 'header', 'main', 'nav'].map(each => {
    const part = page.querySelector(each).cloneNode(true);
    part.querySelectorAll('output').forEach(output => output.remove());
    const hidden = [...part.querySelectorAll('input[type=hidden], [autofocus]')];
    return part.textContent.replace(/\\s+/g, '') + hidden.map(each => each.outerHTML).join();
  });
  return text(document).join() === text(loaded).join();
}"""  # whether a page is what it would be if it were loaded now


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

        def visited(
            scenario: str = "plain-day",
            trainer: str = "",
            faults: tuple[str, ...] = (),
            **look: Any,
        ) -> tuple[ServedDay, Any]:
            day, address = stack.enter_context(served(tmp_path / "day", scenario, trainer, faults))
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
    expected = ("status of 422", "status of 409", "status of 403")
    assert [each for each in complaints if not any(words in each for words in expected)] == []


def press(page: Any, name: str) -> None:
    """Click the first button of a name, and wait for the page after it."""
    with page.expect_navigation():
        page.get_by_role("button", name=name).first.click()


def names(day: ServedDay) -> list[str]:
    return [event.action for event in day.stored.day.events]


def test_the_enter_key_alone_plays_a_day_by_the_book(visit: Visit) -> None:
    """Enter on what has the focus: the page leads through the hits, and each is judged alone."""
    day, page = visit()
    do(day, *PLAIN[: len(preparation())])
    page.reload()
    pressed, focus = len(preparation()), ""
    while focus != "debrief":
        if focus == "Give the verdict":
            page.get_by_label("verdict").first.select_option("PASS")
            page.get_by_role("button", name="Give the verdict").first.focus()
        focus = enter(page)
        pressed += 1
        refused_or_opened = "Not done" in page.title() or focus == "debrief"
        assert refused_or_opened or page.evaluate(LOADED)
    assert pressed <= 60
    assert day.stored.day.verdict == "PASS"
    assert [chosen.accepted for chosen in day.stored.day.decisions.values()].count(True) == 6
    assert not day.stored.day.decisions[1].accepted  # the slow one
    assert "Top view of the true motion" in page.inner_text("#shot")
    page.keyboard.press("Enter")
    page.wait_for_selector("text=Your verdict: PASS", timeout=60_000)  # it may be made first


def test_a_fault_is_found(visit: Visit) -> None:
    """Tuesday: a gate stands elsewhere; who gauges it sees so, reduces with it and says so."""
    day, page = visit("tuesday", faults=("gate-moved",))
    page.locator("#rig > summary").click()
    press(page, "Measure the distances of the gates")
    shown = page.inner_text("#display")
    assert "gate 2, gauged" in shown
    page.get_by_label("distances to use").select_option("gauge")
    press(page, "Measure the distances of the gates")
    page.locator("#notebook > summary").click()
    page.get_by_label("fault", exact=True).fill("A gate moved after its survey")
    page.get_by_label("confidence [%]").first.fill("0,9")
    press(page, "Note a suspected fault")
    assert names(day) == ["gauge-gates", "gauge-gates", "note-doubt"]
    assert day.stored.day.events[-1].arguments == {"doubt": "gate-moved", "confidence": 0.9}
    page.locator("#result > summary").click()
    page.get_by_label("verdict").select_option("INVALID")
    press(page, "Give the verdict")
    press(page, "Hand in the day")
    page.get_by_role("link", name="debrief").click()
    page.wait_for_selector("text=Correct verdict", timeout=60_000)  # it may be made first
    assert "named it" in page.inner_text("main")


def test_after_a_shot_the_page_stays_where_its_pictures_are(visit: Visit) -> None:
    """Guidance off: the focus is on the decision above them, and nothing scrolls them away."""
    day, page = visit("exam-day", trainer="")
    for shot, (size, before) in enumerate(((LOW, PLAIN[:17]), (NARROW, PLAIN[18:24])), 1):
        do(day, *before)
        page.set_viewport_size(size)
        page.goto(page.url)
        with page.expect_navigation():
            page.get_by_role("button", name="Fire at the bat").press("Enter")
        assert names(day)[-1] == "fire"
        page.wait_for_selector(FOCUSED, state="attached")
        focused = page.evaluate("document.activeElement.textContent")
        assert focused.endswith(f" {shot}")  # Accept, or reject
        top = page.locator("#shot svg").first.bounding_box()["y"]
        assert page.evaluate("scrollY") < 400
        assert 0 <= top < size["height"]


def test_one_key_opens_rules_and_instruments(visit: Visit) -> None:
    day, page = visit()
    for key, heading in (("r", "The rules"), ("i", "The instruments")):
        page.wait_for_selector("body :focus", state="attached")
        with page.expect_navigation():
            page.keyboard.press(key)
        assert heading in page.inner_text("h1")
        with page.expect_navigation():
            page.keyboard.press("Escape")
    assert names(day) == []


@pytest.mark.long
def test_careless_clicks_make_no_entry_twice(visit: Visit) -> None:
    """Double clicks, a key held, the way back, two tabs, a shot too early: no entry twice."""
    day, page = visit()
    tare = page.get_by_role("button", name="Tare the scale").last
    for delay in (0, 600):  # ms; the page after the first click is there before the second
        with page.expect_navigation():
            tare.dblclick(delay=delay)
    tare.focus()
    with page.expect_navigation():
        page.keyboard.down("Enter")
    page.keyboard.down("Enter")  # held
    page.keyboard.up("Enter")
    page.wait_for_timeout(300)
    assert names(day) == ["tare"] * 3
    other = page.context.new_page()
    other.goto(page.url)
    press(page, "Weigh the bat")
    press(other, "Weigh the bat")
    assert "entry 5 is next" in other.inner_text("[role=alert]")
    other.reload()
    page.get_by_role("link", name="Rules").click()
    page.go_back()
    press(page, "Tap the bat")
    page.locator("#rig > summary").click()
    press(page, "Load, prepare and fire")
    assert "is not known yet" in page.inner_text("[role=alert]")
    page.locator("#set-place-place").fill("1e99")
    with page.expect_navigation():
        page.locator("#set-place-place").press("Enter")
    assert "allowed: numbers from 0 to 1500" in page.inner_text("[role=alert]")
    assert page.evaluate("document.activeElement.id") == "set-place-place"
    assert page.input_value("#set-place-place") == "1e99"
    assert names(day) == [*["tare"] * 3, "weigh-bat", "tap-bat"]
    press(page, "Fire at the bat")
    assert "“Load a ball” comes first" in page.inner_text("[role=alert]")


def test_a_phone_and_a_keyboard_are_enough(visit: Visit) -> None:
    """390 px, reduced motion, no pointer: a day whose hits are fired and judged in one go."""
    day, page = visit(viewport=NARROW, reduced_motion="reduce", color_scheme="dark")
    focus = "Tare the scale"
    while focus != "Load, prepare and fire":
        focus = enter(page)
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") == 0
    for key in ("Tab", "5"):  # number of balls
        page.keyboard.press(key)
    for key in ("Tab", "Tab", " "):  # stop after a shot outside; accept hits within
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
    while focus == "Load, prepare and fire" or focus.startswith("Accept"):
        focus = enter(page)
    assert focus == "Reduce the hits"
    focus = enter(page)
    page.keyboard.press("Tab")
    page.keyboard.press("P")
    page.keyboard.press("Shift+Tab")
    enter(page)
    assert enter(page) == "debrief"
    assert day.stored.day.handed_in


def to_controls(page: Any, name: str) -> None:
    """Tab on until a control has the focus."""
    for _ in range(80):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == name:
            return
    raise AssertionError(f"no way by keyboard to {name}")


class Looks:
    """Pages held against axe-core: in one look after the other, or each in every look."""

    def __init__(self, every: bool) -> None:
        self.every, self.states, self.found = every, 0, dict[str, list[str]]()

    def look(self, page: Any, state: str) -> None:
        self.states += 1
        for size, theme in LOOKS if self.every else LOOKS[self.states % len(LOOKS) :][:1]:
            page.set_viewport_size(size)
            page.emulate_media(color_scheme=theme)
            if faults := faults_of(page):
                self.found[f"{state}, {size['width']} px, {theme}"] = faults


@pytest.fixture(
    params=[False, pytest.param(True, marks=pytest.mark.long)], ids=["in-turn", "every-look"]
)
def looks(request: pytest.FixtureRequest) -> Iterator[Looks]:
    looks = Looks(request.param)
    yield looks
    assert looks.found == {}


def do(day: ServedDay, *days: Asked) -> None:
    """Do actions behind the page's back: faster than by its buttons."""
    for action in asked(days):
        day.do(action)


def open_all(page: Any) -> None:
    page.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")


def test_axe_finds_nothing_on_any_state(visit: Visit, looks: Looks) -> None:
    """All parts of the page, refused, fired, handed in; notebook, replay, debrief.

    The certificate has such a test of its own.
    """
    day, page = visit()
    home = page.url
    open_all(page)
    page.locator("#swing-amplitude").fill("<script>")
    with page.expect_navigation():
        page.get_by_role("button", name="Swing the bat").last.click()
    looks.look(page, "refused")
    do(day, *PLAIN[:18])
    page.goto(home)
    open_all(page)
    looks.look(page, "fired")
    noted = ("note-deviation", {"step": "another", "because": "two balls were wet"})
    do(day, *PLAIN[18:], noted, ("enter-result", {"BPF": 0.9}), ("reduce", {}))
    do(day, ("give-verdict", {"verdict": "PASS"}), ("hand-in", {}))
    for state, path in (("handed in", ""), ("notebook", "notebook"), ("replay", "replay")):
        page.goto(home + path)
        looks.look(page, state)
    for key, entry in (("Enter", 1), ("ArrowRight", 2), ("ArrowLeft", 1)):
        page.keyboard.press(key)
        page.wait_for_selector(f"text=Entry {entry} of")
    text = answered(page, home + "debrief")  # nothing runs in it, so its text is looked at
    page.goto("about:blank")
    page.set_content(text)
    looks.look(page, "debrief")


def answered(page: Any, address: str) -> str:
    """Return the text at an address, once it is made."""
    while (answer := page.context.request.get(address)).status == 202:
        page.wait_for_timeout(100)
    return str(answer.text())


@pytest.mark.long
def test_axe_finds_nothing_in_an_exam(visit: Visit, looks: Looks) -> None:
    """The trainee's entry and day, the trainer's page, before, during and after."""
    day, trainee = visit("exam-day", trainer="chalk")
    home = trainee.url
    trainer, stranger = (trainee.context.browser.new_page() for _ in range(2))
    trainer.goto(home + "?token=chalk")
    looks.look(trainee, "not begun")
    looks.look(trainer, "trainer, not begun")
    stranger.goto(home)
    looks.look(stranger, "entry")
    stranger.get_by_label("Your code").fill("guessed")
    stranger.keyboard.press("Enter")
    stranger.wait_for_selector("text=no such code")
    looks.look(stranger, "no such code")
    trainer.get_by_role("button", name="Begin the exam").click()
    stranger.get_by_label("Your code").fill("token")
    stranger.keyboard.press("Enter")
    stranger.wait_for_selector("#display")
    looks.look(stranger, "joined again")
    trainee.goto(home)
    assert "Your code" in trainee.inner_text("main")
    do(day, ("give-verdict", {"verdict": "INVALID"}), ("hand-in", {}))
    stranger.goto(home)
    looks.look(stranger, "handed in, an exam")
    trainer.get_by_role("link", name="Refresh").click()
    assert "handed in, joined again at" in trainer.inner_text("table")
    looks.look(trainer, "trainer, joined again")
    for page in (trainer, stranger):
        page.close()


@pytest.mark.long
def test_axe_finds_nothing_on_the_records_of_another_laboratory(visit: Visit, looks: Looks) -> None:
    _, page = visit("records")
    open_all(page)
    looks.look(page, "records")
    page.goto(page.url + "notebook")
    looks.look(page, "their notebook")


def test_without_its_script_the_page_does_the_same(visit: Visit) -> None:
    day, page = visit(java_script_enabled=False)
    page.get_by_role("button", name="Tare the scale").first.click()
    page.get_by_role("button", name="Weigh the bat").first.click()
    assert names(day) == ["tare", "weigh-bat"]
    assert "reading 1" in page.inner_text("#display")
    do(day, ("give-verdict", {"verdict": "INVALID"}), ("hand-in", {}))
    page.goto(page.url + "replay")
    for _ in range(2):
        page.get_by_role("link", name="Next").click()
    assert "reading 1" in page.inner_text("#display")
