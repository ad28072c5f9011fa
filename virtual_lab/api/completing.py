"""Completion in IPython and Jupyter: names in ``vl.bat("`` TAB, keys in ``sheet.with_(`` TAB."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

from virtual_lab import api, catalog
from virtual_lab.api.describing import describe
from virtual_lab.sheets import Sheet

CLOSED = re.compile(r"\([^()]*\)")  # arguments of a call that has ended
# the open call: function, arguments before the word, quotation mark, word to be completed
CALL = re.compile(r"""(\w+)\(([^()]*?)(["']?)([^"'(){},=\s]*)$""")
# the sheet of the last `with_`: kind and name, or a variable
SHEET = re.compile(r""".*(?:\b(\w+)\(["']([^"']*)["']\)|\b(\w+))\.with_\(""", re.DOTALL)


def complete_in(shell: Any) -> None:
    """Let an IPython shell complete names and keys of this package, before all else."""

    def match(context: Any) -> dict[str, Any]:
        lines = context.full_text.split("\n")[: context.cursor_line]
        words, typed = completions("\n".join([*lines, context.text_until_cursor]), shell.user_ns)
        found = [SimpleNamespace(text=word, type=None) for word in words]
        return {"completions": found, "matched_fragment": typed, "suppress": bool(found)}

    match.matcher_api_version = 2  # type: ignore[attr-defined]
    shell.Completer.custom_matchers.append(match)


def completions(text: str, variables: Mapping[str, Any]) -> tuple[list[str], str]:
    """Return the words that may follow a text, and the part of them that the text ends with.

    `text` is a program up to the cursor, and `variables` are the values of its variables.
    """
    call = CALL.search(CLOSED.sub("", text))
    function, before, quote, typed = call.groups() if call else ("", "", "", "")
    words: Iterable[str] = ()
    if function == "with_" and re.search(r"(^|[,{])\s*$", before):
        words = keys = _keys(text, variables)
        if not quote:
            dotted = [] if before.strip() else [f'{{"{key}": ' for key in keys if "." in key]
            words = [*(f"{key}=" for key in keys if "." not in key), *dotted]
    elif quote and f"{function}s" in catalog.KINDS:
        words = catalog.names(f"{function}s")
    elif quote and function in api.PLACES and function.islower():
        parameters = describe(*api.PLACES[function]).parameters
        for key in (re.findall(r"(\w+)\s*=", before) or [*parameters][:1])[-1:]:
            words = parameters[key].rule.complete() if key in parameters else ()
    return [word for word in words if word.startswith(typed)], typed


def _keys(text: str, variables: Mapping[str, Any]) -> list[str]:
    """Return the keys of the numbers of the sheet on which a text calls `with_`."""
    call = SHEET.match(text)
    kind, name, variable = call.groups() if call else ("", "", "")
    sheet = variables.get(variable)
    if kind and name in catalog.names(f"{kind}s"):
        sheet = Sheet.of(f"{kind}s", name)
    return [each.key for each in sheet.datums] if isinstance(sheet, Sheet) else []
