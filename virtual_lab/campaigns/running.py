"""The blocks of a campaign made: here, by processes of this machine, or by those of Dask."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from virtual_lab.campaigns.account import Account
from virtual_lab.campaigns.folder import Campaign, read_study
from virtual_lab.campaigns.parts import NOT_MADE, parquet
from virtual_lab.campaigns.study import Study
from virtual_lab.campaigns.workers import made_by
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml, read_text
from virtual_lab.files.drafts import draft_in
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.sheets import toml_text

ATTEMPTS = 2  # at a block, in case its worker was killed


def campaign(
    study: Path | Mapping[str, Any] | None,
    folder: Path,
    *,
    workers: int = 1,
    blocks: str | None = None,
    dask: str | None = None,
    progress: Progress = quiet,
) -> Account:
    """Certify bats in very many laboratories, into a folder of Parquet files.

    What was made stays, whatever ends this: called again, it makes the parts that are not there.
    `Campaign.open` reads the folder.

    Parameters
    ----------
    study
        The study file, or its keys and values: ``bats``, ``procedures``, ``laboratories``,
        ``seed``, and ``repeats`` and ``change`` if wanted. None: the study in the folder.
    folder
        Folder of the campaign, new or of this study.
    workers
        How many processes of this machine, each with one thread; 1 works in this process.
    blocks
        The share of the parts, ``"3/40"`` for the third fortieth; None for all.
    dask
        The address of a Dask scheduler whose workers see the same folder; `workers` are not used.
    progress
        Called with the number of laboratories done.

    Raises
    ------
    InputError
        A study that cannot be used, a folder of another study or version, a file among the parts
        that is none, a share that does not exist, a scheduler that does not answer, a folder that
        cannot be written, the extra ``campaign`` or ``dask`` missing.
    """
    parquet()  # its extra is missed before any work
    known = Campaign.open(folder) if study is None else _begun(study, folder)
    numbers = known.share(blocks)
    with draft_in(known.parts):
        pass  # takes away what killed processes left half-written
    found = [(block, wrong) for block, wrong, _ in known.states(numbers)]
    rows = sum(block.rows for block, _ in found)
    again = {str(block): wrong for block, wrong in found if wrong not in ("", NOT_MADE)}
    todo = {block.number: wrong for block, wrong in found if wrong}
    asked, done = len(todo), sum(block.rows for block, wrong in found if not wrong)
    for _ in range(ATTEMPTS):
        progress("laboratories", done, rows)
        for number, fault in made_by(folder, list(todo), workers if dask is None else dask):
            if isinstance(fault, InputError):
                raise fault
            todo[number] = fault
            if not fault:
                done += known.block(number).rows
                progress("laboratories", done, rows)
        todo = {number: fault for number, fault in todo.items() if fault}
    account = known.account(numbers, todo, quiet, whole=False)
    return replace(account, made=asked - len(account.missing), again=again)


def _begun(study: Path | Mapping[str, Any], folder: Path) -> Campaign:
    if isinstance(study, Path):
        return Campaign.begin(read_study(study), read_text(study), folder)
    change = {f'"{key}"': values for key, values in dict(study.get("change") or {}).items()}
    text = toml_text({**study, "change": change})
    return Campaign.begin(validate(parse_toml(text, "study"), "study", Study), text, folder)
