"""The form of a command: one control per parameter, made from its description."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from virtual_lab import catalog
from virtual_lab.api.describing import REQUIRED, ParameterDescription
from virtual_lab.commands.command import Command
from virtual_lab.page.wording import WORDS
from virtual_lab.sheets import OF_LABORATORY

FOLDED = ("seed", "operator_seed", "workers")  # always among the fields that are folded
CHOSEN = "the page chooses the new folder or file"
# parameters without a control, by command (empty: of every command) and name
EXCEPTIONS = {
    ("", "out"): CHOSEN,
    ("", "csv"): CHOSEN,
    ("", "plot"): CHOSEN,
    ("template", "folder"): CHOSEN,
    ("rehearse branch", "folder"): CHOSEN,
    ("", "instruments"): "a changed sheet belongs to a name; an editor of sheets is left out",
    ("", "sign"): "a private key does not belong in a browser",
    ("rehearse", "open"): "the page opens the bench in every case",
}
NEW = {("sweep", "certificates"), ("twin", "faults")}  # new folders, if the user wants them
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
    command: Command,
    folder: Path,
    values: Mapping[str, Sequence[str]],
    faults: Mapping[str, str],
) -> list[Control]:
    """Return the controls of a form.

    `values` are the texts that the form shows in place of the defaults, and `faults` the sentences
    about refused values.
    """
    example, shown = shlex.split(command.example), []
    for key, each in command.parameters.items():
        if not has_control(command, key):
            continue
        option = f"--{(key.removesuffix('s') if each.rule.several else key).replace('_', '-')}"
        used = command.takes_position(key) or each.default is REQUIRED or option in example
        kind, choices = _kind(command, each, folder)
        entered = values.get(key, texts(each.default))
        if kind in ("path", "paths", "choice", "choices"):  # a value from elsewhere
            choices += [(text, text) for text in entered if text not in dict(choices)]
        fault = faults.get(key, "")
        first = bool(fault) or (used and key not in FOLDED)
        shown.append(Control(each, kind, choices, entered, fault, first))
    return shown


def has_control(command: Command, key: str) -> bool:
    """Return whether a parameter has a control in the form of a command."""
    return not {("", key), (command.name, key)} & EXCEPTIONS.keys()


def texts(value: Any) -> tuple[str, ...]:
    """Return a default, or the values of a call, as texts of a form."""
    if value in (REQUIRED, None, False, (), ""):
        return ()
    values = value if isinstance(value, tuple | list) else (value,)
    return tuple("yes" if each is True else str(each) for each in values)


def given(command: Command, form: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return the values that a form states; those that equal a default are left out."""
    values: dict[str, Any] = {}
    for key, each in command.parameters.items():
        entered = [text.strip() for text in form.get(key, ()) if text.strip()]
        if not has_control(command, key):
            continue
        if each.rule.kind == "flag":
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
    rule, key, several = each.rule.several or each.rule, each.name, each.rule.several is not None
    shelf, word, choices = f"{rule.metavar.lower()}s", rule.metavar, list[tuple[str, str]]()
    kind = "choices" if several else "choice"
    if rule.kind == "flag" or (command.name, key) in NEW:
        kind = "flag"
    elif rule.kind == "choice":
        choices = [(name, name) for name in rule.complete()]
    elif shelf in catalog.KINDS:
        choices = [*_entries(shelf, tuple(rule.complete())), *_files(folder, ".toml")]
        choices += WORDS["files"].items() if command.name == "template" else ()
    elif word in ("FOLDER", "FILE") or key in ("clip", "study"):
        kind = "paths" if several else "path"
        near = WORDS["folders"]
        marks = near.get(key) or near.get(command.name) or ("result",)
        endings = WORDS["endings"].get(key, (".toml",))
        choices = [] if word == "FOLDER" else [*_files(folder, *endings)]
        choices += folders(folder, marks) if word == "FOLDER" or key in near else ()
    elif rule.kind == "number":
        kind = "numbers" if several else "number"
    else:
        kind = "text"
        if word == "BALL|DIAMETER":
            choices = [*_entries("balls", catalog.names("balls"))]
        elif command.name == "show":
            choices = [*folders(folder, ("result",))]
            choices += [
                pair for each in catalog.KINDS for pair in _entries(each, catalog.names(each))
            ]
    return kind, choices


@cache
def _entries(kind: str, names: tuple[str, ...]) -> list[tuple[str, str]]:
    """Return names and titles of entries of the catalog."""
    shipped = catalog.names(kind)
    titles = {name: catalog.title(kind, name) if name in shipped else name for name in names}
    return [*titles.items()]


def folders(folder: Path, kinds: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the folders below a folder that have one of some kinds, newest first."""
    marks, below = [mark for kind in kinds for mark in WORDS["marks"].get(kind, ())], _below(folder)
    found = {path.parent for path in below if path.name in marks}
    if "laboratory" in kinds:
        found |= {path.parent.parent for path in below if path.parent.name in OF_LABORATORY}
    for path in sorted(found, key=lambda each: -each.stat().st_mtime):
        yield str(path), str(path.relative_to(folder))


def _files(folder: Path, *endings: str) -> Iterator[tuple[str, str]]:
    """Yield the files below a folder with one of some endings; none of a result's."""
    for path in _below(folder):
        of_folder = (path.parent / "settings.toml").exists() or path.parent.name in OF_LABORATORY
        if path.suffix.lower() in endings and not of_folder:
            yield str(path), str(path.relative_to(folder))


def _below(folder: Path) -> list[Path]:
    """Return the files below a folder, without those of the page itself."""
    found = [
        path
        for depth in range(1, DEEPEST + 1)
        for path in folder.glob("/".join("*" * depth))
        if path.is_file() and path.relative_to(folder).parts[0] != "runs"
    ]
    return sorted(found)
