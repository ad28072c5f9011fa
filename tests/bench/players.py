"""Ten kinds of player on the same days: who is honest and looks must come out first.

``python -m tests.bench.players --days 40``: each takes as many sound days and as many faulty ones,
and the table of their scores is printed as the documentation has it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import cycle, islice

import numpy as np

from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import Day, ready_steps
from virtual_lab.bench.day.operators import Look, Operator, operator_of
from virtual_lab.bench.day.scenario import SCORES, load_scenario
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.stored_day import laboratory_of, run_operator
from virtual_lab.bench.scoring.debrief import debrief

RATE = 0.1
LISTED = (
    "gate-moved",
    "gate-misses",
    "scale-not-tared",
    "pendulum-wide",
    "encoder-slip",
    "wrong-lot",
    "bat-cracked",
    "aim-along",
)
DAY = replace(load_scenario("at-the-limit").spec, may_go_wrong=dict.fromkeys(LISTED, RATE))
Scores = Mapping[str, np.ndarray]  # by player: (day, score)


def only_fires(look: Look) -> Iterator[Action]:
    """Fire six balls, measure nothing, and say that it passes, or what can be said."""
    yield action_of("set-place", {"place": 163})
    for shot in range(6):
        yield action_of("load-ball", {"ball": shot + 1})
        yield from map(action_of, (*ready_steps(look().day), "fire"))
    yield from _refusing(look)


def _refusing(_: Look) -> Iterator[Action]:
    yield action_of("give-verdict", {"verdict": "INVALID", "confidence": 90})
    yield action_of("hand-in")


def naming_all(percent: float) -> Operator:
    """Return who keeps to the book and names everything that may go wrong."""

    def played(look: Look) -> Iterator[Action]:
        for action in operator_of("book")(look):
            if action.name == "give-verdict":
                for name in LISTED:
                    yield action_of("note-doubt", {"doubt": name, "confidence": percent})
            yield action

    return played


def repeating(look: Look) -> Iterator[Action]:
    """Keep to the book; reject the highest hit and fire again until the program reads PASS."""
    for action in operator_of("book")(look):
        if action.name == "reduce":
            yield from _until_it_passes(look)
        if action.name == "give-verdict":
            found = look().certification.verdict.value
            yield action_of("give-verdict", {"verdict": found, "confidence": 90})
        else:
            yield action


def _until_it_passes(look: Look) -> Iterator[Action]:
    while look().certification.verdict.value == "FAIL":
        left = look().rules.spec.attempts - len(look().day.fired)
        counted = look().reduced.valid
        if left < 1 or not counted.any():
            return
        highest = int(np.where(counted, look().reduction_by_rules.shot_metric, -np.inf).argmax())
        yield action_of("reject", {"shot": highest + 1, "because": "did not sound right"})
        yield action_of("load-ball", {"ball": look().next_ball + 1})
        yield from map(action_of, (*ready_steps(look().day), "fire"))
        shot, why = len(look().day.fired), look().reasons[-1]
        because = {"because": why} if why else {}
        yield action_of("reject" if why else "accept", {"shot": shot, **because})


PLAYERS: Mapping[str, Callable[[int], Operator]] = {
    **{
        name: lambda seed, name=name: operator_of(name, seed)  # type: ignore[misc]
        for name in ("expert", "careful", "book", "careless", "cheating")
    },
    "only fires": lambda _: only_fires,
    "nothing, and INVALID": lambda _: _refusing,
    "everything at 1 %": lambda _: naming_all(1.0),
    "everything at 50 %": lambda _: naming_all(50.0),
    "repeats until it passes": lambda _: repeating,
}


def days(count: int) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield seed and faults of as many sound days, and of as many with one fault each."""
    for seed in range(3000, 3000 + count):
        yield seed, ()
    for seed, fault in zip(range(4000, 4000 + count), islice(cycle(LISTED), count), strict=True):
        yield seed, (fault,)


def scores_of(count: int) -> Scores:
    """Return the scores of every player on the same days, by player (day, score)."""
    found: dict[str, list[list[float]]] = {name: [] for name in PLAYERS}
    for seed, faults in days(count):
        today = replace(DAY, faults=faults)
        apparatus = Apparatus(laboratory_of(today, seed, b""))
        expert: Day | None = None
        for name, player in PLAYERS.items():
            day = run_operator(apparatus, player(seed), listed=today.may_go_wrong)
            expert = expert or day  # who comes first
            closing = debrief(apparatus, day, today, expert=expert, scores_only=True)
            found[name].append([score.value for score in closing.scores])
    return {name: np.array(rows) for name, rows in found.items()}


def lead(scores: Scores, first: str, second: str) -> Mapping[str, float]:
    """Return by how many standard errors, paired by days, one player leads another.

    In the sum of the scores, in detection and in result; a difference without scatter counts as
    its sign times infinity.
    """
    ahead = scores[first] - scores[second]
    columns = {
        "sum": ahead.sum(axis=1),
        "detection": ahead[:, SCORES.index("detection")],
        "result": ahead[:, SCORES.index("result")],
    }
    return {name: _errors(each) for name, each in columns.items()}


def _errors(ahead: np.ndarray) -> float:
    error = float(ahead.std(ddof=1)) / np.sqrt(ahead.size)
    if error < 1e-12:
        return float(np.sign(ahead.mean())) * np.inf if abs(ahead.mean()) > 1e-12 else 0.0
    return float(ahead.mean()) / error


def table(scores: Scores) -> str:
    """Return the table of the documentation: means over sound and faulty days, and the sum."""
    head = ["player", *(f"{name}" for name in SCORES), "sum", "sum, sound", "sum, faulty"]
    lines = [f"| {' | '.join(head)} |", f"|---|{'---|' * (len(head) - 1)}"]
    for name, rows in scores.items():
        half = len(rows) // 2
        total = rows.sum(axis=1)
        numbers = [*rows.mean(axis=0), total.mean(), total[:half].mean(), total[half:].mean()]
        lines.append(f"| {name} | {' | '.join(f'{each:.2f}' for each in numbers)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=int, default=40)
    taken_by_all = scores_of(parser.parse_args().days)
    print(table(taken_by_all))
    for looks in ("expert", "careful"):
        for other in PLAYERS:
            if other not in {"expert", "careful"}:
                leads = lead(taken_by_all, looks, other)
                print(looks, other, {name: f"{each:.1f}" for name, each in leads.items()})
