"""Actions at the bench keyed by name, each with its arguments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from virtual_lab.bench.day.arguments import Argument, Value
from virtual_lab.bench.day.doubts import fault_titles
from virtual_lab.bench.day.table import action_table
from virtual_lab.errors import InputError, nearest


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """An action that a trainee or an operator requests, with its arguments."""

    name: str
    arguments: Mapping[str, Value] = field(default_factory=dict)


RESULT_QUANTITIES = MappingProxyType(  # typed: the quantity of the reduction
    {
        "r": "recoil_factor",
        "e_A": "collision_efficiency",
        "e": "restitution",
        "BPF": "bat_performance_factor",
    }
)
ARGUMENTS: Mapping[str, tuple[Argument, ...]] = MappingProxyType(
    {name: sheet.takes for name, sheet in action_table().actions.items() if sheet.takes}
)


def typed_words(action: str, arguments: Mapping[str, Value]) -> str:
    """Return the arguments of an action in words, for example "position: 120 mm".

    This is the text on the page. Arguments are separated by "; ". Empty arguments are left out. The
    result is empty if there is none. Raises `KeyError` for an argument that the action does not
    have.
    """
    takes = {each.name: each for each in ARGUMENTS.get(action, ())}
    titles = fault_titles() | {name: each.title for name, each in action_table().actions.items()}
    words = []
    for name, value in arguments.items():
        argument = takes[name]
        printed = f"{value:g}" if isinstance(value, float) else str(value)
        if argument.kind in {"doubt", "choice"}:
            printed = titles.get(printed, printed)
        if printed:
            words.append(f"{argument.title}: {printed} {argument.unit}".rstrip())
    return "; ".join(words)


def action_of(
    name: str, arguments: Mapping[str, object] | None = None, length: str = "mm"
) -> Action:
    """Return the action with this name, after checking its arguments.

    `arguments` are values, or strings as the trainee typed them. A missing argument gets its
    default, if it has one. A length without a unit is in the unit `length`.

    Raises
    ------
    InputError
        The action does not exist, or an argument is unknown, missing or out of range.
    """
    sheets = action_table().actions
    if name not in sheets:
        allowed = f"{nearest(name, sheets)}allowed: {', '.join(sheets)}"
        raise InputError("", "action", name, allowed)
    raw = dict(arguments or {})
    takes = {argument.name: argument for argument in ARGUMENTS.get(name, ())}
    if unknown := [key for key in raw if key not in takes]:
        allowed = f"allowed: {', '.join(takes) or 'no argument'}"
        raise InputError(name, str(unknown[0]), None, allowed)
    values = {key: argument.read(raw.get(key), name, length) for key, argument in takes.items()}
    return Action(name=name, arguments=values)
