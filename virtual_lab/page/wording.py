"""Words of the page: fields instead of options, sentences without names of programs."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

from virtual_lab.api.describing import REQUIRED, ParameterDescription
from virtual_lab.catalog.reading import DATA
from virtual_lab.commands.call import field_of
from virtual_lab.commands.command import Command
from virtual_lab.errors import InputError, name_parameters
from virtual_lab.files import parse_toml
from virtual_lab.parameters import ParameterRule

WORDS = parse_toml((DATA / "page" / "words.toml").read_text("utf-8"), "words.toml")
# replaces names and .toml files in the help of a command
OFFERED = ", from the catalog or a file of your own in the folder above"


def title_of(key: str) -> str:
    """Return the title of a field."""
    return str(WORDS["titles"].get(key) or key.replace("_", " ").capitalize())


def field_name(key: str, value: str = "") -> str:
    """Return the title of a field, and a value for it, as a message names it.

    A pattern such as ``X,Y@FRAME`` is no value: the field shows its own.
    """
    return f"“{title_of(key)}”" + (f" = {value}" if value and not value.isupper() else "")


def plain(words: str) -> str:
    """Return the first paragraph of a description, without marks of code.

    The further paragraphs speak to programmers.
    """
    text = " ".join(words.split("\n\n", maxsplit=1)[0].split())
    text = re.sub(r":( a name| names) in the catalog or( a)? \.toml files?", OFFERED, text)
    return re.sub(r"``(.*?)``|`~?(.*?)`", _name, text)


def notes(command: Command, each: ParameterDescription, choices: Collection[object]) -> str:
    """Return the words below the control of a parameter: its description and its limits."""
    if note := WORDS["notes"].get(command.name, {}).get(each.name):
        return str(note)
    allowed = "" if choices else limits(each.rule.several or each.rule)
    return f"{plain(each.words)} {allowed and f'Allowed: {allowed}.'}".strip()


def texts(value: Any) -> tuple[str, ...]:
    """Return a default, or the values of a call, as texts of a form."""
    if value in (REQUIRED, None, False, (), ""):
        return ()
    values = value if isinstance(value, tuple | list) else (value,)
    return tuple("yes" if each is True else str(each) for each in values)


def refusal(command: Command, fault: InputError, values: Mapping[str, Any]) -> tuple[str, str]:
    """Return the field of a command that an error belongs to, or "", and a sentence about it.

    It is the field that the error names, or the one of whose `values` is the file in the error.
    """
    key, allowed = field_of(command, fault), name_parameters(fault.allowed)
    if key:
        sentence = allowed if fault.value is None else f"“{fault.value}” cannot be used: {allowed}"
        return key, sentence[:1].upper() + sentence[1:]
    files = (name for name, each in values.items() if fault.where and fault.where in texts(each))
    return next(files, ""), str(fault) if fault.key or fault.where else allowed


def limits(rule: ParameterRule) -> str:
    """Return the allowed values of a rule as words on the page; may be empty."""
    if rule.kind == "number":
        return rule.limits
    words = rule.kind in ("text", "name") and rule.metavar != "TEXT"
    return rule.allowed.replace("'", "") if words and "vl." not in rule.allowed else ""


def _name(match: re.Match[str]) -> str:
    text = match[1] or match[2]
    return f"“{title_of(text)}”" if re.fullmatch(r"[a-z]+(_[a-z]+)*", text) and match[2] else text
