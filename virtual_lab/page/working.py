"""The work of a run, in a process of its own."""

from __future__ import annotations

import json
import re
import time
import traceback
from collections.abc import Mapping
from contextlib import redirect_stderr
from pathlib import Path
from typing import Any

from virtual_lab.commands.call import bind
from virtual_lab.commands.lines import python_line, shell_line
from virtual_lab.commands.running import carry_out
from virtual_lab.commands.table import every_command
from virtual_lab.commands.wording import parameters_named
from virtual_lab.errors import InputError
from virtual_lab.files import whole_file
from virtual_lab.output.progress import show_progress
from virtual_lab.page.fields import is_new
from virtual_lab.page.wording import field_name, refusal

CALL, OUTCOME, PROGRESS_LINE, SAID = "call.json", "outcome.json", "progress.txt", "said.txt"
BY_ITSELF = {"operator", "script", "replay"}  # fields with which a day needs no bench
BLANK: dict[str, Any] = {  # an outcome without a result
    **dict.fromkeys(("answer", "text", "refused", "field", "shell", "python"), ""),
    **dict.fromkeys(("flags", "warnings", "written", "missing"), ()),
    "seconds": 0.0,
}


def serves_bench(call: Mapping[str, Any]) -> bool:
    """Return whether a call serves the bench, until the run is ended."""
    return call["command"] == "rehearse" and not call["values"].keys() & BY_ITSELF


class ProgressFile:
    """A stream that keeps its last line in a file. It claims to be a terminal to get a bar."""

    encoding = "utf-8"

    def __init__(self, path: Path) -> None:
        self.path = path

    def isatty(self) -> bool:
        """Return True, so that progress is shown five times per second."""
        return True

    def write(self, text: str) -> None:
        """Replace the line in the file, without the bar."""
        line = re.sub(r"\s*\|.*\|", ":", text).strip()
        if line:
            self.path.write_text(line, encoding="utf-8")

    def flush(self) -> None:
        """Do nothing: a line is written at once."""


@parameters_named(field_name)
def carry_out_run(path: Path) -> None:
    """Carry out the call that the folder of a run describes, and write its outcome there."""
    request = json.loads((path / CALL).read_text("utf-8"))
    command, values = every_command()[request["command"]], request["values"]
    began = time.monotonic()
    outcome: dict[str, Any] = {}
    try:
        call = bind(command, values)
        outcome = {"shell": shell_line(call), "python": python_line(call)}
        bar: Any = ProgressFile(path / PROGRESS_LINE)
        with (path / SAID).open("w") as said, redirect_stderr(said), show_progress(bar) as progress:
            done = carry_out(call, progress)
        new = [values.get(key) for key, each in command.parameters.items() if is_new(each)]
        written = [done.target, *done.files, *getattr(done.result, "files", ()), *new]
        outcome |= {
            **answer_of(done.result),
            "text": str(done.result.text),
            "written": [*dict.fromkeys(str(each) for each in written if each)],
            "missing": list(done.missing),
        }
    except InputError as fault:
        outcome["field"], outcome["refused"] = refusal(command, fault, values)
    except OSError as fault:
        outcome |= {"refused": f"{fault.filename or 'file'}: {fault.strerror}"}
    except Exception:
        bug = "a bug in this program, not in your input; please report the text below"
        outcome |= {"refused": bug, "text": traceback.format_exc()}
    outcome["seconds"] = time.monotonic() - began
    write_json(path / OUTCOME, outcome)


def answer_of(result: Any) -> dict[str, Any]:
    """Return the answer of a result, its first line or its files, its flags, and its warnings."""
    files = ", ".join(map(str, getattr(result, "files", ())))
    sentence = result.text.strip().partition("\n")[0] or files or "Done"
    document = result.document if isinstance(result.document, dict) else {}
    names = [each["name"] if isinstance(each, dict) else each for each in document.get("flags", [])]
    # a symbol such as e or v_f stays as it is
    answer = sentence[:1].upper() + sentence[1:] if sentence[1:2].isalpha() else sentence
    return {"answer": answer, "flags": names, "warnings": document.get("warnings", [])}


def write_json(path: Path, content: object) -> None:
    """Write a file that a reader sees whole or not at all."""
    with whole_file(path) as file:
        file.write(json.dumps(content, default=str).encode())
