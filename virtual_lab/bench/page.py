"""The page of a day, made of the desk alone: the procedure, what can be done, what was seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from virtual_lab.bench.actions import ARGUMENTS, Argument
from virtual_lab.bench.day import offered
from virtual_lab.bench.desk import Desk
from virtual_lab.bench.inspection import known_doubts
from virtual_lab.bench.operators import PREPARATION
from virtual_lab.bench.table import MAKE_READY, action_table
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.template import page_template
from virtual_lab.records import EncoderRecord
from virtual_lab.units import INCH, MPH

__all__ = ["day_page", "plain_page"]

PACKAGE = "virtual_lab.bench"
PARTS = {
    "bench": "Bench",
    "wall": "Wall rig",
    "rig": "Rig at the bat",
    "notebook": "Notebook",
    "result": "Result",
}
WIDTH, HEIGHT = 600, 160  # of a trace, in its own units
POINTS = 150  # of a trace
ROWS = 16  # of its table


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A step of the procedure on the page."""

    title: str
    state: str  # done, now, to come
    part: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HitShown:
    """A row of the table of hits, as printed."""

    shot: int
    ball: int
    place: str
    speed: str
    efficiency: str
    metric: str
    windows: str
    decision: str
    because: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceShown:
    """What the encoder showed of a shot: a line, and its numbers."""

    points: str
    low: int
    high: int
    duration: str
    rows: tuple[tuple[str, int], ...]


def day_page(desk: Desk, briefing: Mapping[str, Any], message: str = "") -> str:
    """Return the page of a day as it is, with what was wrong with the last request."""
    day, table = desk.day, action_table()
    steps = _steps(desk)
    forms = [
        (
            title,
            [
                _form(name, desk)
                for name, sheet in table.actions.items()
                if sheet.part == part and offered(day, name)
            ],
        )
        for part, title in PARTS.items()
    ]
    metric = METRICS[desk.rules.spec.metric]
    return page_template(PACKAGE, "day.html").render(
        briefing=briefing,
        guided=briefing["guidance"] == "guided",
        listed=briefing["guidance"] != "none",
        message=message,
        day=day,
        rules=desk.rules.spec,
        next_number=len(day.events) + 1,
        steps=steps,
        present=next((step for step in steps if step.state == "now"), None),
        forms=forms,
        sheets=table.actions,
        hits=_hits(desk),
        hits_note=desk.missing,
        metric=metric,
        suggested=_suggested(desk),
        ready=[(table.actions[name].title, name in day.ready) for name in MAKE_READY],
        last=next((event for event in reversed(day.events) if event.shown), None),
        trace=_trace(desk),
        gates=_gates(desk),
        doubts=known_doubts(),
        entries=list(reversed(day.events)),
        minute=_minutes(desk),
    )


def plain_page(title: str, sentence: str) -> str:
    """Return a page that says one thing."""
    return page_template(PACKAGE, "plain.html").render(title=title, sentence=sentence)


def _steps(desk: Desk) -> list[Step]:
    day, sheets = desk.day, action_table().actions
    valid = desk.rules.spec.valid_hits
    counted = sum(each.accepted for each in day.decisions.values())
    done = {name: desk.last(name) is not None for name in PREPARATION} | {
        "set-place": day.place is not None,
        "fire": counted >= valid,
        "reduce": day.reduced,
        "give-verdict": bool(day.verdict),
        "hand-in": day.handed_in,
    }
    steps, present = [], True
    for name, over in done.items():
        state = "done" if over else "now" if present else "to come"
        present = present and over
        hits = f"Fire until {valid} hits count ({counted} so far)"
        title = hits if name == "fire" else sheets[name].title
        steps.append(Step(title=title, state=state, part=sheets[name].part))
    return steps


def _form(name: str, desk: Desk) -> dict[str, Any]:
    sheet = action_table().actions[name]
    return {
        "name": name,
        "title": sheet.title,
        "minutes": f"{sheet.minutes / 60:g}",
        "skipped": sheet.skipped,
        "times": desk.day.times(name),
        "arguments": [(a, _default(a, name, desk)) for a in ARGUMENTS.get(name, ())],
    }


def _default(argument: Argument, action: str, desk: Desk) -> str:
    if action == "set-place" and argument.name == "place":
        return _suggested(desk)["place"]
    if action == "load-ball" and argument.name == "ball":
        return _suggested(desk)["ball"]
    if argument.default is None:
        return ""
    return f"{argument.default:g}" if isinstance(argument.default, float) else str(argument.default)


def _suggested(desk: Desk) -> dict[str, str]:
    """Return where the rules ask for the next hit [mm] and whose turn it is; nothing too early."""
    if desk.missing:
        return {"place": "", "ball": ""}
    place = desk.next_place
    return {
        "place": "" if place is None else f"{place * 1e3:.1f}",
        "ball": str(desk.next_ball + 1),
    }


def _hits(desk: Desk) -> list[HitShown]:
    day = desk.day
    if not day.fired:
        return []
    whole = not desk.missing
    rows = []
    for shot, (ball, _) in enumerate(day.fired):
        chosen = day.decisions.get(shot)
        windows = "not reduced yet"
        numbers = ("–", "–", "–", "–")
        if whole:
            found = desk.by_rules
            windows = desk.reasons[shot] or "within"
            unit = METRICS[desk.rules.spec.metric].unit_si
            numbers = (
                _number(found.readings.place[shot] / INCH, 3),
                _number(found.shots.speed[shot] / MPH, 2),
                _number(found.shots.collision_efficiency[shot], 4),
                _number(found.shot_metric[shot] / unit, 4),
            )
        place, speed, efficiency, metric = numbers
        decision = "undecided" if chosen is None else "accepted" if chosen.accepted else "rejected"
        rows.append(
            HitShown(
                shot=shot + 1,
                ball=ball + 1,
                place=place,
                speed=speed,
                efficiency=efficiency,
                metric=metric,
                windows=windows,
                decision=decision,
                because=chosen.because if chosen else "",
            )
        )
    return rows


def _number(value: float, places: int) -> str:
    return f"{value:.{places}f}" if np.isfinite(value) else "not seen"


def _trace(desk: Desk) -> TraceShown | None:
    """Return the encoder's trace of the last shot, None where nothing watched the bat."""
    event = desk.last("fire")
    if event is None or "encoder" not in event.records:
        return None
    record: Any = desk.session.records["impact"]["encoder"]
    assert isinstance(record, EncoderRecord)
    counts, times = record.counts[-1], record.times
    some = np.unique(np.linspace(0, times.size - 1, POINTS).astype(int))
    low, high = float(counts.min()), float(counts.max())
    across = WIDTH * times[some] / times[-1]
    up = HEIGHT - HEIGHT * (counts[some] - low) / max(high - low, 1.0)
    few = np.unique(np.linspace(0, times.size - 1, ROWS).astype(int))
    return TraceShown(
        points=" ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, up, strict=True)),
        low=int(low),
        high=int(high),
        duration=f"{times[-1] * 1e3:.0f}",
        rows=tuple((f"{times[at] * 1e3:.1f}", int(counts[at])) for at in few),
    )


def _gates(desk: Desk) -> list[tuple[str, str, str]]:
    """Return the edges of the last shot: way and gate, broke and cleared [ms]."""
    event = desk.last("fire")
    if event is None or event.records["gates"]["kind"] != "gates":
        return []
    rows = []
    for way, gates in zip(("in", "back"), event.records["gates"]["times"][0], strict=True):
        for gate, edges in enumerate(gates, 1):
            broke, cleared = ("not seen" if t is None else f"{t * 1e3:.3f}" for t in edges)
            rows.append((f"{way}, gate {gate}", broke, cleared))
    return rows


def _minutes(desk: Desk) -> dict[int, str]:
    seconds = np.cumsum([event.seconds for event in desk.day.events])
    return {
        event.number: f"{at / 60:.1f}" for event, at in zip(desk.day.events, seconds, strict=True)
    }
