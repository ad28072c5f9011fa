"""Figures of the rehearsal bench that need many days.

``python -m tests.bench.study detection --days 100``: on how many days a detector that makes the
checks of a fault alone finds it, and names anything where nothing is wrong. ``expert``: on how
many days of one fault each an expert names it before the verdict, and anything on sound and decoy
days. ``operators``: a classifier fitted on so many days of each, judged on as many fresh ones.
``buttons``: how many a whole day takes on the page, and how long the server works at them.
``keyboard``: how long it takes a person by keyboard alone, by a model of keystrokes in Chromium.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from tests.bench.days import detector
from tests.bench.test_web import Browser
from virtual_lab import catalog
from virtual_lab.bench.day.day import Day
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.operators import HABITS, operator_of
from virtual_lab.bench.day.protocol import omitted_steps
from virtual_lab.bench.day.readings import suspected_faults
from virtual_lab.bench.day.scenario import Scenario, load_scenario
from virtual_lab.bench.day.table import detectable, preparation
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.stored_day import laboratory_of, run_operator

SOUND, DECOY = "plain-day", "monday"  # a decoy says that something may be wrong, and nothing is
CHECKS = ("weigh-check-mass", "tap-bat", "fire-check-ball", "gauge-gates", "fire-check-cylinder")
LEAST_SPREAD = 0.05  # of a feature that hardly differs from day to day
TOGETHER = 10  # days after which expert and book are classified


def day_of(scenario: Scenario, operator: str, seed: int) -> Day:
    apparatus = Apparatus(laboratory_of(scenario, seed, b""))
    return run_operator(apparatus, operator_of(operator, seed))


def named(day: Day) -> set[str]:
    return {str(e.arguments["doubt"]) for e in day.events if e.action == "note-doubt"}


def found(fault: str, seeds: Iterable[int]) -> int:
    """Return on how many days the checks of a fault find it."""
    days = 0
    for seed in seeds:
        scenario = replace(load_scenario((SOUND, DECOY)[seed % 2]).spec, faults=(fault,))
        day = run_operator(Apparatus(laboratory_of(scenario, seed, b"")), detector(fault))
        days += any(doubt.fault == fault for doubt in suspected_faults(Desk(day)))
    return days


def features(day: Day) -> list[float]:
    """Return what a trainer's list shows of a day: steps, hits decided otherwise, checks."""
    desk = Desk(day)
    reasons = desk.reasons if not desk.reduction_error else ()
    decided = [(day.decisions[shot].accepted, not why) for shot, why in enumerate(reasons)]
    return [
        len(omitted_steps(day)),
        sum(accepted and not within for accepted, within in decided),
        sum(within and not accepted for accepted, within in decided),
        sum(day.times(check) for check in CHECKS),
    ]


def observed(operator: str, seeds: Iterable[int]) -> np.ndarray:
    names = catalog.names("bench/scenarios")
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


def detection(days: int, faults: Sequence[str] = ()) -> None:
    print(f"found by its own checks alone, of {days} days")
    for fault in faults or detectable():
        print(f"  {fault:<22}{found(fault, range(1000, 1000 + days)):>5}", flush=True)


def expert(days: int) -> None:
    faults = list(detectable())
    missed: list[str] = []
    for number in range(days):
        fault = faults[number % len(faults)]
        scenario = replace(load_scenario((SOUND, DECOY)[number % 2]).spec, faults=(fault,))
        if fault not in named(day_of(scenario, "expert", 2000 + number)):
            missed.append(fault)
    share = f"{days - len(missed)} of {days} days of a fault named before the verdict by the expert"
    print(f"{share}; missed: {', '.join(missed) or 'none'}", flush=True)
    for scenario_name in (SOUND, DECOY):
        scenario = load_scenario(scenario_name).spec
        alarms = sum(bool(named(day_of(scenario, "expert", 5000 + n))) for n in range(days // 2))
        print(f"{alarms} of {days // 2} days of {scenario_name} with anything named", flush=True)


def operators(days: int) -> None:
    fitted = [observed(name, range(7000, 7000 + days)) for name in HABITS]
    print(f"operators classified, fitted on {days} days each and judged on {days} fresh ones")
    for place, name in enumerate(HABITS):
        likely = likelihoods(fitted, observed(name, range(8000, 8000 + days)))
        right = float((likely.argmax(axis=1) == place).mean())
        ten = likely[: days // TOGETHER * TOGETHER].reshape(-1, TOGETHER, len(HABITS)).sum(1)
        together = float((ten.argmax(axis=1) == place).mean()) if len(ten) else float("nan")
        print(f"  {name:<10} a day {right:.0%}, ten days {together:.0%}", flush=True)


def buttons(days: int) -> None:
    for name, shots in (("plain-day", 6), ("college-day", 5)):
        for seed in range(9000, 9000 + days):
            with TemporaryDirectory() as place:
                room = ServedDay(Path(place) / "day", load_scenario(name), seed)
                room.open()
                pressed, seconds = pressed_through(room, shots)
            fired = len(room.desk.day.fired)
            print(f"{name}, seed {seed}: {pressed} buttons, {fired} shots, server {seconds:.1f} s")


def pressed_through(room: ServedDay, shots: int) -> tuple[int, float]:
    """Take a day by the page's buttons, some shots at a time; return how many, and seconds."""
    browser = Browser(room)
    browser.open()
    began, pressed = time.perf_counter(), 0

    def press(name: str, **given: object) -> None:
        nonlocal pressed
        pressed += 1
        assert browser.do(name, **given).status == 303, name

    for name in preparation():
        press(name)
    while (place := room.desk.next_position) is not None:
        stands = room.desk.day.place
        if stands is None or abs(place - stands) > 1e-6:
            press("set-place", place=f"{place * 1e3:.3f}")
        press("fire-shots", shots=shots)
        press("accept-within")
    press("reduce")
    press("give-verdict", verdict=room.desk.certification.verdict.value)
    press("hand-in")
    return pressed, time.perf_counter() - began


def keyboard(days: int) -> None:
    from tests.bench import browsing, keystrokes

    print(keystrokes.HEAD)
    takes = (("plain-day", keystrokes.by_enter), ("college-day", keystrokes.by_list))
    for name, take in takes * days:
        with TemporaryDirectory() as place, ExitStack() as stack:
            day, address = stack.enter_context(browsing.served(Path(place) / "day", name))
            page = stack.enter_context(browsing.opened()).new_page()
            page.goto(address)
            print(take(page, day).row(name, len(day.desk.day.fired)), flush=True)


if __name__ == "__main__":
    STUDIES = {each.__name__: each for each in (detection, expert, operators, buttons, keyboard)}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=tuple(STUDIES))
    parser.add_argument("--days", type=int, default=100)
    parser.add_argument("--fault", action="append", default=[], choices=detectable())
    asked = parser.parse_args()
    STUDIES[asked.what](asked.days, *([asked.fault] if asked.fault else []))
