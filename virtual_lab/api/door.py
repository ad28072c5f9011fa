"""Calls of public functions: arguments are checked and converted by the rules of their types.

An argument may be a sheet instead of a name. The text of the sheet then replaces the file of the
catalog while the function runs.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from virtual_lab.api.describing import Description, advice, describe
from virtual_lab.errors import InputError, nearest
from virtual_lab.output.progress import show_progress
from virtual_lab.sheets import NAMED, Sheet, settings_text, sheets_in

LABORATORY = "laboratory"  # the parameter that takes the folder of a laboratory
INSTRUMENTS = "instruments"  # the parameter that changes the laboratory itself
SEALED = ("certify", "rehearse")  # functions whose results may be handed on without the truth
PROGRESS = "progress"  # the parameter that is called with the progress; by default it is shown
Store = dict[tuple[str, str], str]  # the texts of sheets, by kind and name


def public(name: str, place: tuple[str, str]) -> Callable[..., Any]:
    """Return the public function `name`. Its module is imported at the first call.

    `place` is (module, name): the module that defines the function, and the name of the function
    there. If the function has a parameter `progress` and a call does not set it, the progress is
    shown on stderr. A call raises `InputError` for an argument that is missing, unknown or not
    allowed, and for an instrument that no rig of the test uses.
    """
    description = describe(*place)

    def call(*positional: Any, **named: Any) -> Any:
        from virtual_lab import catalog

        bound = _bind(name, description, positional, named)
        request, store = dict(bound.arguments), Store()
        for key, value in bound.arguments.items():
            if value is not description.parameters[key].default:
                request[key] = _read(name, description, key, value)
                bound.arguments[key] = _store_sheets(request[key], store)
        folder = request.get(LABORATORY)
        # a file or a mapping is particulars
        ours = sheets_in(folder) if isinstance(folder, Path) and not folder.is_file() else ()
        texts = {(each.kind, each.name): each.text for each in ours} | store
        place_of_rigs = str(folder) if any(each.kind == "rigs" for each in ours) else ""
        function = getattr(import_module(place[0]), place[1])
        shows_progress = PROGRESS in description.parameters and PROGRESS not in bound.arguments
        with (
            catalog.sheets_in_place(texts, place_of_rigs) as sheets_read,
            show_progress() if shows_progress else nullcontext() as bar,
        ):
            more = {PROGRESS: bar} if shows_progress else {}
            try:
                result = function(*bound.args, **bound.kwargs, **more)
            except InputError as fault:
                changed = (*ours, *request.get(INSTRUMENTS, ()))
                files = {sheet.name: sheet.origin for sheet in changed}
                if not files.get(fault.where):
                    raise
                where = files[fault.where]
                raise InputError(where, fault.key, fault.value, fault.allowed) from fault
        for sheet in request.get(INSTRUMENTS, ()):
            if (sheet.kind, sheet.name) not in sheets_read:
                in_use = sorted(
                    {each for kind, each in sheets_read if kind in ("instruments", "rigs")}
                )
                allowed = f"no rig of this test uses it; in use: {', '.join(in_use) or 'none'}"
                raise InputError("", INSTRUMENTS, sheet.name, allowed)
        return with_settings(result, f"arguments of vl.{name}", request, sealed=name in SEALED)

    call.__name__ = call.__qualname__ = name
    # a module that is loaded: pydoc lists functions of others, as `help(vl)` does from 3.13 on
    call.__module__, call.__doc__ = __name__, description.doc
    call.__signature__ = description.signature  # type: ignore[attr-defined]
    return call


def with_settings(result: Any, call: str, arguments: Mapping[str, Any], *, sealed: bool) -> Any:
    """Return `result` with its field `settings` set to the arguments of the call, as TOML text.

    `call` is the first line of the text, as a comment. A result without a field `settings` is
    returned unchanged. If the truth is `sealed`, seed, faults and changed instruments are left out.
    """
    if not hasattr(result, "settings"):
        return result
    return replace(result, settings=settings_text(call, arguments, sealed=sealed))


def _bind(
    name: str, description: Description, positional: Sequence[Any], named: Mapping[str, Any]
) -> inspect.BoundArguments:
    """Return a call's arguments, keyed by name. Raises `InputError` for missing or unknown ones."""
    parameters = description.parameters
    for key in named:
        if key not in parameters:
            allowed = (
                f"unknown argument, {nearest(key, parameters)}allowed: {', '.join(parameters)}"
            )
            raise InputError(f"vl.{name}", key, None, allowed)
    by_place = [key for key, each in parameters.items() if not each.keyword]
    if description.more and len(positional) > len(by_place):
        *first, last = positional[: len(by_place)]
        last = list(last) if isinstance(last, list | tuple) else [last]
        positional = [*first, [*last, *positional[len(by_place) :]]]
    if len(positional) > len(by_place):
        others = [f"{key}=…" for key in parameters if key not in by_place]
        allowed = (
            f"write it by name: {', '.join(others)}" if others else "there are too many arguments"
        )
        if by_place and parameters[by_place[-1]].rule.several:
            allowed = f"several {by_place[-1]} are one list, [A, B]; or {allowed}"
        value = positional[len(by_place)]
        raise InputError(f"vl.{name}", f"argument {len(by_place) + 1}", value, allowed)
    try:
        return description.signature.bind(*positional, **named)
    except TypeError as fault:
        for key in by_place[len(positional) :]:
            if parameters[key].default is inspect.Parameter.empty and key not in named:
                allowed = f"is missing; allowed: {parameters[key].rule.allowed}"
                raise InputError(f"vl.{name}", key, None, allowed) from fault
        raise InputError(
            f"vl.{name}", str(fault), None, f"allowed: {', '.join(parameters)}"
        ) from fault


def _read(name: str, description: Description, key: str, value: Any) -> Any:
    rule = description.parameters[key].rule
    if value is None and description.parameters[key].optional:
        return None
    try:
        return rule.read(value)
    except InputError:
        raise
    except (TypeError, ValueError, KeyError, ArithmeticError) as fault:
        if callable(getattr(value, name, None)) and not isinstance(value, str):
            allowed = f"has a function of its own: write .{name}() after it"
            raise InputError("", key, value, allowed) from fault
        shown_key = key if value is not None else f"{key} = None"
        raise InputError("", shown_key, value, advice(rule, value) + rule.python) from fault


def _store_sheets(value: Any, store: Store) -> Any:
    """Return a value with each sheet replaced by its name; add the text of the sheet to `store`."""
    if isinstance(value, tuple):
        return tuple(_store_sheets(each, store) for each in value)
    if isinstance(value, dict):  # a study by its keys
        return {key: _store_sheets(each, store) for key, each in value.items()}
    if not isinstance(value, Sheet):
        return value
    kind = value.kind
    if store.setdefault((kind, value.name), value.text) != value.text:
        allowed = "rename one by with_(name=…)" if kind in NAMED else "allowed: one of them"
        raise InputError("", kind, value.name, f"two different sheets have this name; {allowed}")
    return value.name
