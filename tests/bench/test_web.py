"""The page: who is let in, what a form does, what no answer may hold."""

import csv
import re
import threading
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest

from tests.asking import Answer, ask
from tests.bench.days import PLAIN, asked
from virtual_lab import catalog
from virtual_lab.bench.day.actions import ARGUMENTS
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.entrance.served_day import DEBRIEFS, ServedDay
from virtual_lab.bench.pages.page import day_page
from virtual_lab.bench.web import server
from virtual_lab.bench.web.server import application
from virtual_lab.files.tables import quote

SOUND = {"number": "1", "whole": "1", "text": "so", "doubt": "none"}  # by kind of argument
HOST, TOKEN = "127.0.0.1:8377", "the token of the opened address"
END = (("give-verdict", {"verdict": "INVALID"}), ("hand-in", {}))
PICTURES = re.compile(r'(<section [^>]*id="(display|shot)".*?</section>)', re.DOTALL)
ORIGIN = {"origin": f"http://{HOST}"}


class Browser:
    """Sends requests straight to a server, with the cookie that it was given."""

    def __init__(self, room: ServedDay) -> None:
        self.application = application({TOKEN: room}, hosts=frozenset({HOST}))
        self.cookie = ""
        self.day = room

    def ask(
        self,
        path: str,
        form: dict[str, Any] | None = None,
        *,
        host: str = HOST,
        body: bytes | None = None,
        headers: dict[str, str] | None = None,
        patient: bool = True,
        message: dict[str, Any] | None = None,
        method: str = "",
    ) -> Answer:
        body = urlencode(form).encode() if form is not None else body or b""
        method = method or ("GET" if form is None and not body else "POST")
        sent = {"host": host, "content-length": str(len(body)), "cookie": self.cookie}
        sent |= ORIGIN if headers is None else headers
        answer = ask(self.application, path, body, method, sent, **message or {})
        self.cookie = answer.cookie or self.cookie
        if patient and answer.status == 202:  # being made
            self.rest()
            return self.ask(path, host=host, headers=headers)
        return answer

    def open(self) -> Answer:
        return self.ask(f"/?token={TOKEN.replace(' ', '%20')}")

    def rest(self) -> None:
        """Let a second pass."""
        for seat in self.application.seats.values():
            seat.request_times.clear()

    def do(self, name: str, **given: Any) -> Answer:
        number = re.search(r'name="entry_number" value="(\d+)"', self.ask("/").text)
        assert number
        self.rest()
        return self.ask("/do", {"do": name, "entry_number": number[1], **given})


def served(folder: Path, scenario: str = "plain-day", *, is_fixed: bool = True) -> ServedDay:
    day = ServedDay(folder, load_scenario(scenario), 3, is_fixed=is_fixed)
    day.open()
    return day


@pytest.fixture
def browser(tmp_path: Path) -> Browser:
    opened = Browser(served(tmp_path / "day"))
    assert opened.open().status == 303
    return opened


def test_the_first_page_lists_the_days_and_begins_one(tmp_path: Path) -> None:
    """Until the first entry, and never where a trainer has chosen; exams are not in the list."""
    browser = Browser(served(tmp_path / "day", is_fixed=False))
    browser.open()
    names = set(re.findall(r'name="scenario" value="([\w-]+)"', browser.ask("/").text))
    assert names == set(catalog.names("bench/scenarios")) - {"exam-day"}
    assert browser.ask("/begin", {"scenario": "exam-day"}).status == 422
    assert browser.ask("/begin", {"scenario": "college-friday"}).status == 303
    page = browser.ask("/").text
    assert "A college Friday" in re.search("<h1>(.*?)</h1>", page)[1]
    assert ">Zero the encoder</button>" not in page  # its rig has none
    assert [each.name for each in tmp_path.iterdir()] == ["day"]  # nothing is left of the other
    assert 'name="scenario"' in page
    browser.do("tare")
    assert 'name="scenario"' not in browser.ask("/").text
    assert browser.ask("/begin", {"scenario": "tuesday"}).status == 422
    trainee = Browser(served(tmp_path / "trainee"))
    trainee.open()
    assert 'name="scenario"' not in trainee.ask("/").text
    assert trainee.ask("/begin", {"scenario": "tuesday"}).status == 422


def test_a_debrief_in_the_making_delays_no_other_day(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "PATIENCE", 0.05)
    other, held = Browser(served(tmp_path / "other")), threading.Event()
    other.open()
    browser.do("give-verdict", verdict="INVALID")
    try:
        DEBRIEFS.do(held.wait)  # another's
        browser.do("hand-in")
        waiting = browser.ask("/debrief", patient=False)
        assert (waiting.status, waiting.headers["refresh"]) == (202, "1")
        assert "reloads automatically. Debriefs before yours: 1." in waiting.text
        assert other.do("tare").status == 303
    finally:
        held.set()
    browser.rest()
    assert "Your verdict" in browser.ask("/debrief").text


def test_the_address_works_once_and_then_only_the_cookie(tmp_path: Path) -> None:
    first = Browser(served(tmp_path / "day"))
    assert first.ask("/").status == 403
    assert first.ask("/?token=guessed").status == 403
    address = f"/?token={TOKEN.replace(' ', '%20')}"
    for look in ({"method": "HEAD"}, {"headers": {"sec-purpose": "prefetch;prerender"}}):
        assert first.ask(address, **look).status == 403  # no one has opened it yet
    opened = first.open()
    assert opened.status == 303
    assert "HttpOnly" in opened.headers["set-cookie"]
    assert "SameSite=strict" in opened.headers["set-cookie"]
    assert first.ask("/").status == 200
    first.cookie = ""
    assert first.open().status == 403


@pytest.mark.parametrize(
    ("given", "status"),
    [
        ({"host": "evil.example"}, 403),
        ({"headers": {}}, 403),
        ({"headers": {"origin": "http://evil.example"}}, 403),
        ({"headers": {"origin": "null"}}, 403),
        ({"body": b"x" * 65537}, 413),
        ({"headers": ORIGIN | {"transfer-encoding": "chunked"}}, 411),
    ],
)
def test_a_request_from_elsewhere_is_refused(
    browser: Browser, given: dict[str, Any], status: int
) -> None:
    form = None if "body" in given else {"do": "tare", "entry_number": "1"}
    assert browser.ask("/do", form, **given).status == status
    assert "Your readings will appear here" in browser.ask("/").text


def test_a_browser_that_hangs_up_causes_no_error(browser: Browser) -> None:
    """It leaves in the middle of its form: no traceback on the terminal, and nothing was done."""
    gone = {"type": "http.disconnect"}
    browser.ask("/do", {"do": "tare", "entry_number": "1"}, message=gone)
    assert "Your readings will appear here" in browser.ask("/").text


def test_too_many_requests_are_refused_for_a_second(browser: Browser) -> None:
    assert [browser.ask("/bench.css").status for _ in range(25)].count(429) >= 4


@pytest.mark.parametrize("path", ["/", "/base.css", "/nowhere", "/certificate", "/debrief"])
def test_every_answer_has_the_security_headers(browser: Browser, path: str) -> None:
    for host in (HOST, "evil.example"):
        headers = browser.ask(path, host=host).headers
        assert headers["x-content-type-options"] == "nosniff"
        if path != "/base.css" or host != HOST:
            assert headers["cache-control"] == "no-store"
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'self'; base-uri 'none'; form-action 'self'")
        assert "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy


def test_a_reason_is_in_the_display_and_the_verdicts_are_explained(browser: Browser) -> None:
    """The display stays in sight where the focus goes; the seal is named until the hand-in."""
    answer = browser.do("give-verdict", verdict="")
    display = answer.text[answer.text.index('id="display"') :].partition("</section>")[0]
    assert 'role="alert"' in display
    assert "is missing; allowed: PASS, FAIL, INVALID, MEASURED" in display
    form = answer.text[answer.text.index('value="give-verdict"') :].partition("</form>")[0]
    assert "MEASURED: the rules set no limit" in form
    assert "The truth of this day is sealed" in answer.text
    browser.do("give-verdict", verdict="INVALID")
    browser.do("hand-in")
    assert "The truth of this day is sealed" not in browser.ask("/").text


def test_after_a_verdict_without_a_reduction_the_hand_in_is_next(browser: Browser) -> None:
    for action in asked([*PLAIN, ("give-verdict", {"verdict": "INVALID"})]):
        browser.day.stored.do(action)
    step = re.search('aria-current="step">(.*?)</li>', browser.ask("/").text)
    assert step
    assert ">Hand in the day<" in step[1]


def test_forms_alone_play_a_day_to_its_debrief(browser: Browser) -> None:
    """Nineteen buttons from the morning to the debrief."""
    assert browser.ask("/debrief").status == browser.ask("/certificate").status == 409
    for name, given in PLAIN[:12]:
        assert browser.do(name, **given).status == 303
    assert browser.do("fire-shots", shots=6).status == 303
    assert browser.do("accept-within").status == 303
    stopped = browser.do("fire-shots", shots=3, stop="yes")
    assert stopped.headers["location"] == "/"
    assert browser.do("accept-within").status == 303
    assert browser.ask("/").text.count("✓ accepted</strong>") >= 6
    assert browser.do("reduce").status == 303
    early = browser.ask("/certificate")
    assert early.status == 409
    assert "“Give the verdict” comes first, so that your verdict precedes the program" in early.text
    assert browser.ask("/debrief").status == 409
    assert browser.do("give-verdict", verdict="PASS").status == 303
    certificate = browser.ask("/certificate")
    assert "sandbox" in certificate.headers["content-security-policy"]
    assert "SIMULATED" in certificate.text
    assert browser.do("hand-in").status == 303
    DEBRIEFS.do(int).result()
    assert (browser.day.folder / "debrief.html").exists()  # also if nobody opens it
    assert "Debrief" in browser.ask("/debrief").text
    assert "in_book" not in browser.ask("/").text


def test_fire_stops_at_the_first_hit_that_the_windows_reject(browser: Browser) -> None:
    """Of seed 3 it is the second."""
    for name, given in PLAIN[:12]:
        browser.do(name, **given)
    browser.do("fire-shots", shots=6, stop="yes")
    assert browser.ask("/").text.count('href="/?shot=') == 2


def test_a_form_sent_twice_makes_one_entry(browser: Browser) -> None:
    form = {"do": "tare", "entry_number": "1"}
    assert browser.ask("/do", form).status == 303
    again = browser.ask("/do", form)
    assert again.status == 422
    assert "entry 2 is next" in again.text
    assert again.text.count("✓ done") == 1


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("swing", {"amplitude": "1e99"}, "allowed: numbers from 0.5 to 45 deg"),
        ("swing", {"amplitude": "<script>"}, "allowed: numbers"),
        ("set-place", {"place": "-1"}, "allowed: numbers from 0 to 1500"),
        ("set-place", {"place": "163 furlong"}, "allowed: numbers from 0 to 1500 mm"),
        ("sing", {}, "allowed: tare"),
        ("fire-shots", {"shots": "1000"}, "allowed: 1 to 12"),
        ("fire-shots", {"shots": "1"}, "is not known yet"),
        ("fire", {}, "“Load a ball” comes first"),
    ],
)
def test_bad_input_is_answered_in_words_and_the_day_is_whole(
    browser: Browser, name: str, given: dict[str, Any], message: str
) -> None:
    answer = browser.do(name, **given)
    assert answer.status == 422
    assert message in answer.text
    assert "<script>" not in answer.text
    assert "Your readings will appear here" in answer.text


class Form(HTMLParser):
    """Which controls a page has, what labels name them, and what is not allowed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.labelled: set[str] = set()
        self.forbidden: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag in {"input", "select"} and given.get("type") != "hidden":
            self.ids.append(given.get("id") or "")
        if tag == "label":
            self.labelled.add(given.get("for") or "")
        self.forbidden += [key for key in given if key.startswith("on") or key == "style"]
        runs = tag == "script" and given.get("src") != "/bench.js"
        self.forbidden += [tag] if runs or tag == "style" else []


def test_every_control_has_a_label_and_only_one_script_runs(browser: Browser) -> None:
    for name, given in PLAIN[:12]:
        browser.do(name, **given)
    browser.do("fire-shots", shots=2)
    page = Form(browser.ask("/").text)
    assert len(page.ids) == len(set(page.ids)) > 20
    assert set(page.ids) == page.labelled
    assert page.forbidden == []


def test_what_is_typed_is_escaped(browser: Browser) -> None:
    browser.do("note-deviation", because="<img src=x onerror=alert(1)>")
    assert "<img" not in browser.ask("/").text
    assert "&lt;img" in browser.ask("/").text


BAD = ("", "x" * 301, "1e99", "-7", "nan", "0,5 furlong", "<script>alert(1)</script>", "\x00")


def test_bad_input_in_every_field_leaves_the_day_whole(browser: Browser) -> None:
    """Each field of each action: refused with its name, or an entry; never half of one."""
    number = 1  # number of the next entry
    for action, arguments in ARGUMENTS.items():
        sound = {each.name: SOUND.get(each.kind) or each.choices[0] for each in arguments}
        for argument in arguments:
            for bad in BAD:
                browser.rest()
                form = {"do": action, "entry_number": number, **sound, argument.name: bad}
                answer = browser.ask("/do", form)
                if answer.status == 303:
                    number += 1
                    answer = browser.ask("/")
                    assert answer.status == 200
                else:
                    assert answer.status == 422
                    assert 'role="alert"' in answer.text
                assert len(browser.day.stored.day.events) == number - 1
                assert "<script>alert" not in answer.text


def test_requests_that_no_form_makes_leave_the_day_whole(browser: Browser) -> None:
    for form in ({}, {"do": "tare"}, {"do": "tare", "entry_number": "2"}, {"do": ["a"]}):
        assert browser.ask("/do", form).status == 422
    assert browser.ask("/do", body=b"\xff\xfe=&&=%").status == 422
    assert browser.ask("/do", body=b"&".join(b"a=1" for _ in range(60))).status == 422
    assert browser.ask("/?shot=99").status == browser.ask("/?shot=-1").status == 200
    assert browser.ask("/do").status == 303
    assert browser.day.stored.day.events == ()


def test_each_trainee_has_a_token_a_cookie_and_a_day(tmp_path: Path) -> None:
    rooms = {name: served(tmp_path / name) for name in ("anna", "ben")}
    first, second = Browser(rooms["anna"]), Browser(rooms["ben"])
    second.application = first.application = application(rooms, hosts=frozenset({HOST}))
    assert first.ask("/?token=anna").status == second.ask("/?token=ben").status == 303
    assert first.cookie != second.cookie
    first.do("tare")
    assert len(rooms["anna"].stored.day.events) == 1
    assert "Your readings will appear here" in second.ask("/").text
    assert Browser(rooms["ben"]).ask("/?token=ben").status == 403


def test_tls_makes_cookie_and_origin_secure(tmp_path: Path) -> None:
    browser = Browser(served(tmp_path / "day"))
    browser.application = application({TOKEN: browser.day}, hosts=frozenset({HOST}), secure=True)
    assert "Secure" in browser.open().headers["set-cookie"]
    form = {"do": "tare", "entry_number": "1"}
    assert browser.ask("/do", form).status == 403
    assert browser.ask("/do", form, headers={"origin": f"https://{HOST}"}).status == 303


def test_the_first_page_does_not_wait_for_the_laboratory(tmp_path: Path) -> None:
    """The page of a day that is being opened is that of the opened one, but for its seal."""
    day = ServedDay(tmp_path / "day", load_scenario("plain-day"), 3)
    browser = Browser(day)
    browser.open()
    first = browser.ask("/").text
    day.open()
    sealed = re.compile(r'<p class="soft">The truth of this day is sealed.*</p>\n')
    assert sealed.subn("", browser.ask("/").text) == (first, 1)


def test_the_page_of_a_resumed_day_does_not_wait_for_the_laboratory(tmp_path: Path) -> None:
    """Its page is made of the log; only how a shot really went waits for the laboratory."""
    before = served(tmp_path / "day")
    for action in asked(PLAIN[:18]):
        before.do(action)
    again = ServedDay(tmp_path / "day", load_scenario("first-day"), None)  # it has its own
    browser = Browser(again)
    browser.open()
    assert browser.ask("/").text == day_page(before.desk, before.briefing)
    for action in asked(END):
        before.do(action)
    last = Browser(ServedDay(tmp_path / "day", load_scenario("plain-day"), None))
    last.open()
    assert "Reload this page" in last.ask("/").text
    last.day.open()
    assert "Top view of the true motion" in last.ask("/").text


def test_a_finished_day_is_played_back_entry_by_entry(tmp_path: Path) -> None:
    """Each page has what the page of the day had then, and leads on; no machine is needed."""
    day, shown = served(tmp_path / "day"), []
    browser = Browser(day)
    browser.open()
    for action in asked((*PLAIN[:18], *END)):
        assert browser.ask("/replay").status == 409
        day.do(action)
        browser.rest()
        page = browser.ask("/").text
        shown.append([part[0] for part in PICTURES.findall(page)])
    later = Browser(ServedDay(tmp_path / "day", None))
    assert later.ask(f"/replay?token={TOKEN.replace(' ', '%20')}").headers["location"] == "/replay"
    for number in (0, *range(11, len(shown) + 1)):
        later.rest()
        page = later.ask(f"/replay?entry={number}").text
        if 0 < number < len(shown):  # the page of the day then shows how it really was
            assert [part[0] for part in PICTURES.findall(page)] == shown[number - 1]
        assert f"<strong>{f'Entry {number}' if number else 'Start of the day'}</strong>" in page
        assert ('rel="next"' in page) == (number < len(shown))
        assert ('rel="prev"' in page) == (number > 0)
    assert later.ask("/replay?entry=999").status == 404
    assert "Start of the day</strong>" in later.ask("/replay?entry=x").text


def test_only_the_trainer_plays_an_exam_back(tmp_path: Path) -> None:
    day = served(tmp_path / "day", "exam-day")
    for action in asked(END):
        day.do(action)
    trainee, trainer = Browser(day), Browser(ServedDay(tmp_path / "day", None))
    trainee.open()
    trainer.open()
    assert trainee.ask("/replay").status == 409
    assert trainer.ask("/replay?entry=1").status == 200


def test_the_notebook_lists_actions_and_readings(browser: Browser) -> None:
    browser.do("weigh-bat")
    browser.do("strike-out", entry=1, because="wrong bat")
    newest_first = browser.ask("/").text.rpartition("<h2>Notebook</h2>")[2]
    assert newest_first.index("wrong bat") < newest_first.index("<s>Weigh the bat</s>")
    page = browser.ask("/notebook").text
    assert "<s>Weigh the bat</s> struck out" in page
    assert re.search(r"<s>reading 1 \d+\.\d g", page)
    assert "reason: wrong bat" in page


def test_no_cell_of_a_table_is_a_formula(browser: Browser) -> None:
    """What is typed stands behind its name; a cell that began with it would be quoted."""
    browser.do("note-deviation", because="=1+1")
    rows = list(csv.reader(StringIO(browser.ask("/notebook.csv").text)))
    assert rows[1][2:5] == ["Note a deviation", "no", "skipped step: another; reason: =1+1"]
    assert [quote(each) for each in ("=1", "+a", "-b", "@c", "\t=1", "-1.5", "plain")] == [
        "'=1",
        "'+a",
        "'-b",
        "'@c",
        "'\t=1",
        "-1.5",
        "plain",
    ]
