"""HTML pages of the rehearsal bench: bench, replay, notebook, rules, instruments, exam."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from itertools import accumulate
from types import MappingProxyType
from typing import Any

from virtual_lab.bench.day.actions import ARGUMENTS, typed_words
from virtual_lab.bench.day.arguments import Argument
from virtual_lab.bench.day.day import Day, DayEvent, is_offered, ready_steps
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.doubts import fault_titles
from virtual_lab.bench.day.exam import Hall
from virtual_lab.bench.day.readings import rows_of
from virtual_lab.bench.day.scenario import UNITS, Scenario
from virtual_lab.bench.day.table import action_table, in_buttons, preparation
from virtual_lab.bench.pages.papers import wall_pages
from virtual_lab.bench.pages.slow_motion import Motion, SlowMotion, motion_of_sketch, slow_motion
from virtual_lab.bench.pages.tally import convert_units, residual_chart, run_chart, swings, tally
from virtual_lab.bench.pages.traces import traces_of
from virtual_lab.errors import InputError
from virtual_lab.files.tables import quote
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.template import page_template

PACKAGE, WEB = "virtual_lab.bench.pages", "virtual_lab.web"
PARTS = {
    "bench": "Bench",
    "wall": "Wall rig",
    "rig": "Impact rig",
    "checks": "Checks",
    "hits": "Hits",
    "notebook": "Notebook",
    "result": "Result",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """A rejected action, and the reason."""

    sentence: str
    action: str = ""
    argument: str = ""  # name of the argument with a wrong value
    fields: Mapping[str, str] | None = None  # content of the form, as typed


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A step of the procedure, as the page lists it."""

    name: str
    title: str
    state: str  # "done", "now" or "to come"
    part: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedHit:
    """One row of the table of hits, as printed."""

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
class PrintedEntry:
    """One entry of the notebook, as printed."""

    number: int
    minute: str
    title: str
    struck: bool
    entered: str
    readings: str


def day_page(
    desk: Desk,
    briefing: Mapping[str, Any],
    *,
    refusal: Refusal | None = None,
    shot: int | None = None,
    true_motion: Motion | None = None,
    scenarios_offered: Mapping[str, Scenario] = MappingProxyType({}),
) -> str:
    """Return the HTML page of the bench for the current state of a day.

    Parameters
    ----------
    desk, briefing
        The desk (the day and its results), and the part of the scenario that the trainee may know.
    refusal
        The rejected action to report at the top of the page. By default none.
    shot
        Number of the shot to draw, from 1. By default the last shot.
    true_motion
        The true motion of this shot. The trainee may see it after handing in the day. By default
        the page draws the sketch of the shot.
    scenarios_offered
        Scenarios that the trainee may begin instead, keyed by name.
    """
    day, table = desk.day, action_table()
    hits = _hits(desk, briefing)
    steps = _steps(desk)
    guided = briefing["guidance"] == "guided" and not day.handed_in
    present = _next_step(desk, steps, hits) if guided and is_offered(day, "fire") else ""
    refusal_shown = refusal or Refusal(sentence="")
    focus = refusal_shown.action or present or _last_control(day.events)
    sheets = table.actions.items()
    names = [name for name, each in sheets if each.part != "hits" and is_offered(day, name)]
    suggested = _suggest_shot(desk, briefing)
    # steps of the button that fires several balls
    each_shot = ("load-ball", *ready_steps(day), "fire")
    return page_template(PACKAGE, "day.html", WEB).render(
        **_display_variables(desk, briefing, hits, shot, true_motion),
        briefing=briefing,
        scenarios_offered=scenarios_offered,
        listed=briefing["guidance"] != "none",
        refused=refusal_shown,
        rules=desk.rules.spec,
        next_number=len(day.events) + 1,
        steps=steps,
        present=present,
        focus=focus,
        open_part=_part_of(focus) if focus else "bench",
        deciding=hits[-1] if _last_undecided(desk, hits) else None,
        rows=tuple(rows_of(desk)),
        swings=swings(desk),
        tally=tally(desk, briefing["units"]),
        run_chart=run_chart(desk, UNITS[briefing["units"]]),
        parts=[
            (part, title, [name for name in names if table.actions[name].part == part])
            for part, title in PARTS.items()
        ],
        forms={name: _form(name, desk, refusal_shown, suggested) for name in table.actions},
        done_of=_count_done(steps),
        hits=hits,
        undecided=[hit for hit in hits if hit.decision == "undecided"],
        waiting=desk.undecided_hits,
        undecided_note=_undecided_note(desk, briefing),
        result=reduced.shown if (reduced := desk.last("reduce")) else (),
        hits_note=in_buttons(desk.reduction_error),
        suggested=suggested,
        can_fire=is_offered(day, "fire"),
        ready=[(table.actions[name].title, name in day.ready) for name in ready_steps(day)],
        each_shot=f"{sum(table.actions[name].minutes for name in each_shot) / 60:g}",
        doubts=_doubts(day),
        entries=_entries(day, briefing)[::-1],
        left_over=f"{(briefing['minutes'] - day.seconds) / 60:.0f}",
    )


def replay_page(day: Day, briefing: Mapping[str, Any], number: int) -> str:
    """Return the HTML page that shows a day as it was after entry `number`; 0 is the start.

    `briefing` is the part of the scenario that a trainee may know. Raises `IndexError` if
    `number` is larger than the number of entries. It must not be negative.
    """
    desk, entries = Desk(day.until(number)), _entries(day, briefing)
    return page_template(PACKAGE, "replay.html", WEB).render(
        briefing=briefing,
        number=number,
        entries=entries,
        at=entries[number - 1] if number else None,
        **_display_variables(desk, briefing, _hits(desk, briefing)),
    )


def _display_variables(
    desk: Desk,
    briefing: Mapping[str, Any],
    hits: list[PrintedHit],
    shot: int | None = None,
    true_motion: Motion | None = None,
) -> dict[str, Any]:
    """Return the template variables for the display and the drawings of a shot, from 1."""
    day, number = desk.day, min(shot or len(hits), len(hits))
    fired = [event for event in day.events if event.action == "fire"]
    last = day.events[-1] if day.events else None
    return {
        "day": day,
        "sheets": action_table().actions,
        "units": _units(briefing),
        "metric": METRICS[desk.rules.spec.metric],
        "last": last,
        "typed": typed_words(last.action, last.arguments) if last else "",
        "last_hit": hits[-1] if last and last.action == "fire" else None,
        "filmed": bool(briefing.get("camera") and number and "rebound" in fired[number - 1].sketch),
        "traces": traces_of(number, fired[number - 1].records) if number else None,
        "motion": _motion(desk, number, fired, true_motion) if number else None,
        "residual": residual_chart(desk, number) if number else "",
        "rows_now": [row for row in rows_of(desk) if last and row.entry == last.number],
        "swings_now": swings(desk) if last and last.action == "swing" else [],
        "place_set": _length(day.place, briefing) if day.place is not None else "",
    }


def notebook_page(desk: Desk, briefing: Mapping[str, Any]) -> str:
    """Return the HTML page of the notebook for printing.

    It lists all entries and all hits of the day, in order.
    """
    return page_template(PACKAGE, "notebook.html", WEB).render(
        briefing=briefing,
        day=desk.day,
        rules=desk.rules.spec,
        metric=METRICS[desk.rules.spec.metric],
        entries=_entries(desk.day, briefing),
        hits=_hits(desk, briefing),
        units=_units(briefing),
    )


def notebook_table(desk: Desk, briefing: Mapping[str, Any]) -> str:
    """Return the entries of a day as text in CSV format.

    The text has a header row, and one row per entry in the log of `desk.day`. `briefing` is the
    briefing of the rehearsal.
    """
    lines = StringIO()
    rows = csv.writer(lines)
    rows.writerow(["entry", "time_min", "action", "struck_out", "entered", "shown"])
    for each in _entries(desk.day, briefing):
        struck = "yes" if each.struck else "no"
        cells = (each.number, each.minute, each.title, struck, each.entered, each.readings)
        rows.writerow([quote(cell) for cell in cells])
    return lines.getvalue()


def hall_page(hall: Hall) -> str:
    """Return the HTML page for the trainer of an exam. It shows the progress of each trainee."""
    return page_template(PACKAGE, "hall.html", WEB).render(
        hall=hall, trainees=list(hall.trainees())
    )


def refusal_sentence(fault: InputError) -> str:
    """Return an error as one sentence for the page.

    The sentence names buttons and fields by their titles on the page.
    """
    titles = {each.name: each.title for each in ARGUMENTS.get(fault.where, ())}
    key = titles.get(fault.key, fault.key)
    value = f"“{fault.value}”" if isinstance(fault.value, str) else fault.value
    words = f"{key} {value}: " if value is not None else f"the {key} "
    sheets = action_table().actions
    if fault.where in sheets:
        words = f"“{sheets[fault.where].title}”: {words}"
    sentence = in_buttons(f"{words}{fault.allowed}")
    return f"{sentence[0].upper()}{sentence[1:]}."


def _steps(desk: Desk) -> list[Step]:
    day, sheets, rules = desk.day, action_table().actions, desk.rules.spec
    counted = sum(each.accepted for each in day.decisions.values())
    enough_hits = bool(day.fired) and not desk.reduction_error and desk.next_position is None
    is_done = {name: desk.last(name) is not None for name in preparation()} | {
        "set-place": day.place is not None,
        "fire": enough_hits or day.reduced,
        "reduce": day.reduced or bool(day.verdict),
        "give-verdict": bool(day.verdict),
        "hand-in": day.handed_in,
    }
    each = " at each position" if rules.scan else ""
    steps, present = [], True
    for name, finished in is_done.items():
        state = "done" if finished else "now" if present else "to come"
        present = present and finished
        hits = f"Fire until {rules.valid_hits} hits count{each} ({counted} so far)"
        title = hits if name == "fire" else sheets[name].title
        steps.append(Step(name=name, title=title, state=state, part=sheets[name].part))
    return steps


def _doubts(day: Day) -> list[str]:
    """Return the titles of all faults; the faults that the scenario lists come first."""
    titles = fault_titles()
    return [titles[name] for name in dict.fromkeys([*day.listed, *titles])]


def _last_undecided(desk: Desk, hits: list[PrintedHit]) -> bool:
    """Return whether the last action was a shot that the trainee can accept or reject now."""
    events, day = desk.day.events, desk.day
    fired = bool(events) and events[-1].action == "fire" and bool(hits)
    return fired and not (day.reduced or day.handed_in or desk.reduction_error)


def wall_page(desk: Desk, briefing: Mapping[str, Any], name: str) -> str:
    """Return the HTML page of the rules or of the instruments, as selected by `name`.

    `name` is "rules" or "instruments". Any other name raises jinja2's `TemplateNotFound`.
    """
    return page_template(PACKAGE, f"{name}.html", WEB).render(
        briefing=briefing, metric=METRICS[desk.rules.spec.metric], **wall_pages(desk, briefing)
    )


def _next_step(desk: Desk, steps: list[Step], hits: list[PrintedHit]) -> str:
    """Return the next step of the procedure: an action, or ``decide-N`` for undecided hit N."""
    for hit in hits:
        if hit.decision == "undecided" and not desk.reduction_error and not desk.day.reduced:
            return f"decide-{hit.shot}"
    name = next((step.name for step in steps if step.state == "now"), "")
    if name != "fire":
        return name
    return "set-place" if not desk.reduction_error and desk.needs_position else "fire-shots"


def _last_control(events: tuple[DayEvent, ...]) -> str:
    """Return the control that gets the focus after the last action; empty before the first."""
    if not events:
        return ""
    last = events[-1]
    if last.action == "fire":
        return f"decide-{sum(event.action == 'fire' for event in events)}"
    return "fire-shots" if last.action in {"accept", "reject"} else last.action


def _part_of(focus: str) -> str:
    if focus.startswith("decide-") or focus == "accept-within":
        return "hits"
    sheets = action_table().actions
    return sheets[focus].part if focus in sheets else "rig"


def _count_done(steps: list[Step]) -> dict[str, str]:
    """Return the printed number of finished steps for each section of the page."""
    counts = {}
    for part in PARTS:
        part_steps = [step for step in steps if step.part == part]
        count = sum(step.state == "done" for step in part_steps)
        counts[part] = f"{count} of {len(part_steps)} steps done" if part_steps else ""
    return counts


def _form(name: str, desk: Desk, refused: Refusal, suggested: Mapping[str, str]) -> dict[str, Any]:
    sheet = action_table().actions[name]
    typed = refused.fields or {} if refused.action == name else {}
    return {
        "name": name,
        "title": sheet.title,
        "minutes": f"{sheet.minutes / 60:g}",
        "skipped": sheet.skipped,
        "times": desk.day.times(name),
        "arguments": [
            (each, typed.get(each.name, _default(each, name, suggested)))
            for each in ARGUMENTS.get(name, ())
        ],
    }


def _default(argument: Argument, action: str, suggested: Mapping[str, str]) -> str:
    if (action, argument.name) in {("set-place", "place"), ("load-ball", "ball")}:
        return suggested[argument.name]
    if argument.default is None:
        return ""
    return f"{argument.default:g}" if isinstance(argument.default, float) else str(argument.default)


def _suggest_shot(desk: Desk, briefing: Mapping[str, Any]) -> dict[str, str]:
    """Return the next impact position and ball as printed; empty while a record is missing."""
    if desk.reduction_error:
        return {"place": "", "ball": ""}
    place = desk.next_position
    return {
        "place": "" if place is None else _length(place, briefing),
        "ball": str(desk.next_ball + 1),
    }


def _undecided_note(desk: Desk, briefing: Mapping[str, Any]) -> str:
    """Return the note that undecided hits prevent the next position; empty if they do not."""
    if not desk.undecided_hits or desk.next_position is None:
        return ""
    following_position = desk.with_undecided_accepted.next_position
    if following_position == desk.next_position:
        return ""
    unit = _units(briefing)[0]
    count = f"{len(desk.undecided_hits)} undecided hit{'s' if len(desk.undecided_hits) > 1 else ''}"
    position = f"{_length(desk.next_position, briefing)} {unit}"
    if following_position is None:
        consequence = "no further hit is needed"
    else:
        consequence = f"the next impact position is {_length(following_position, briefing)} {unit}"
    return (
        f"Undecided hits do not count, so the procedure still requires hits at {position}. "
        f"If you accept the {count} within the windows, {consequence}."
    )


def _units(briefing: Mapping[str, Any]) -> list[str]:
    """Return the printed units of position and speed."""
    return [unit for unit, _ in UNITS[briefing["units"]]]


def _length(metres: float, briefing: Mapping[str, Any]) -> str:
    """Return a length as printed, in the unit of the day but without it."""
    (unit, metre), _ = UNITS[briefing["units"]]
    return f"{metres / metre:.{3 if unit == 'in' else 1}f}"


def _hits(desk: Desk, briefing: Mapping[str, Any]) -> list[PrintedHit]:
    (length, metre), (_, metre_a_second) = UNITS[briefing["units"]]
    whole, metric = not desk.reduction_error, METRICS[desk.rules.spec.metric]

    def number(value: float | None, unit: float, places: int) -> str:
        return (
            f"{value / unit:.{places}f}" if value is not None else "not measured" if whole else "–"
        )

    return [
        PrintedHit(
            shot=shot,
            ball=hit.ball,
            place=number(hit.place, metre, 3 if length == "in" else 1),
            speed=number(hit.speed, metre_a_second, 2),
            efficiency=number(hit.efficiency, 1.0, 4),
            metric=number(metric.in_unit(hit.metric), 1.0, 4),
            windows=convert_units(desk.reasons[shot - 1], briefing["units"]) or "within"
            if whole
            else "not reduced yet",
            decision=hit.decision,
            because=convert_units(hit.because, briefing["units"]),
        )
        for shot, hit in enumerate(desk.hits, 1)
    ]


def _motion(desk: Desk, shot: int, fired: list[DayEvent], true_motion: Motion | None) -> SlowMotion:
    event, rules = fired[shot - 1], desk.rules.spec
    place = float(event.records["log"]["place"][0])
    return slow_motion(shot, true_motion or motion_of_sketch(event, rules, place), desk.day, rules)


def _entries(day: Day, briefing: Mapping[str, Any]) -> list[PrintedEntry]:
    sheets = action_table().actions
    minutes = accumulate(event.seconds / 60 for event in day.events)
    return [
        PrintedEntry(
            number=event.number,
            minute=f"{at:.1f}",
            title=sheets[event.action].title,
            struck=event.number in day.struck,
            entered=convert_units(typed_words(event.action, event.arguments), briefing["units"]),
            readings=", ".join(
                f"{quantity} {value} {unit}".rstrip() for quantity, value, unit in event.shown
            ),
        )
        for event, at in zip(day.events, minutes, strict=True)
    ]
