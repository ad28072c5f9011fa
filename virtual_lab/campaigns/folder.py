"""A campaign's folder: the study, the sheets that its tests read, and the parts made so far."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from virtual_lab import catalog
from virtual_lab.campaigns.account import Account
from virtual_lab.campaigns.parts import (
    NOT_MADE,
    PROGRAM,
    ROWS,
    Block,
    Part,
    PartColumns,
    layouts_of,
    read_part,
)
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

    `sheets` are the texts of all data sheets that its tests read, by ``kind/name``; they are
    kept in the folder, so that the catalog may change during a campaign. `layouts` are the
    columns of its parts, by procedure.
    """

    folder: Path
    study: Study
    sheets: Mapping[str, str]
    layouts: Mapping[str, Mapping[str, Sequence[str]]]

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
        kept = {key: stamp.get(key, {}) for key in ("sheets", "layouts")}
        found = cls(folder=Path(folder), study=study, **kept)
        for key, value in {**PROGRAM, "digest": found.digest}.items():
            if stamp.get(key) != value:
                allowed = f"of another version, or changed; allowed in this folder: {value}"
                raise InputError(str(path), key, stamp.get(key), allowed)
        return found

    @classmethod
    def begin(cls, study: Study, text: str, folder: Path, progress: Progress = quiet) -> Campaign:
        """Return the campaign of a study in its folder, which is created if missing.

        `text` is the study's file. `InputError` for what its tests cannot use, and for the folder
        of another study.
        """
        if not (folder / STAMP).is_file():
            sheets, layouts = study.sheets(progress), layouts_of(study, progress)
            new = cls(folder=folder, study=study, sheets=sheets, layouts=layouts)
            stamp = {**PROGRAM, "digest": new.digest, "sheets": sheets, "layouts": layouts}
            try:
                with new_folder(folder) as draft:
                    (draft / STUDY).write_text(text, encoding="utf-8")
                    (draft / STAMP).write_text(json.dumps(stamp, indent=1), encoding="utf-8")
                    (draft / PARTS).mkdir()
            except InputError:  # another process may have just begun it
                if not (folder / STAMP).is_file():
                    raise
        found = cls.open(folder)
        if found.study != study or found.sheets != found.sheets_today():
            allowed = "holds another campaign (study, data sheets or version); name another"
            raise InputError("", "output folder", str(folder), allowed)
        return found

    def sheets_today(self) -> dict[str, str]:
        """Return the present texts of its sheets in the catalog; `InputError` if one is missing."""
        return {key: catalog.text(*key.split("/", 1)) for key in self.sheets}

    @cached_property
    def digest(self) -> str:
        """The hash of study, sheets, columns, version and schema."""
        return _hash([PROGRAM, asdict(self.study), self.sheets, self.layouts])

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
        """The number of blocks of the study."""
        return len(self.cases) * self._of_case * self.study.repeats

    @property
    def _of_case(self) -> int:
        return -(-self.study.laboratories // ROWS)

    def block(self, number: int) -> Block:
        """Return a block by its number. Blocks are ordered by case, laboratories and day."""
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

    def layout(self, block: Block) -> PartColumns:
        """Return the columns of a block's part: type and unit by name."""
        layout = self.layouts[block.case.procedure]
        return {name: (type_, unit) for name, (type_, unit) in layout.items()}

    def tests(self, numbers: range) -> int:
        """Return the number of tests in blocks."""

        def before(number: int) -> int:
            """Return the number of tests in all blocks before one."""
            places, days = divmod(number, self.study.repeats)
            cases, place = divmod(places, self._of_case)
            rows = min(ROWS, self.study.laboratories - place * ROWS)
            laboratories = cases * self.study.laboratories + place * ROWS
            return laboratories * self.study.repeats + days * rows

        return before(numbers.stop) - before(numbers.start)

    def numbers_there(self) -> list[int]:
        """Return the numbers of all blocks that have a file, in order.

        `InputError` for a file among the parts that does not belong to this campaign.
        """
        numbers = []
        for name in sorted(path.name for path in self.parts.iterdir()):
            digits = re.match(r"\d{7,}", name, re.ASCII)
            number = int(digits[0]) if digits else self.blocks
            if number < self.blocks and self.block(number).name == name:
                numbers.append(number)
            elif not name.startswith("."):  # hidden files are drafts
                raise InputError(
                    str(self.parts), name, None, "is no part of this campaign; move it"
                )
        return sorted(numbers)

    def part(self, number: int, *, whole: bool = False) -> Part:
        """Return a part that has a file, read by its footer, or to its last byte if `whole`."""
        block = self.block(number)
        return read_part(block, self.layout(block), self.parts / block.name, whole=whole)

    def states(self, numbers: range, *, whole: bool = False) -> Iterator[Part]:
        """Yield the parts of blocks, as `part`; also of those without a file.

        `InputError` as `numbers_there`.
        """
        there = set(self.numbers_there())
        for number in numbers:
            lost = None if number in there else Part(self.block(number), NOT_MADE)
            yield lost or self.part(number, whole=whole)

    def check(self, progress: Progress = quiet) -> Account:
        """Read every part to its last byte, and account for the blocks."""
        return self.account(range(self.blocks), {}, progress, whole=True)

    def account(
        self, numbers: range, faults: Mapping[int, str], progress: Progress, *, whole: bool
    ) -> Account:
        """Account for blocks, as `states`; `faults` has the known reasons for missing parts."""
        missing, processors = {}, set()
        for done, part in enumerate(self.states(numbers, whole=whole)):
            processors.add(part.processor)
            if part.wrong:
                missing[str(part.block)] = faults.get(part.block.number, part.wrong)
            progress("parts", done, len(numbers))
        families, tests = tuple(sorted(processors - {""})), self.tests(numbers)
        return Account(parts=len(numbers), tests=tests, missing=missing, processors=families)

    def summary(self) -> Rows[dict[str, Any]]:
        """Return verdicts, means, errors and coverage [SI], one row per bat, procedure and change.

        `InputError` as `states`.
        """
        numbers = range(self.blocks)
        cases = groupby(self.states(numbers, whole=True), key=lambda part: part.block.case)
        rows = [summary_of(case, own) for case, own in cases]
        title = "{laboratories} laboratories of seed {seed}, tests in each: {repeats}"
        about = {"title": title.format_map(asdict(self.study)), "words": SUMMARY_WORDS}
        return Rows(name="campaign", rows=rows, columns=SUMMARY_COLUMNS, **about)

    @property
    def table(self) -> pd.DataFrame:
        """All tests made so far, one row per test."""
        import pandas as pd
        import pyarrow as pa

        parts = (self.part(number, whole=True) for number in self.numbers_there())
        tables = [part.table() for part in parts if not part.wrong]
        if not tables:
            return pd.DataFrame(columns=list(next(iter(self.layouts.values()))))
        return cast("pd.DataFrame", pa.concat_tables(tables).to_pandas())

    def __repr__(self) -> str:
        return f"<Campaign of {len(self.cases)} cases in {self.blocks} blocks, {self.folder}>"


def read_study(path: Path) -> Study:
    """Return the study in a file; `InputError` names the key that does not fit."""
    return validate(read_toml(path), str(path), Study)


def _hash(known: Any) -> str:
    return hashlib.blake2b(json.dumps(known, sort_keys=True).encode()).hexdigest()
