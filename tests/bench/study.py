"""Figures of the rehearsal bench that need many days.

``python -m tests.bench.study detection --days 100``: on how many days of each fault with checks
the expert names it before the verdict, and how often where nothing is wrong. ``operators``: a
classifier fitted on so many days of each operator, judged on as many fresh ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from virtual_lab.bench.apparatus import Apparatus
from virtual_lab.bench.day import Day
from virtual_lab.bench.desk import Desk
from virtual_lab.bench.inspection import detectable
from virtual_lab.bench.keeping import laboratory_of, taken
from virtual_lab.bench.operators import OPERATORS, operator_of
from virtual_lab.bench.protocol import left_out
from virtual_lab.bench.scenario import Scenario, load_scenario, scenario_names

SOUND, DECOY = "plain-day", "monday"  # a decoy says that something may be wrong, and nothing is
CHECKS = ("weigh-check-mass", "tap-bat", "fire-check-ball", "gauge-gates", "fire-check-cylinder")
LEAST_SPREAD = 0.05  # of a feature that hardly differs from day to day
TOGETHER = 10  # days after which expert and book are told apart


def day_of(scenario: Scenario, operator: str, seed: int) -> Day:
    apparatus = Apparatus(laboratory_of(scenario, seed, b""))
    return taken(apparatus, operator_of(operator, seed))


def named(day: Day) -> set[str]:
    return {str(e.arguments["doubt"]) for e in day.events if e.action == "note-doubt"}


def found(fault: str, seeds: Iterable[int]) -> int:
    """Return on how many days the expert named a fault before the verdict."""
    days = (load_scenario((SOUND, DECOY)[seed % 2]).spec for seed in seeds)
    played = zip((replace(day, faults=(fault,)) for day in days), seeds, strict=True)
    return sum(fault in named(day_of(day, "expert", seed)) for day, seed in played)


def alarms(scenario: str, seeds: Iterable[int]) -> int:
    """Return on how many days of a scenario the expert named anything."""
    day = load_scenario(scenario).spec
    return sum(bool(named(day_of(day, "expert", seed))) for seed in seeds)


def features(day: Day) -> list[float]:
    """Return what a trainer's list shows of a day: steps, hits decided otherwise, checks."""
    desk = Desk(day)
    reasons = desk.reasons if not desk.missing else ()
    decided = [(day.decisions[shot].accepted, not why) for shot, why in enumerate(reasons)]
    return [
        len(left_out(day)),
        sum(accepted and not within for accepted, within in decided),
        sum(within and not accepted for accepted, within in decided),
        sum(day.times(check) for check in CHECKS),
    ]


def observed(operator: str, seeds: Iterable[int]) -> np.ndarray:
    names = scenario_names()
    days = (load_scenario(names[seed % len(names)]).spec for seed in seeds)
    return np.array(
        [features(day_of(day, operator, seed)) for day, seed in zip(days, seeds, strict=True)]
    )


def likelihoods(fitted: Sequence[np.ndarray], seen: np.ndarray) -> np.ndarray:
    """Return the log likelihood of each day under each operator's normal law, (day, operator)."""
    rows = []
    for days in fitted:
        spread = np.hypot(days.std(axis=0), LEAST_SPREAD)
        off = (seen - days.mean(axis=0)) / spread
        rows.append(-(off**2 / 2 + np.log(spread)).sum(axis=1))
    return np.array(rows).T


def detection(days: int) -> None:
    print(f"named by the expert before the verdict, of {days} days")
    for fault in detectable():
        print(f"  {fault:<22}{found(fault, range(1000, 1000 + days)):>5}", flush=True)
    print(f"anything named where nothing is wrong, of {days} days")
    for scenario in (SOUND, DECOY):
        print(f"  {scenario:<22}{alarms(scenario, range(5000, 5000 + days)):>5}", flush=True)


def operators(days: int) -> None:
    fitted = [observed(name, range(7000, 7000 + days)) for name in OPERATORS]
    print(f"operators told apart, fitted on {days} days each and judged on {days} fresh ones")
    for place, name in enumerate(OPERATORS):
        likely = likelihoods(fitted, observed(name, range(8000, 8000 + days)))
        right = float((likely.argmax(axis=1) == place).mean())
        ten = likely[: days // TOGETHER * TOGETHER].reshape(-1, TOGETHER, len(OPERATORS)).sum(1)
        together = float((ten.argmax(axis=1) == place).mean()) if len(ten) else float("nan")
        print(f"  {name:<10} a day {right:.0%}, ten days {together:.0%}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("detection", "operators"))
    parser.add_argument("--days", type=int, default=100)
    asked = parser.parse_args()
    {"detection": detection, "operators": operators}[asked.what](asked.days)
