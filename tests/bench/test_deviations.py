"""A departure is held against what was to be seen: borne out, not, or left to the trainer."""

import pytest

from tests.bench.days import (
    PLAIN,
    Asked,
    apparatus,
    asked,
    day_of,
    debrief_of,
    play_actions,
    without,
)
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.protocol import excuses_of
from virtual_lab.bench.scoring.debrief_page import debrief_page
from virtual_lab.bench.scoring.deviations import (
    DENIED,
    JUSTIFIED,
    OPEN,
    Deviation,
    anomaly_of,
    deviations,
)

END = (("reduce", {}), ("give-verdict", {"verdict": "PASS"}), ("hand-in", {}))


def note(step: str) -> Asked:
    return ("note-deviation", {"step": step, "because": "it read so"})


def judged(days: list[Asked], *faults: str) -> list[Deviation]:
    return list(deviations(Desk(day_of(days, *faults))))


FIRST_SHOT = PLAIN[:18]  # to its decision


@pytest.mark.parametrize(
    ("step", "expected", "why"),
    [
        ("zero-encoder", JUSTIFIED, "rad/s before hit 1"),
        ("wait-rest", DENIED, "turned at 0.3"),
        ("wait-pressure", DENIED, "was off by"),
        ("clear-scrap", OPEN, "no record"),  # before the first shot nothing is due
        ("load-ball", OPEN, "no record"),
        ("tare", OPEN, "check mass had not been weighed"),
        ("another", OPEN, "no record"),
    ],
)
def test_an_omitted_step_is_judged_by_the_record_of_its_shot(
    step: str, expected: str, why: str
) -> None:
    days = [each for each in FIRST_SHOT if each[0] != step or step == "load-ball"]
    (found,) = judged([*days, note(step)])
    assert (found.judged, found.step) == (expected, step)
    assert why in found.why


def test_a_note_that_is_struck_out_gives_no_reason() -> None:
    struck = ("strike-out", {"entry": 2, "because": "it was tared"})
    assert excuses_of(day_of([note("level-stand"), note("tare"), struck])) == {
        "level-stand": "it read so"
    }


def test_a_note_before_its_shot_is_left_to_the_trainer() -> None:
    days = [note("wait-rest"), *(each for each in FIRST_SHOT if each[0] != "wait-rest")]
    assert [each.judged for each in judged(days)] == [OPEN]


def test_a_ball_fired_again_is_judged_by_its_rest() -> None:
    shots = PLAIN[12:18]
    again = [each for each in shots if each[0] not in {"load-ball", "accept"}]
    for rest, expected in ((0, DENIED), (8, JUSTIFIED)):
        waited = [("fire-check-ball", {})] * rest
        assert judged([*FIRST_SHOT, *waited, *again, note("load-ball")])[-1].judged == expected


def test_a_missing_tare_is_judged_by_the_display_of_the_scale() -> None:
    """Not tared it shows what it crept; with a dish on it 2 g more, whatever it crept."""
    days = [("weigh-check-mass", {}), note("tare"), ("weigh-bat", {})]
    desk = Desk(day_of(days))
    readings = [value for what, value, _ in desk.day.events[0].shown if what.startswith("read")]
    off = abs(sum(readings) / len(readings) - 500)
    (sound,) = deviations(desk)
    assert sound.judged != (DENIED if off < 0.1 else JUSTIFIED)
    assert judged(days, "scale-not-tared")[0].judged == DENIED


def test_a_step_is_justified_once_it_is_made_good() -> None:
    late = [("level-stand", {}), ("measure-balance", {})]
    first = without("level-stand")
    assert judged([*first, note("level-stand")])[-1].judged == OPEN
    assert judged([*first, *late, note("level-stand")])[-1].judged == JUSTIFIED
    assert judged([*first, *late[::-1], note("level-stand")])[-1].judged == OPEN


def test_only_unjustified_deviations_cost_points() -> None:
    def protocol(step: str, *more: Asked) -> float:
        day = play_actions(apparatus(), asked([*without(step), *more, *END]))
        closing = debrief_of(day, scores_only=True)
        assert len(closing.deviations) == len(more)
        assert not more or f"<strong>{closing.deviations[0].judged}</strong>" in debrief_page(
            closing
        )
        return {score.name: score.value for score in closing.scores}["protocol"]

    assert protocol("zero-encoder") < 1 == protocol("zero-encoder", note("zero-encoder"))
    assert protocol("wait-rest", note("wait-rest")) == protocol("wait-rest") < 1


def test_only_an_odd_hit_may_be_rejected() -> None:
    """A gate that fires twice: the windows let some of its hits through, the traces do not."""
    scores = []
    for faults in ((), ("gate-doubles",)):
        desk = Desk(day_of(PLAIN, *faults))
        shots = [s for s, why in enumerate(desk.reasons) if not why]
        shot = next((s for s in shots if anomaly_of(desk, s)), shots[0])
        reject = ("reject", {"shot": shot + 1, "because": "look at the trace"})
        day = play_actions(apparatus(*faults), asked([*PLAIN, reject, *END]))
        closing = debrief_of(day, *faults)
        assert closing.deviations[-1].judged == (JUSTIFIED if faults else DENIED)
        wrong = [each for each in closing.costly if each.what.startswith(f"hit {shot + 1} ")]
        entry = max(event.number for event in day.events if event.action == "reject")
        assert [each.entry for each in wrong] == [entry] * len(wrong)
        scores.append(({each.name: each.value for each in closing.scores}["record"], bool(wrong)))
    assert scores[0] == (pytest.approx(6 / 7), True)
    assert scores[1][1] is False


def test_a_check_after_a_sign_of_its_fault_costs_nothing() -> None:
    twice = [("gauge-gates", {}), ("gauge-gates", {"use": "gauge"})]
    for faults in ((), ("gate-moved",)):
        day = play_actions(apparatus(*faults), asked([*twice, *PLAIN, *END]))
        closing = debrief_of(day, *faults, scores_only=True)
        assert [each.entry for each in closing.deviations] == ([2] if faults else [])
        words = {each.name: each.because for each in closing.scores}["economy"]
        assert ("not counting 3 min of checks justified by a reading" in words) == bool(faults)
