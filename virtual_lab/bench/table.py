"""The table of actions: what each costs in lab minutes, and how large its consequences are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from virtual_lab import catalog
from virtual_lab.catalog.specs import Dimension, Spec, Title, YesNo

PREPARING = {"tare": "weigh-bat", "level-stand": "measure-balance", "fit-clamp": "swing"}
MAKE_READY = ("zero-encoder", "clear-scrap", "wait-pressure", "wait-rest")  # for a shot
Part = Literal["bench", "wall", "rig", "hits", "notebook", "result"]
Mass = Annotated[float, Gt(0), Dimension("mass")]
Length = Annotated[float, Gt(0), Dimension("length")]
Time = Annotated[float, Ge(0), Dimension("time")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionSheet(Spec):
    """One action: its name on a button, its price, and what leaving it out does."""

    title: Title
    part: Part  # of the page, and of the day
    skipped: Title
    in_book: YesNo  # whether the procedure asks for it
    minutes: Time  # [s], printed in minutes


@dataclass(frozen=True, slots=True, kw_only=True)
class Consequences(Spec):
    """How large what an action prevents, or shows, is."""

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
    """All actions by name, and their consequences."""

    title: Title
    actions: Mapping[str, ActionSheet]
    consequences: Consequences


@cache
def action_table() -> ActionTable:
    """Return the table as it ships."""
    return catalog.load("bench", "actions", ActionTable).spec
