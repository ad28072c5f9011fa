"""An exam: closed until it begins and once it is over; its trainer sees who is where, no truth."""

import re
from pathlib import Path

import pytest

from tests.bench.test_web import HOST, TOKEN, Answer, Browser
from virtual_lab.bench.day.actions import action_of
from virtual_lab.bench.day.exam import Hall, load_class
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.bench.web.server import application
from virtual_lab.errors import InputError

CLASS = """title = "Spring class"
scenario = "exam-day"
trainees = ["Ada", "Ben"]
"""


def turned(trainer: Browser, word: str) -> Answer:
    return trainer.ask("/do", {"do": word})


@pytest.fixture
def hall(tmp_path: Path) -> tuple[Browser, Browser, Hall]:
    """Return the browsers of a trainer and of Ada, and the hall."""
    days = {name: ServedDay(tmp_path / name, load_scenario("exam-day"), 3) for name in ("Ada", "B")}
    for day in days.values():
        day.open()
    opened = Hall("Spring class", days)
    ada, trainer = Browser(days["Ada"]), Browser(days["Ada"])
    ada.application = trainer.application = application(
        {TOKEN: days["Ada"], "b": days["B"]}, hosts=frozenset({HOST}), exam=("chalk", opened)
    )
    assert ada.open().status == trainer.ask("/?token=chalk").status == 303
    return trainer, ada, opened


def test_days_are_closed_before_and_after_the_exam(
    hall: tuple[Browser, Browser, Hall],
) -> None:
    trainer, ada, opened = hall
    form = {"do": "tare", "entry_number": "1"}
    assert ada.ask("/").status == ada.ask("/do", form).status == 409
    assert "not begun" in ada.ask("/").text
    assert turned(trainer, "end").status == 422
    assert turned(trainer, "begin").status == 303
    assert ada.ask("/").status == 200
    assert ada.ask("/do", form).status == 303
    assert turned(trainer, "end").status == 303
    assert ada.ask("/do", form | {"entry_number": "2"}).status == 409
    assert turned(trainer, "begin").status == 422
    assert [each.entries for each in opened.trainees()] == [1, 0]


def test_the_trainer_sees_the_progress_of_each_trainee_and_no_truth(
    hall: tuple[Browser, Browser, Hall],
) -> None:
    trainer, ada, opened = hall
    turned(trainer, "begin")
    opened.days["Ada"].do(action_of("give-verdict", {"verdict": "INVALID"}))
    opened.days["Ada"].do(action_of("hand-in"))
    page = trainer.ask("/").text
    assert page.index("Ada") < page.index("handed in") < page.index(">B<") < page.index("not begun")
    assert "bearing-friction" not in page
    assert trainer.ask("/debrief").status == trainer.ask("/notebook").status == 404
    assert ada.ask("/debrief").status == 409
    assert "your trainer opens the debrief" in ada.ask("/").text
    assert turned(ada, "end").status == 422  # no action of a trainee
    assert opened.is_open


def test_a_code_readmits_a_trainee_and_ends_the_lost_session(
    hall: tuple[Browser, Browser, Hall],
) -> None:
    trainer, ada, opened = hall
    turned(trainer, "begin")
    ada.do("tare")
    again, lost = Browser(ada.day), ada.cookie
    again.application = ada.application
    stranger = again.ask("/")
    assert stranger.status == 403
    assert 'name="token"' in stranger.text
    assert again.ask("/base.css").status == 200
    assert "This code does not exist" in again.ask("/?token=guessed").text
    assert "signed in again" not in trainer.ask("/").text
    assert again.open().status == 303
    assert again.cookie != lost
    assert ada.ask("/").status == ada.ask("/do", {"do": "tare"}).status == 403
    assert again.do("weigh-bat").status == 303
    assert [each.entries for each in opened.trainees()] == [2, 0]
    shown = trainer.ask("/").text
    assert re.search(r"<td class=\"left\">at work, signed in again at \d\d:\d\d</td>", shown)
    assert shown.count("signed in again") == 1
    trainer.cookie = ""
    assert trainer.ask("/?token=chalk").status == 403  # whoever guides the exam came in already


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('"Ada"', '"../x"'), "names no folder"),
        (('"Ada"', '"Ben"'), "named twice"),
        (("exam-day", "plain-day"), 'feedback = "never"'),
        (("exam-day", "no-day"), "allowed: "),
        (('["Ada", "Ben"]', "[]"), "trainees"),
    ],
)
def test_an_invalid_class_file_is_refused(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    path = tmp_path / "class.toml"
    path.write_text(CLASS, "utf-8")
    assert load_class(path).trainees == ("Ada", "Ben")
    path.write_text(CLASS.replace(*change), "utf-8")
    with pytest.raises(InputError, match=message):
        load_class(path)
