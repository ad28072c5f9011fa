"""The table of actions: titles, prices in laboratory time, and sizes of their effects."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import takewhile
from types import MappingProxyType
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from virtual_lab import catalog
from virtual_lab.bench.day.arguments import Argument
from virtual_lab.bench.day.doubts import fault_sheets
from virtual_lab.catalog.faults import FoundBy
from virtual_lab.catalog.specs import Dimension, Spec, Title, YesNo

PREPARING = {"tare": "weigh-bat", "level-stand": "measure-balance", "fit-clamp": "swing"}
MAKE_READY = ("zero-encoder", "clear-scrap", "wait-pressure", "wait-rest")  # steps before a shot
# faults without a repair of the rig: action and arguments instead
FOUND_INSTEAD: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "gate-moved": ("gauge-gates", {"use": "gauge"}),
    "clamp-forgotten": ("swing-clamp", {"use": "measured"}),
    "ball-worn-out": ("retire-ball", {"because": "slower at the wall than the lot"}),
}
Part = Literal["bench", "wall", "rig", "hits", "notebook", "result"]
Mass = Annotated[float, Gt(0), Dimension("mass")]
Length = Annotated[float, Gt(0), Dimension("length")]
Time = Annotated[float, Ge(0), Dimension("time")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionSheet(Spec):
    """Description of an action: button, price, arguments, and effect of its omission."""

    title: Title
    part: Part  # section of the page
    skipped: Title
    in_book: YesNo  # whether the procedure requires the action
    minutes: Time  # price [s], printed in minutes
    mends: tuple[str, ...] = ()  # faults that the action repairs
    takes: tuple[Argument, ...] = ()  # arguments of the action
    again: tuple[str, ...] = ()  # actions to repeat after this one
    needs: str = ""  # required instrument, as in calibration keys; empty: none
    channel: str = ""  # channel of the bench that the action records
    check_after: str = ""  # for a check: step of the procedure after which it is best made
    on_checklist: YesNo = False  # whether the checklist before the first shot has it


@dataclass(frozen=True, slots=True, kw_only=True)
class Consequences(Spec):
    """Sizes of the errors that actions prevent, and uncertainties of the checks."""

    own_agrees: Annotated[float, Gt(0), Dimension("number")]
    untared: Mass
    unlevel: Length
    hand_reaction: Time
    hand_step: Time
    check_mass: Mass
    gauge_u: Length
    pivot_rule_u: Length
    clamp_u: Annotated[float, Gt(0), Dimension("inertia")]
    clock_u: Annotated[float, Gt(0), Dimension("number")]
    balls_again: Annotated[int, Gt(0), Dimension("number")]
    gauge_step: Length
    ball_gauge_u: Length
    aim_setting: Length
    swing_left: Annotated[float, Gt(0), Dimension("angular speed")]
    slow_by: Annotated[float, Gt(0), Dimension("speed")]
    scrap: Annotated[float, Ge(0), Le(1), Dimension("number")]
    scrap_ahead: Length
    warm_loss: Annotated[float, Ge(0), Dimension("number")]
    ball_rest: Time
    tap_u: Annotated[float, Gt(0), Dimension("frequency")]
    check_hits: Annotated[int, Gt(1), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionTable(Spec):
    """All actions keyed by name, and the sizes of their effects."""

    title: Title
    actions: Mapping[str, ActionSheet]
    consequences: Consequences


@cache
def channels() -> Mapping[str, str]:
    """Return the name of the bench record that each measuring action writes, keyed by action name.

    The name does not include the stage, for example ``pendulum`` for the file ``bench/pendulum``.
    Actions that write no bench record are left out.
    """
    return {name: each.channel for name, each in action_table().actions.items() if each.channel}


@cache
def preparation() -> tuple[str, ...]:
    """Return the names of the steps that the procedure requires before the first shot, in order.

    The last step is the one before ``set-place``, the step that sets the first impact position.
    """
    book = (name for name, each in action_table().actions.items() if each.in_book)
    return tuple(takewhile(lambda name: name != "set-place", book))


@cache
def repairs() -> Mapping[str, ActionSheet]:
    """Return the actions that repair a fault, keyed by action name."""
    return {name: each for name, each in action_table().actions.items() if each.mends}


def remedy_of(fault: str) -> tuple[str, Mapping[str, str]] | None:
    """Return name and arguments of the action that removes a fault.

    The result is None if no action removes it.
    """
    if fault in FOUND_INSTEAD:
        return FOUND_INSTEAD[fault]
    return next(((name, {}) for name, each in repairs().items() if fault in each.mends), None)


def in_buttons(sentence: str) -> str:
    """Return an error message with button titles instead of action names.

    All other words are unchanged.
    """
    writes = {f"bench/{channel}": name for name, channel in channels().items()}
    writes |= {"balls/log": "hit-wall", "impact/aim": "aim-paper"}
    for channel, action in writes.items():
        sentence = sentence.replace(
            f"{channel}: record; this record is missing", f"{action} comes first"
        )
    sheets = action_table().actions
    names = "|".join(sheets)
    pattern = rf"^({names})(?=:)|\b({names})(?= comes first| or )|\b(\w+(?:-\w+)+)\b"

    def button(match: re.Match[str]) -> str:
        name = match[1] or match[2] or match[3]
        return f"“{sheets[name].title}”" if name in sheets else match[0]

    return re.sub(pattern, button, sentence)


@cache
def action_table() -> ActionTable:
    """Return the table of actions in ``data/bench/actions.toml``."""
    return catalog.load("bench", "actions", ActionTable).spec


@cache
def detectable() -> Mapping[str, FoundBy]:
    """Return the check that reveals each fault, for faults that a check at the bench can reveal.

    The keys are fault names. A value states the actions of the check, the reading to look at, and
    the limit of this reading.
    """
    detections = {name: sheet.found_by for name, sheet in fault_sheets().items() if sheet.found_by}
    return MappingProxyType(detections)
