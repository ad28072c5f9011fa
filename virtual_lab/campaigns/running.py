"""Run of a campaign in this process, in several processes, or with Dask."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from virtual_lab.campaigns.folder import Account, Campaign, read_share, read_study
from virtual_lab.campaigns.parts import parquet
from virtual_lab.campaigns.study import IN_STUDY, Study
from virtual_lab.campaigns.workers import make_parts, threads_at
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml, read_text
from virtual_lab.files.drafts import draft_in
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.parameters import Address, AnyLaboratory, Folder, Positive, Share
from virtual_lab.sheets import AnyStudy, Instruments, toml_text

ATTEMPTS = 2  # number of attempts per block, because a worker may be killed


def campaign(
    study: AnyStudy | None,
    folder: Folder,
    *,
    workers: Positive = 1,
    blocks: Share | None = None,
    dask: Address | None = None,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> Account:
    """Simulate tests of bats in very many laboratories, and store them as Parquet files.

    Each file is a part of the campaign. If the run is interrupted, finished parts stay, and the
    next run makes only the parts that are missing or damaged. The exit code of the program is 4 if
    a part is still missing after two attempts. To read the tests, use `Campaign.open`.

    Parameters
    ----------
    study
        The study file, .toml.

        A mapping is also allowed, with the keys ``bats``, ``procedures``, ``laboratories`` and
        ``seed``, and optionally ``repeats`` and ``change``. If None, the study that is already in
        the folder is continued.
    folder
        Folder of the campaign. A campaign of the same study in this folder is continued.
    workers
        Number of processes on this machine, each with one thread; 1 uses the current process.
    blocks
        Compute only share N of M of the campaign, for example ``3/40`` in a job array. By default
        all of it.
    dask
        Address of a Dask scheduler, for example ``tcp://lab:8786`` (needs the extra ``dask``). Its
        workers replace the processes on this machine. They must have access to the same folder.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with a message, the number of tests done, and the total. During the
        preparation of a new campaign, combinations of bat, procedure and changed values are counted
        instead of tests. If it is not given, the functions of `virtual_lab` and the commands show
        the progress on stderr.

    Returns
    -------
    Account
        Numbers of parts and tests, and each missing part with the reason.

    Raises
    ------
    InputError
        The study or the share is not valid; `workers` is below 1; the folder belongs to another
        study or version, contains a file that is not part of a campaign, or cannot be written; the
        scheduler does not answer; or the extra ``campaign`` or ``dask`` is missing.
    """
    folder = Path(folder)
    parquet()  # raises an error if the extra is missing
    read_share(blocks)  # before the folder is made
    if dask is not None:
        threads_at(dask)
    opened = Campaign.open(folder) if study is None else _begin(study, folder, progress)
    numbers = opened.share(blocks)
    with draft_in(opened.parts):
        pass  # removes unfinished files of killed processes
    parts = [opened.part(number) for number in opened.present_numbers() if number in numbers]
    again = {str(part.block): part.wrong for part in parts if part.wrong}
    finished = {part.block.number: part.block.rows for part in parts if not part.wrong}
    done, tests = sum(finished.values()), opened.tests(numbers)
    todo: Iterable[int] = (number for number in numbers if number not in finished)
    for _ in range(ATTEMPTS):
        progress("laboratories", done, tests)
        faults: dict[int, str] = {}
        for number, fault in make_parts(folder, todo, workers if dask is None else dask):
            if isinstance(fault, InputError):
                raise fault
            if fault:
                faults[number] = fault
            else:
                done += opened.block(number).rows
                progress("laboratories", done, tests)
        todo = list(faults)
        if not todo:
            break
    account = opened.account(numbers, faults, quiet, whole=False)
    return replace(account, made=len(numbers) - len(finished) - len(account.missing), again=again)


def _begin(study: str | Path | Mapping[str, Any], folder: Path, progress: Progress) -> Campaign:
    if not isinstance(study, Mapping):
        study = Path(study)
        try:
            return Campaign.begin(read_study(study), read_text(study), folder, progress)
        except InputError as fault:
            where = str(study) if fault.where == IN_STUDY else fault.where
            raise InputError(where, fault.key, fault.value, fault.allowed) from fault
    change = {f'"{key}"': values for key, values in dict(study.get("change") or {}).items()}
    text = toml_text({**study, "change": change})
    validated = validate(parse_toml(text, IN_STUDY), IN_STUDY, Study)
    return Campaign.begin(validated, text, folder, progress)
