"""A campaign's folder: the study, the sheets that its tests read, and the parts made so far."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from virtual_lab.campaigns.account import Account
from virtual_lab.campaigns.parts import NOT_MADE, PROGRAM, ROWS, Block, parquet, wrong_with
from virtual_lab.campaigns.study import Study, StudyCase
from virtual_lab.campaigns.summary import SUMMARY_COLUMNS, SUMMARY_WORDS, summary_of
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.files import new_folder, read_json, read_toml
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows

if TYPE_CHECKING:
    import pandas as pd

STUDY, STAMP, PARTS = "study.toml", "campaign.json", "parts"


@dataclass(frozen=True, kw_only=True, repr=False)
class Campaign:
    """A study with its parts in a folder.

    `sheets` are the texts of all data sheets that its tests read, by ``kind/name``; they stand in
    the folder, so the catalog may change under a campaign.
    """

    folder: Path
    study: Study
    sheets: Mapping[str, str]

    @classmethod
    def open(cls, folder: str | Path) -> Campaign:
        """Return the campaign in a folder.

        Raises
        ------
        InputError
            No campaign, one of another version of this program, or a changed one.
        """
        path, study = Path(folder) / STAMP, read_study(Path(folder) / STUDY)
        stamp = read_json(path)
        found = cls(folder=Path(folder), study=study, sheets=stamp.get("sheets", {}))
        for key, value in {**PROGRAM, "digest": found.digest}.items():
            if stamp.get(key) != value:
                allowed = f"of another version, or changed; allowed in this folder: {value}"
                raise InputError(str(path), key, stamp.get(key), allowed)
        return found

    @classmethod
    def begin(cls, study: Study, text: str, folder: Path) -> Campaign:
        """Return the campaign of a study in its folder, which is made where missing.

        `text` is the study's file. `InputError` for what its tests cannot use, and for the folder
        of another study.
        """
        asked = cls(folder=folder, study=study, sheets=study.sheets())
        stamp = {**PROGRAM, "digest": asked.digest, "sheets": asked.sheets}
        try:
            if not (folder / STAMP).is_file():
                with new_folder(folder) as draft:
                    (draft / STUDY).write_text(text, encoding="utf-8")
                    (draft / STAMP).write_text(json.dumps(stamp, indent=1), encoding="utf-8")
                    (draft / PARTS).mkdir()
        except InputError:  # of two that begin at the same time one comes second
            if not (folder / STAMP).is_file():
                raise
        if read_json(folder / STAMP) != stamp:
            allowed = "holds another campaign (study, data sheets or version); name another"
            raise InputError("", "output folder", str(folder), allowed)
        return asked

    @cached_property
    def digest(self) -> str:
        """The hash of study, sheets, version and schema."""
        return _hash([PROGRAM, asdict(self.study), self.sheets])

    @cached_property
    def cases(self) -> tuple[StudyCase, ...]:
        """Bats by procedures by changes."""
        return self.study.cases

    @property
    def parts(self) -> Path:
        """The folder of the parts."""
        return self.folder / PARTS

    @property
    def blocks(self) -> int:
        """How many blocks the study has."""
        return len(self.cases) * self._of_case * self.study.repeats

    @property
    def _of_case(self) -> int:
        return -(-self.study.laboratories // ROWS)

    def block(self, number: int) -> Block:
        """Return a block by its number: by case, laboratories and day, the last the fastest."""
        rest, repeat = divmod(number, self.study.repeats)
        case, place = divmod(rest, self._of_case)
        first, name = place * ROWS, f"{number:07}-{_hash([self.digest, number])[:16]}.parquet"
        rows = min(ROWS, self.study.laboratories - first)
        return Block(number, self.cases[case], repeat, first, rows, name)

    def share(self, asked: str | None) -> range:
        """Return the blocks of a share, ``3/40`` for the third fortieth; None for all."""
        digits = re.fullmatch(r"(\d{1,9})/(\d{1,9})", asked or "1/1")
        one, many = map(int, digits.groups()) if digits else (0, 0)
        if not 1 <= one <= many:
            raise InputError("", "blocks", asked, "allowed: N/M, share N of M, as 1/40 to 40/40")
        return range(self.blocks * (one - 1) // many, self.blocks * one // many)

    def states(self, numbers: range, *, whole: bool = False) -> Iterator[tuple[Block, str, str]]:
        """Yield blocks, what is wrong with their parts ('' if nothing), and who made them.

        A part is read by its footer, or to its last page if `whole`. `InputError` for a file among
        the parts that is none of this campaign.
        """
        there = {path.name for path in self.parts.iterdir() if not path.name.startswith(".")}
        for name in there - {self.block(number).name for number in range(self.blocks)}:
            raise InputError(str(self.parts), name, None, "is no part of this campaign; move it")
        for block in map(self.block, numbers):
            lost = (NOT_MADE, "") if block.name not in there else None
            yield block, *(lost or wrong_with(self.parts / block.name, block, whole=whole))

    def check(self, progress: Progress = quiet) -> Account:
        """Read every part to its last page, and account for the blocks."""
        return self.account(range(self.blocks), {}, progress, whole=True)

    def account(
        self, numbers: range, faults: Mapping[int, str], progress: Progress, *, whole: bool
    ) -> Account:
        """Account for blocks, as `states`; `faults` are why some are missing, where known."""
        missing, processors, rows = {}, set(), 0
        for done, (block, wrong, by) in enumerate(self.states(numbers, whole=whole)):
            rows += block.rows
            processors.add(by)
            if wrong:
                missing[str(block)] = faults.get(block.number, wrong)
            progress("parts", done, len(numbers))
        families = tuple(sorted(processors - {""}))
        return Account(parts=len(numbers), tests=rows, missing=missing, processors=families)

    def summary(self) -> Rows[dict[str, Any]]:
        """Return a row for each bat, procedure and change: verdicts, means, errors, coverage; SI.

        `InputError` as `states`.
        """
        cases = groupby(self.states(range(self.blocks)), key=lambda each: each[0].case)
        rows = [summary_of(case, self.parts, own) for case, own in cases]
        title = "{laboratories} laboratories of seed {seed}, tests in each: {repeats}"
        about = {"title": title.format_map(asdict(self.study)), "words": SUMMARY_WORDS}
        return Rows(name="campaign", rows=rows, columns=SUMMARY_COLUMNS, **about)

    @property
    def table(self) -> pd.DataFrame:
        """All tests made so far, a row each."""
        import pyarrow as pa

        good = (block for block, wrong, _ in self.states(range(self.blocks)) if not wrong)
        tables = [parquet().read_table(self.parts / block.name) for block in good]
        return cast("pd.DataFrame", pa.concat_tables(tables, promote_options="default").to_pandas())

    def __repr__(self) -> str:
        return f"<Campaign of {len(self.cases)} cases in {self.blocks} blocks, {self.folder}>"


def read_study(path: Path) -> Study:
    """Return the study in a file; `InputError` names the key that does not fit."""
    return validate(read_toml(path), str(path), Study)


def _hash(known: Any) -> str:
    return hashlib.blake2b(json.dumps(known, sort_keys=True).encode()).hexdigest()
