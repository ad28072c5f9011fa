"""A call of a command: its arguments, read from texts or from a file of settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from virtual_lab.api.describing import REQUIRED, ParameterDescription, advice
from virtual_lab.api.door import INSTRUMENTS
from virtual_lab.commands.command import Command
from virtual_lab.errors import PARAMETER, InputError, nearest
from virtual_lab.parameters import ParameterRule


@dataclass(frozen=True)
class Call:
    """A command and the values that the user gave, by the names of its fields."""

    command: Command
    values: Mapping[str, Any]

    def part(self, fields: Mapping[str, ParameterDescription]) -> dict[str, Any]:
        """Return the given values of some fields."""
        return {key: value for key, value in self.values.items() if key in fields}


class RefusedError(InputError):
    """Values of a command that are not allowed. `faults` has one sentence per field."""

    def __init__(self, command: str, faults: Mapping[str, str]) -> None:
        self.faults = faults
        (key, words), *_ = faults.items()
        super().__init__(command, key, None, words)


def bind(command: Command, values: Mapping[str, Any]) -> Call:
    """Return the call of a command. A string is read as the command line reads a word.

    A value that is None is not given. Raises `RefusedError` with a sentence for each field that is
    unknown, missing or has a value that is not allowed.
    """
    given, faults = {}, {}
    for key, value in values.items():
        if key not in command.fields:
            allowed = ", ".join(command.fields)
            faults[key] = f"unknown, {nearest(key, command.fields)}allowed: {allowed}"
        elif value is not None:
            try:
                given[key] = read_value(command.fields[key].rule, value)
            except ValueError as fault:
                faults[key] = str(fault)
    for key, each in command.fields.items():
        if each.default is REQUIRED and values.get(key) is None:
            faults[key] = f"is missing; allowed: {each.rule.allowed}"
    if faults:
        raise RefusedError(command.name, faults)
    return Call(command, given)


def read_value(rule: ParameterRule, value: Any) -> Any:
    """Return a word, a list of words, or a value of a file as the function takes it.

    Raises `ValueError` with the value and what is allowed.
    """
    one = rule.several or rule
    try:
        if isinstance(value, str):
            return rule.read(one.parse(value))
        if rule.several and isinstance(value, list | tuple):
            value = [one.parse(each) if isinstance(each, str) else each for each in value]
        return rule.read(value)
    except InputError:
        raise
    except (TypeError, ValueError, KeyError, ArithmeticError) as fault:
        raise ValueError(f"{value!r}; {advice(rule, value)}") from fault


def settings_in(
    path: Path, name: str, parameters: Mapping[str, ParameterDescription]
) -> dict[str, Any]:
    """Return the values in a file of settings, keyed by parameter name.

    If a parameter takes several values, a single value becomes a list. The values of the key
    ``instruments`` are not checked. `name` is the name of the command in the error message.

    Raises `InputError` if the file is missing or not TOML, and for an unknown key or a value that
    is not allowed. The message names file and key.
    """
    from virtual_lab.files import parse_toml, read_text

    settings = parse_toml(read_text(path), str(path))
    for key, value in settings.items():
        if key not in parameters:
            allowed = f"unknown key, {nearest(key, parameters)}keys of {name}: "
            raise InputError(str(path), key, None, allowed + ", ".join(parameters))
        rule = parameters[key].rule
        try:
            if key != INSTRUMENTS:  # a string NAME=FILE in a file, a sheet in Python
                rule.read(value)
        except (TypeError, ValueError, KeyError, ArithmeticError) as fault:
            raise InputError(str(path), key, value, advice(rule, value)) from fault
        if rule.several and not isinstance(value, list):
            settings[key] = [value]
    return settings


def field_of(command: Command, fault: InputError) -> str:
    """Return the field of a command that an error belongs to; empty if there is none.

    The error names the field as its key, or else in braces in the advice.
    """
    advised = (match[1] for match in PARAMETER.finditer(fault.allowed))
    for name in (fault.key.strip("{}"), fault.where.strip("{}"), *advised):
        for key in command.fields:
            if name in (key, key.removesuffix("s")):
                return key
    return ""
