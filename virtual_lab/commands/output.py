"""Files that a command writes: folder, table and figure of a result, and their paths."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from virtual_lab.api.describing import REQUIRED, ParameterDescription
from virtual_lab.errors import InputError
from virtual_lab.files import check_new_folder, check_writable, first_free
from virtual_lab.parameters import FILE, FOLDER, OUT, ParameterRule

LONGEST_NAME = 60  # largest length of a name within a folder's name [characters]
NAMED = ("seed", "number")  # parameters in the name of the default folder, if the user sets them
TABLES, PICTURES = (".csv",), (".png", ".svg", ".pdf")


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Result of a command that is not a `StudyResult`."""

    document: Any
    text: str
    table: Any = None
    code: int = 0  # exit code of the program
    save: Callable[[Path], object] | None = None
    files: Sequence[Path] = field(default_factory=tuple)  # written files; their paths are printed


@dataclass(frozen=True, kw_only=True)
class Output:
    """The rules by which the result of a command is saved, drawn and printed.

    A result is an object with a `document` for JSON and a `text`, like every `StudyResult`. It also
    has a method to save it, `table` and `plot` if the command writes these.

    Parameters
    ----------
    folder
        Name of the default folder in ``out/``, with parameters of the command in braces. `out`
        overrides it. Without a default folder, results are written only into `out`.
    beside
        Name of a parameter, a path, beside which the default folder is, instead of in ``out/``.
    page
        File in the folder. If it is written, its path is printed at the end, instead of the path
        of the folder.
    keeps
        Whether the command has the field `out`. With a default folder it always has it.
    table, picture
        Whether the command has the fields `csv` and `plot`.
    file
        Description of the .toml file that the command writes instead of a folder.
    into
        Name of the parameter that receives the folder, if the function writes its results itself.
    method
        Method of the result that saves it.
    frame
        Attribute of the result with the table; empty for a result that is a table.
    answer
        Function that converts the result to the `Answer` to print.
    """

    folder: str = ""
    beside: str = ""
    page: str = ""
    keeps: bool = False
    table: bool = False
    picture: bool = False
    file: str = ""
    into: str = ""
    method: str = "save"
    frame: str = ".table"
    answer: Callable[[Any], Any] = lambda result: result

    def parameters(self, others: Collection[str]) -> dict[str, ParameterDescription]:
        """Return folder or file, table and picture as parameters. `others` are the function's."""
        required = bool(self.file or (self.into and not self.folder))
        fields: list[tuple[str, ParameterRule, str]] = []
        if self.file:
            fields = [("out", FILE, self.file)]
        elif self.folder or self.keeps or required:
            words = "New folder for all results."
            if self.folder:
                usual = re.sub(r"{(\w+)}", lambda key: key[1].upper(), self.folder)
                added = " and ".join(f"-{each}-{each.upper()}" for each in NAMED if each in others)
                usual += f", followed by {added} if given" if added else ""
                usual = f"{usual} beside the {self.beside}" if self.beside else f"out/{usual}"
                words += f"  [default: {usual}; -2, -3, … if it exists]"
            fields = [("out", FOLDER, words)]
        if self.table:
            fields.append(("csv", FILE, "Write the table into a new .csv file."))
        if self.picture:
            fields.append(("plot", FILE, "Draw the figure into a new .png, .svg or .pdf file."))
        default = {"out": REQUIRED} if required else {}
        made = partial(ParameterDescription, keyword=True)
        return {
            name: made(name=name, rule=rule, default=default.get(name), words=words)
            for name, rule, words in fields
        }

    def target(self, given: Mapping[str, Any], defaults: Mapping[str, Any]) -> Path | None:
        """Return the folder or file of the result, or None, after a check of all new files.

        `given` holds the values that the user gave, and `defaults` the values of all parameters.
        Raises `InputError` for a folder or file that exists or cannot be written.
        """
        target: Path | None = given.get("out")
        if target is None and self.folder:
            target = first_free(self._usual_folder({**defaults, **given}, given))
        if target is not None and self.file:
            check_new_file(target, (".toml",))
            check_new_file(target.with_suffix(".png"), PICTURES)
        elif target is not None and (self.folder or not self.into):
            check_new_folder(target)
        for key, endings in (("csv", TABLES), ("plot", PICTURES)):
            if key in given:
                check_new_file(given[key], endings)
        return target

    def _usual_folder(self, values: Mapping[str, Any], given: Mapping[str, Any]) -> Path:
        """Return the default folder. Its name has seed and number only if the user gave them."""
        if self.beside:
            path = Path(values[self.beside])
            name = self.folder.format_map({self.beside: path.absolute().stem or self.beside})
            return path.parent / name
        parts = {key: _part(value) for key, value in values.items() if isinstance(value, str)}
        name = self.folder.format_map(parts)
        for key in NAMED:
            if key in given:
                name += f"-{key}-{given[key]}"
        return Path(OUT) / name


PRINTED = Output()
TABLE = Output(table=True)
STUDY = Output(keeps=True, table=True)
DRAWN = Output(keeps=True, table=True, picture=True)


def _part(value: str) -> str:
    """Return the part of a name or path that is used in the name of a folder."""
    return re.sub(r"[^\w.-]+", "-", Path(value).stem)[:LONGEST_NAME]


def check_new_file(path: Path, endings: Sequence[str]) -> None:
    """Raise `InputError` for a file that exists, cannot be written, or has another ending.

    `endings` are the allowed endings, such as ``.toml``, in the same case. A missing folder is
    allowed if it can be created.
    """
    if path.suffix not in endings:
        allowed = f"allowed: a name that ends in {', '.join(endings)}"
        raise InputError("", "file", str(path), allowed)
    try:
        there = path.exists() or path.is_symlink()
    except OSError as fault:
        raise InputError("", "file", str(path), f"cannot be written ({fault.strerror})") from fault
    if there:
        raise InputError("", "file", str(path), "exists already; name another file")
    check_writable(path, "file")
