"""Days that an inspector is shown the page of: how often it finds each fault, and alarms at none.

``python -m tests.bench.inspected --days 100`` prints the table, a line for each scenario and
fault: on how many days it was found, how far off the largest reading of a day was at the least, and
the least limit of any reading, both in u; three times as many sound days stand at the end.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import nan

from tests.bench.inspector import faults_on, margins
from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import ready_steps
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.operators import Look
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.day.table import detectable, preparation
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.stored_day import laboratory_of, run_operator
from virtual_lab.bench.pages.page import day_page

CHECKS = (
    "weigh-check-mass",
    "reweigh-balls",
    "swing-clamp",
    "tap-bat",
    "fire-check-ball",
    "gauge-gates",
    "measure-pivot",
    "compare-clock",
    "fire-check-cylinder",
)
SHOTS = {"plain-day": 6, "college-day": 10}
NO_ENCODER = {  # at the BBCOR rig, which has none
    "bat-not-at-rest",
    "bearing-friction",
    "encoder-half-counts",
    "encoder-play",
    "encoder-slip",
}
EACH = [
    (scenario, fault)
    for scenario in SHOTS
    for fault in detectable()
    if scenario == "plain-day" or fault not in NO_ENCODER
]
FAULTY, SOUND = 200, 1000  # first seeds


@dataclass(frozen=True)
class Inspected:
    """Findings of an inspector on some days."""

    days: int
    found: int  # on which the fault was named
    alarms: int  # on which another was
    least_off: float  # over days, of the largest reading of a day that points to the fault, in u
    least_limit: float  # of all readings, in u


def looker(shots: int) -> object:
    """Return who makes every check and fires some balls at one place, whatever is shown."""

    def taken_so(look: Look) -> Iterator[Action]:
        yield from map(action_of, (*preparation(), *CHECKS))
        place = None if look().reduction_error else look().next_position
        yield action_of("set-place", {"place": round((place or 0.163) * 1e3, 3)})
        for shot in range(shots):
            yield action_of("load-ball", {"ball": shot % 12 + 1})
            yield from map(action_of, (*ready_steps(look().day), "fire"))
        yield from map(action_of, ("tap-bat", "recheck-balls"))

    return taken_so


def page_of(scenario: str, fault: str | None, seed: int) -> str:
    """Return the page of a day with one fault, or none, after everything was checked."""
    today = replace(load_scenario(scenario).spec, faults=(fault,) if fault else ())
    machines = Apparatus(laboratory_of(today, seed, b""))
    day = run_operator(machines, looker(SHOTS[scenario]))  # type: ignore[arg-type]
    return day_page(Desk(day), today.briefing())


def inspected(scenario: str, fault: str | None, seeds: range) -> Inspected:
    """Show the inspector the page of each day."""
    found = alarms = 0
    off: list[float] = []
    limits: list[float] = []
    for seed in seeds:
        page = page_of(scenario, fault, seed)
        named = faults_on(page)
        found += fault in named
        alarms += bool(named - {fault})
        read = list(margins(page))
        limits += [limit for _, limit, _ in read]
        beyond = [by for of, limit, by in read if of == fault and by > limit]
        off += [max(beyond)] if beyond else []  # a sound gate may be beyond beside a moved one
    return Inspected(len(seeds), found, alarms, min(off, default=nan), min(limits))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=int, default=100)
    days = parser.parse_args().days
    print("| scenario | fault | found | of days | others named | least off [u] | least limit [u] |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for scenario, fault in [*EACH, *((name, None) for name in SHOTS)]:
        seeds = range(FAULTY, FAULTY + days) if fault else range(SOUND, SOUND + 3 * days)
        row = inspected(scenario, fault, seeds)
        numbers = f"{row.found} | {row.days} | {row.alarms} | {row.least_off:.1f}"
        numbers += f" | {row.least_limit:.1f}"
        print(f"| {scenario} | {fault or 'none'} | {numbers} |", flush=True)
