"""Kinds of folders by their content, and types of parameters that take one of these kinds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Protocol, runtime_checkable

from virtual_lab.errors import InputError
from virtual_lab.parameters import FOLDER, ParameterRule, read_path, several

# kinds of folders: the files that tell the kind, and the name of the kind
KINDS = {
    "result": (("certificate.json",), "a result folder"),
    "campaign": (("campaign.json",), "a campaign"),
    "day": (("day.sqlite",), "a day of a rehearsal"),
    "records": (("session.json", "laboratory.toml"), "a folder of records"),
    "laboratory": (("laboratory.csv",), "a laboratory"),
}


@runtime_checkable
class Certified(Protocol):
    """A result with a certification, such as a certificate."""

    @property
    def certification(self) -> Any: ...


def folder_kinds(folder: Path) -> set[str]:
    """Return the kinds of a folder, keys of `KINDS`. A rehearsed day is also a result.

    A folder that is missing or empty is ``new``. The set is empty for a file and for any other
    folder.
    """
    try:
        names = {each.name for each in folder.iterdir()} if folder.exists() else set()
    except (OSError, ValueError):  # a file, no permission, a name too long or with a NUL character
        return set()
    kinds = {kind for kind, (marks, _) in KINDS.items() if names.intersection(marks)}
    return kinds if names else {"new"}


def folder_rule(*kinds: str) -> ParameterRule:
    """Return the rule of a folder that may have the content of some kinds.

    A folder of another kind is rejected. A folder of no kind is left to the function, whose error
    names the file that is missing.
    """
    words = {kind: f"{name} ({' or '.join(marks)})" for kind, (marks, name) in KINDS.items()}
    allowed = " or ".join(words.get(kind, "a new folder") for kind in kinds)

    def read(value: Any) -> Path:
        path = read_path(value)
        others = folder_kinds(path) & words.keys()
        if others and others.isdisjoint(kinds):
            found = f"is {words[min(others)]}; allowed: {allowed}"
            raise InputError(str(path), "folder", None, found)
        return path

    return replace(FOLDER, read=read, allowed=f"the path of {allowed}", holds=kinds)


NewFolder = Annotated[str | Path, folder_rule("new")]
ResultFolder = Annotated[str | Path, folder_rule("result")]
ResultFolders = Annotated[str | Path | Sequence[str | Path], several(folder_rule("result"))]
RecordsFolder = Annotated[str | Path, folder_rule("records")]
RECORDS = folder_rule("result", "records")
AnyRecords = Annotated[
    str | Path | Certified,
    replace(
        RECORDS,
        read=lambda value: value if isinstance(value, Certified) else RECORDS.read(value),
        allowed=f"{RECORDS.allowed}, or a certificate",
    ),
]
TestFolders = Annotated[
    str | Path | Sequence[str | Path], several(folder_rule("result", "records"))
]
CampaignFolder = Annotated[str | Path, folder_rule("campaign")]
DayFolder = Annotated[str | Path, folder_rule("day")]
