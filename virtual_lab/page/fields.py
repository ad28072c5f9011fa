"""The form of a command: one control per parameter, made from its description."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from virtual_lab.api.describing import REQUIRED, ParameterDescription
from virtual_lab.commands.command import Command
from virtual_lab.files.folders import KINDS, folder_kinds
from virtual_lab.page.wording import WORDS, field_name, texts
from virtual_lab.parameters import SETTINGS

FOLDED = ("seed", "operator_seed", "workers")  # folded until they are filled in
TYPED = ("NAME", "BALL|DIAMETER")  # names beside which other texts are allowed
RUNS = "runs"  # folder of the page's runs
DEEPEST = 4  # largest depth of a folder that is offered


class Control(NamedTuple):
    """A field of a form: its parameter, its choices and its present texts."""

    parameter: ParameterDescription
    kind: str  # flag, choice, choices, path, paths, number, numbers or text
    choices: Sequence[tuple[str, str]]  # value and title
    values: Sequence[str]
    fault: str  # sentence about the refused value
    first: bool  # whether it is not folded


def controls(
    command: Command, folder: Path, values: Mapping[str, Sequence[str]], faults: Mapping[str, str]
) -> list[Control]:
    """Return the controls of a form.

    `values` are the texts that the form shows in place of the defaults, and `faults` the sentences
    about refused values.
    """
    example, shown, said = shlex.split(command.example), [], "".join(faults.values())
    every = {key: texts(each.default) for key, each in command.parameters.items()} | {**values}
    stated = form_values(command, every)
    for key, each in with_control(command).items():
        named = f"--{command.option(key)}" in example and key not in FOLDED
        used = command.takes_position(key) or each.default is REQUIRED or named
        kind, choices = _kind(command, each, folder)
        if kind in ("path", "paths", "choice", "choices"):  # a value from elsewhere
            choices += [(text, text) for text in every[key] if text not in dict(choices)]
        first = used or key in {*stated, *faults} or field_name(key) in said
        shown.append(Control(each, kind, choices, every[key], faults.get(key, ""), first))
    return shown


def with_control(command: Command) -> dict[str, ParameterDescription]:
    """Return the parameters that have a control in the form of a command, by name."""
    hidden = WORDS["hidden"]["everywhere"] | WORDS["hidden"].get(command.name, {})
    return {key: each for key, each in command.parameters.items() if key not in hidden}


def form_values(command: Command, form: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return the values that a form states; those that equal a default are left out."""
    values: dict[str, Any] = {}
    for key, each in with_control(command).items():
        entered = [text.strip() for text in form.get(key, ()) if text.strip()]
        if each.rule.kind == "flag" or is_new(each):
            values[key] = bool(entered)
        elif each.rule.several and each.rule.kind == "number":
            values[key] = [word for text in entered for word in text.replace(",", " ").split()]
        else:
            values[key] = entered if each.rule.several else "".join(entered[-1:])
        if texts(values[key]) == texts(each.default):
            del values[key]
    return {key: value for key, value in values.items() if value not in ("", [])}


def _kind(
    command: Command, each: ParameterDescription, folder: Path
) -> tuple[str, list[tuple[str, str]]]:
    """Return the kind of a parameter's control, and the choices that it offers."""
    rule, several = each.rule.several or each.rule, each.rule.several is not None
    choices = [(name, title or name) for name, title in rule.complete().items()]
    if rule.kind == "flag" or is_new(each):
        return "flag", []
    if rule.kind in ("file", "folder", "clip"):
        endings = () if rule.kind == "folder" else tuple(WORDS["endings"].get(each.name, [".toml"]))
        kinds = () if endings else rule.holds or tuple(KINDS)
        sealed = "truth" if command.name == "score" else ""  # a result without truth has no score
        every = choices_in(folder, kinds, endings)
        fitting = [each for each in every if Path(each[0], sealed).exists()]
        return "paths" if several else "path", fitting
    if rule.kind == "number":
        return "numbers" if several else "number", []
    if rule.kind == "text" or rule.metavar in TYPED:
        results = choices_in(folder, ("result",), ()) if command.name == "show" else ()
        return "text", [*choices, *results]
    if not rule.closed:
        choices += choices_in(folder, (), (".toml",))
    return "choices" if several else "choice", choices


def is_new(each: ParameterDescription) -> bool:
    """Return whether a parameter is a new folder, which the page names."""
    return each.rule.holds == ("new",)


def choices_in(
    folder: Path, kinds: Sequence[str], endings: tuple[str, ...]
) -> Iterator[tuple[str, str]]:
    """Yield folders of some kinds and files with some endings below a folder, newest first.

    Files of results and laboratories are left out, sealed truths, and the runs of the page.
    """
    found = []
    for place, names, files in os.walk(folder):
        path = Path(place)
        present = folder_kinds(path) if path != folder else set()
        if present.intersection(kinds):
            found.append(path)
        elif not present:
            named = (name for name in files if name.lower().endswith(endings))
            found += [path / name for name in named if name != SETTINGS]
        deep = len(path.relative_to(folder).parts) >= DEEPEST or "laboratory" in present
        names[:] = [] if deep else [name for name in names if name not in (RUNS, "truth")]
    for path in sorted(found, key=lambda each: -each.stat().st_mtime):
        yield str(path), str(path.relative_to(folder))
