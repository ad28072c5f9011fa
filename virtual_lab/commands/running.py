"""Carrying out a call: the function is called, and its result is written."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from virtual_lab.api.door import PROGRESS, SEALED, with_settings
from virtual_lab.commands.call import Call
from virtual_lab.errors import IncompleteError, InputError, without_if_it_fails
from virtual_lab.files import new_files
from virtual_lab.output.progress import Progress
from virtual_lab.parameters import SETTINGS


@dataclass(frozen=True, kw_only=True)
class CallOutcome:
    """The result of a call, and the paths that were written."""

    result: Any
    target: Path | None  # folder or file of the result
    files: Sequence[Path]  # table and figure
    missing: Sequence[str] = ()  # forms that could not be written, and the reasons


def check_target(call: Call) -> Path | None:
    """Return the folder or file of a call's result, after all checks that need no computation.

    Raises `InputError` for files or a key that cannot be used, and if an extra is missing.
    """
    command = call.command
    _check_saving(call.part(command.saved_by))
    defaults = {key: each.default for key, each in command.parameters.items()}
    return command.output.target(call.values, defaults)


def carry_out(call: Call, progress: Progress) -> CallOutcome:
    """Call the function of a command, and write its result.

    Files and folders are checked before the function is called. Raises `InputError` for bad input,
    and if the memory is too small.
    """
    command, output = call.command, call.command.output
    target = check_target(call)
    how = call.part(command.saved_by)
    given = {key: value for key, value in call.part(command.parameters).items() if key not in how}
    ours = {output.into: target, "out": target, PROGRESS: progress}
    more = {key: value for key, value in ours.items() if key in command.description.parameters}
    try:
        result = command.function(**given, **more)
    except MemoryError as fault:
        little = ": ".join(["not enough memory", *re.findall(r"\d\S* .iB", str(fault))])
        raise InputError("", little, None, "allowed: smaller numbers or files") from fault
    result = replace(result, **how) if how else result
    words = f"virtual-lab {command.name} --config {SETTINGS}"
    result = with_settings(result, words, given | how, sealed=command.name in SEALED)
    result = output.answer(result)
    missing: list[str] = []

    def form(path: Path) -> AbstractContextManager[None]:
        """Return a context in which a further file is made; if it fails, the folder is kept."""
        return without_if_it_fails(str(path), missing) if target else nullcontext()

    if target is not None and not output.into:
        progress(f"writing {target}")
        try:
            getattr(result, output.method)(target)
        except IncompleteError as fault:
            missing += fault.missing
    csv, plot = (call.values.get(key) for key in ("csv", "plot"))
    if csv is not None:
        from virtual_lab.files.tables import write_csv

        with form(csv), new_files(csv.parent) as draft:
            write_csv(result.table, draft / csv.name)
    if plot is not None:
        with form(plot), new_files(plot.parent) as draft:
            result.plot(draft / plot.name)
    files = [path for path in (csv, plot) if path and path.exists()]
    return CallOutcome(result=result, target=target, files=files, missing=missing)


def _check_saving(how: Mapping[str, Any]) -> None:
    """Refuse impossible options for saving a certificate, before the test begins."""
    if how.get("pdf"):
        from virtual_lab.certificate.pdf import require_pdf

        require_pdf(how.get("paper", "a4"))
    if how.get("sign"):
        from virtual_lab.certificate.signing import require_key

        require_key(how["sign"], private=True)
