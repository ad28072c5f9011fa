"""Nothing that is sent, and nothing in the log, knows more than the records so far."""

import base64
import hashlib
import json
import re
import shutil
import struct
from collections.abc import Iterable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from tests.bench.days import PLAIN, asked
from tests.bench.test_web import Browser
from virtual_lab.bench.day.actions import action_of
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.bench.machines.stored_day import LOG, SECRET

PAGES = (
    "/",
    "/notebook",
    "/replay",
    "/rules",
    "/progress",
    "/instruments",
    "/film",
    "/base.css",
    "/bench.css",
    "/bench.js",
    "/certificate",
    "/debrief",
    "/nowhere",
)
SENT, RAW = 6, 12  # significant digits: of what is shown, of raw records
DECIMAL = re.compile(rb"\d[\d.]*\d")
CHECKS = (
    ("tap-bat", {}),
    ("swing-clamp", {}),
    ("gauge-gates", {}),
    ("measure-pivot", {}),
    ("compare-clock", {}),
    ("fire-check-cylinder", {}),
)
AGAIN = (("reweigh-balls", {}), ("recheck-balls", {}))


def scenario_of(folder: Path, *faults: str) -> Any:
    """Return the plain day with faults of its own."""
    path = folder / f"{'-'.join(faults) or 'sound'}.toml"
    given = f"faults = {json.dumps(faults)}\nprocedure ="
    path.write_text(load_scenario("plain-day").text.replace("procedure =", given), "utf-8")
    return load_scenario(str(path))


def begun(folder: Path, name: str, *faults: str, seed: int = 3) -> ServedDay:
    room = ServedDay(folder / name, scenario_of(folder, *faults), seed)
    room.open()
    return room


def opened(room: ServedDay) -> Browser:
    browser = Browser(room)
    browser.open()
    return browser


def everything(browser: Browser) -> Iterator[str]:
    """Yield every answer to who looks at all addresses and sends what is refused."""
    for path in PAGES:
        browser.rest()
        answer = browser.ask(path)
        yield f"{path} {answer.status} {answer.headers} {answer.text}"
    for name, given in (("load-ball", {"ball": 99}), ("swing", {"swings": "x"}), ("sing", {})):
        answer = browser.do(name, **given)
        yield f"{name} {answer.status} {answer.headers} {answer.text}"


def test_another_truth_behind_the_same_records_leaves_pages_unchanged(tmp_path: Path) -> None:
    """Seed, salt, faults and all that was drawn exchanged; log and commitment as they were."""
    room = begun(tmp_path, "one")
    for action in asked([*CHECKS, *PLAIN[:26]]):
        room.do(action)
    begun(tmp_path, "other", "bat-cracked", "scale-not-tared", seed=77)
    shutil.copy(tmp_path / "one" / LOG, tmp_path / "other" / LOG)
    assert (tmp_path / "one" / SECRET).read_bytes() != (tmp_path / "other" / SECRET).read_bytes()
    browsers = [opened(begun(tmp_path, name)) for name in ("one", "other")]
    assert list(everything(browsers[0])) == list(everything(browsers[1]))
    for browser in browsers:  # what needs no machine
        browser.do("accept-within")
        browser.do("note-doubt", doubt="bat-cracked", confidence="50")
        browser.do("enter-result", e_A="0,2")
        browser.do("give-verdict", verdict="INVALID")
    assert list(everything(browsers[0])) == list(everything(browsers[1]))
    logs = [(tmp_path / name / LOG) for name in ("one", "other")]
    assert logs[0].read_bytes() == logs[1].read_bytes()


def test_a_fault_without_a_sign_changes_no_page(tmp_path: Path) -> None:
    """Up to the first shot a bat that cracks is a sound one."""
    pages = []
    for name, faults in (("sound", ()), ("cracked", ("bat-cracked",))):
        room = begun(tmp_path, name, *faults)
        browser = opened(room)
        for each, given in (*PLAIN[:12], *CHECKS):
            browser.do(each, **given)
        pages.append(
            [text.replace(room.briefing["commitment"], "") for text in everything(browser)]
        )
    assert pages[0] == pages[1]


def digits(text: bytes, figures: int) -> set[bytes]:
    """Return the first significant digits of every decimal that has so many of them."""
    found = (each.replace(b".", b"").lstrip(b"0") for each in DECIMAL.findall(text))
    return {each[:figures] for each in found if len(each) >= figures}


def leaks(sent: bytes, canaries: Iterable[float], figures: int) -> set[float]:
    """Return the numbers that stand in `sent`: as a decimal, bytes, base64 or a hash of one."""
    seen = digits(sent, figures)
    found = set()
    for value in canaries:
        exact = f"{abs(value):.{figures + 3}e}".split("e")[0].replace(".", "")
        words = [exact[:figures].encode(), f"{int(exact[: figures + 1]) / 10:.0f}".encode()]
        forms = [struct.pack(order + "d", value) for order in "<>"]
        texts = [*forms, repr(value).encode()]
        forms += [base64.b64encode(each).rstrip(b"=")[:10] for each in texts]
        forms += [hashlib.new(kind, each).hexdigest().encode() for each in texts for kind in HASHES]
        if seen & set(words) or any(form in sent for form in forms):
            found.add(value)
    return found


SEEN = ("hit-wall", "fire-check-cylinder", "reduce")
HASHES = ("sha256", "sha1", "md5")


def truths(document: Any) -> Iterator[float]:
    """Yield the numbers of a sealed truth that have more digits than a data sheet's."""
    if isinstance(document, dict):
        for value in document.values():
            yield from truths(value)
    elif isinstance(document, list | tuple):
        for value in document:
            yield from truths(value)
    elif isinstance(document, float) and float(f"{document:.8g}") != document:
        yield document


@pytest.mark.parametrize("form", ["0.27182818", "27.1828182", "<d", ">d", "base64", "sha256"])
def test_a_planted_secret_is_detected(form: str) -> None:
    canary = 0.2718281828459045
    planted = {
        "<d": struct.pack("<d", canary),
        ">d": struct.pack(">d", canary),
        "base64": base64.b64encode(struct.pack("<d", canary)),
        "sha256": hashlib.sha256(repr(canary).encode()).hexdigest().encode(),
    }.get(form, form.encode())
    assert leaks(b"<p>e " + planted + b" </p>", [canary], SENT) == {canary}
    assert leaks(b"<p>0.271 8281</p>", [canary], SENT) == set()


def test_no_canary_of_the_truth_is_sent_or_logged(tmp_path: Path) -> None:
    """All that was drawn has random digits; none of them is in an answer, nor in the log."""
    room = begun(tmp_path, "day", "gate-moved", "bat-cracked")
    browser = opened(room)
    sent = []
    for name, given in (*CHECKS, *PLAIN, *CHECKS, *AGAIN, ("reduce", {})):
        room.do(action_of(name, given))
        if name in SEEN:
            sent += everything(browser)
    browser.do("give-verdict", verdict="PASS")
    sent.append(browser.ask("/").text)
    secret = room.stored.apparatus.finish(room.stored.desk).sealed.document()
    known = {known.value for known in room.desk.session.calibration.values()}
    parts = ("bat_properties", "balls", "constants", "measurand", "shots", "wall_hits")
    canaries = set(truths({key: secret[key] for key in parts})) - known
    nominal = {key: value for key, value in secret["balls"]["spec"].items() if key != "radius"}
    canaries -= set(truths(nominal))
    assert len(canaries) > 200
    assert leaks("".join(sent).encode(), canaries, SENT) == set()
    log = (tmp_path / "day" / LOG).read_bytes()
    assert leaks(log, canaries, RAW) == set()
    entries = json.dumps([[dict(e.arguments), e.shown] for e in room.stored.log.events()])
    assert leaks(entries.encode(), canaries, SENT) == set()


class Elements(HTMLParser):
    """What a page is made of, without its words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: set[tuple[str, ...]] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        kept = ("id", "name", "href", "src", "action", "class")
        self.found.add((tag, *(f"{key}={value}" if key in kept else key for key, value in attrs)))


def test_sound_decoy_and_fault_days_have_the_same_elements(tmp_path: Path) -> None:
    """A decoy is a dry bearing, which does nothing to a result."""
    made = []
    for faults in ((), ("bearing-friction",), ("gate-moved", "scale-not-tared")):
        room = begun(tmp_path, "day-" + "-".join(faults), *faults)
        browser, elements = opened(room), set[tuple[str, ...]]()
        for action in asked([*CHECKS, *PLAIN, ("reduce", {})]):
            room.do(action)
            if action.name in SEEN:
                browser.rest()
                elements |= Elements(browser.ask("/").text).found
        # whether a reading is within its limit the records alone decide
        elements -= {("strong", "class=off"), ("strong", "class=sound")}
        made.append((elements, len(browser.ask("/bench.css").text)))
    assert made[0] == made[1] == made[2]
