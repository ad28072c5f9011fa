"""The line of a shell, and the lines of Python, that carry out a call."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path
from typing import Any

from virtual_lab.api.describing import REQUIRED
from virtual_lab.commands.call import Call
from virtual_lab.commands.running import check_target
from virtual_lab.sheets import Sheet

PROGRAM = "virtual-lab"


def shell_words(call: Call) -> list[str]:
    """Return the words of a command line that states the call, without quotes."""
    command = call.command
    places = [key for key in command.fields if command.takes_position(key)]
    last = max((places.index(key) + 1 for key in places if key in call.values), default=0)
    positional, options = [], []
    for key in places[:last]:  # an argument before one that is given must be stated
        positional += _words(call.values.get(key, command.fields[key].default))
    for key, value in call.values.items():
        if key not in places:
            option = command.option(key)
            if command.fields[key].rule.kind == "flag":
                options.append(f"--{option}" if value else f"--no-{option}")
            else:
                options += [each for word in _words(value) for each in (f"--{option}", word)]
    name = [PROGRAM, *command.name.split()]
    if any(word.startswith("-") for word in positional):
        return [*name, *options, "--", *positional]
    return [*name, *positional, *options]


def shell_line(call: Call, *, windows: bool = os.name == "nt") -> str:
    """Return the command line of a call, quoted for the shell of this computer."""
    words = shell_words(call)
    return subprocess.list2cmdline(words) if windows else shlex.join(words)


def python_line(call: Call) -> str:
    """Return the lines of Python that carry out the call and save its result.

    A folder that the command names itself gets the name that it would have now.
    """
    command, output = call.command, call.command.output
    target = call.values.get("out") or check_target(call)
    given = call.part(command.parameters)
    given |= {output.into: target} if output.into else {}
    if command.public_name:
        first, function = "import virtual_lab as vl", f"vl.{command.public_name}"
    else:
        module, function = command.location
        first = f"from {module} import {function}"
    how = {key: given.pop(key) for key in command.saved_by if key in given}
    places = [key for key, each in command.description.parameters.items() if not each.keyword]
    positional = []
    while places and places[0] in given:
        positional.append(_literal(given.pop(places.pop(0))))
    named = [f"{key}={_literal(value)}" for key, value in given.items()]
    line = f"{function}({', '.join([*positional, *named])})"
    saved = []
    if target and not output.into:
        saving = [_literal(target), *(f"{key}={_literal(value)}" for key, value in how.items())]
        saved.append(f".{output.method}({', '.join(saving)})")
    if "csv" in call.values:
        saved.append(f"{output.frame}.to_csv({_literal(call.values['csv'])}, index=False)")
    if "plot" in call.values:
        saved.append(f".plot({_literal(call.values['plot'])})")
    return "\n".join([first, f"result = {line}", *(f"result{each}" for each in saved)])


def _words(value: Any) -> list[str]:
    """Return a value, or the values of a tuple, as words of the command line."""
    values = value if isinstance(value, tuple) else (value,)
    return [_word(each) for each in values if each is not REQUIRED and each is not None]


def _word(value: Any) -> str:
    if isinstance(value, Sheet):
        return f"{value.name}={value.origin}"
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return str(value)


def _literal(value: Any) -> str:
    """Return the text of a value in Python."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_literal, value))}]" if len(value) > 1 else _literal(value[0])
    if isinstance(value, Sheet | Path):
        return repr(_word(value))
    return repr(value)
