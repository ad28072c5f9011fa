"""The folder of a campaign: study, data sheets that its tests read, and state of its parts."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from virtual_lab import catalog
from virtual_lab.campaigns.parts import (
    COLUMN_SCHEMA,
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
from virtual_lab.campaigns.summary import (
    SUMMARY_WORDS,
    summary_columns,
    summary_of,
    with_all_flags,
)
from virtual_lab.catalog.reading import Key
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.files import new_folder, read_json, read_toml
from virtual_lab.files.dictionary import PER_ROW
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows

if TYPE_CHECKING:
    import pandas as pd

STUDY, STAMP, PARTS = "study.toml", "campaign.json", "parts"
INCOMPLETE = 4  # exit code of the program


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """State of the parts of a campaign. Parts are named by a description of their tests."""

    parts: int
    tests: int  # number of tests in the parts
    made: int = 0  # number of parts made by this run
    again: Mapping[str, str] = field(default_factory=dict)  # faults of parts made again
    missing: Mapping[str, str] = field(default_factory=dict)  # reasons for missing parts
    processors: tuple[str, ...] = ()  # families of the processors that made the parts

    @property
    def code(self) -> int:
        """Exit code of the program: 0 if no part is missing."""
        return INCOMPLETE if self.missing else 0

    @property
    def document(self) -> dict[str, Any]:
        """The account as a JSON object."""
        return asdict(self)

    @property
    def text(self) -> str:
        """The account as text."""
        present = self.parts - len(self.missing)
        lines = [f"{present} of {self.parts} parts exist, of which this run made {self.made}"]
        lines += [f"made again, {why}: {name}" for name, why in self.again.items()]
        lines += [f"missing, {why}: {name}" for name, why in self.missing.items()]
        if len(self.processors) > 1:
            kinds = ", ".join(self.processors)
            lines.append(f"several kinds of processors, whose results agree to 1e-9: {kinds}")
        return "\n".join(lines)


@dataclass(frozen=True, kw_only=True, repr=False)
class Campaign:
    """A study with its parts in a folder.

    `sheets` are the texts of all data sheets that the tests read, keyed by ``kind/name``. They are
    stored in the folder, so that the catalog may change during a campaign. `layouts` are the
    columns of the parts, by procedure.
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
            There is no campaign, it was changed, or another version of this program made it.
        """
        if not Path(folder).is_dir():
            raise InputError("", "folder", str(folder), "there is no such folder")
        path, study = Path(folder) / STAMP, read_study(Path(folder) / STUDY)
        stamp = read_json(path)
        if stamp.get("schema") != COLUMN_SCHEMA:
            allowed = (
                f"this version reads only schema {COLUMN_SCHEMA}; begin the campaign in a new "
                "folder (the parts here remain Parquet files)"
            )
            raise InputError(str(path), "schema", stamp.get("schema"), allowed)
        stamped = {key: stamp.get(key, {}) for key in ("sheets", "layouts")}
        campaign = cls(folder=Path(folder), study=study, **stamped)
        for key, value in {**PROGRAM, "digest": campaign.digest}.items():
            if stamp.get(key) != value:
                allowed = f"is of another version, or was changed; allowed in this folder: {value}"
                raise InputError(str(path), key, stamp.get(key), allowed)
        return campaign

    @classmethod
    def begin(cls, study: Study, text: str, folder: Path, progress: Progress = quiet) -> Campaign:
        """Return the campaign of a study in a folder, which is created if it is missing.

        `text` is the content of the study file. Raises `InputError` if the tests cannot use a value
        of the study, or if the folder belongs to another study.
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
        campaign = cls.open(folder)
        if campaign.study != study or campaign.sheets != campaign.sheets_today():
            allowed = "holds another campaign (study, data sheets or version); name another folder"
            raise InputError("", "output folder", str(folder), allowed)
        return campaign

    def sheets_today(self) -> dict[str, str]:
        """Return the current catalog texts of the sheets of this campaign, keyed by ``kind/name``.

        Raises `InputError` if a sheet is missing.
        """
        return {key: catalog.text(*key.split("/", 1)) for key in self.sheets}

    @cached_property
    def digest(self) -> str:
        """SHA-256 of study, sheets, columns, program version and schema."""
        return _hash([PROGRAM, asdict(self.study), self.sheets, self.layouts])

    @cached_property
    def cases(self) -> tuple[StudyCase, ...]:
        """All combinations of bats, procedures and changes."""
        return self.study.cases

    @property
    def parts(self) -> Path:
        """Folder of the parts."""
        return self.folder / PARTS

    @property
    def blocks(self) -> int:
        """Number of blocks of the study."""
        return len(self.cases) * self._blocks_per_case * self.study.repeats

    @property
    def _blocks_per_case(self) -> int:
        return -(-self.study.laboratories // ROWS)

    def block(self, number: int) -> Block:
        """Return a block by its number. Blocks are sorted by case, laboratories and day."""
        of_days, repeat = divmod(number, self.study.repeats)
        case, place = divmod(of_days, self._blocks_per_case)
        first, name = place * ROWS, f"{number:07}-{_hash([self.digest, number])[:16]}.parquet"
        rows = min(ROWS, self.study.laboratories - first)
        return Block(number, self.cases[case], repeat, first, rows, name)

    def share(self, text: str | None) -> range:
        """Return the numbers of the blocks of a share, such as ``3/40``; None means all blocks.

        Raises `InputError` if the string is not a share.
        """
        number, many = read_share(text)
        return range(self.blocks * (number - 1) // many, self.blocks * number // many)

    def layout(self, block: Block) -> PartColumns:
        """Return the columns of the part of a block: type and unit keyed by name."""
        layout = self.layouts[block.case.procedure]
        return {name: (type_, unit) for name, (type_, unit) in layout.items()}

    def tests(self, numbers: range) -> int:
        """Return the number of tests in a range of blocks."""

        def before(number: int) -> int:
            """Return the number of tests in all blocks before block `number`."""
            places, days = divmod(number, self.study.repeats)
            cases, place = divmod(places, self._blocks_per_case)
            rows = min(ROWS, self.study.laboratories - place * ROWS)
            laboratories = cases * self.study.laboratories + place * ROWS
            return laboratories * self.study.repeats + days * rows

        return before(numbers.stop) - before(numbers.start)

    def present_numbers(self) -> list[int]:
        """Return the numbers of all blocks that have a file, in order.

        Raises `InputError` if a file among the parts does not belong to this campaign.
        """
        numbers = []
        for name in sorted(path.name for path in self.parts.iterdir()):
            digits = re.match(r"\d{7,}", name, re.ASCII)
            number = int(digits[0]) if digits else self.blocks
            if number < self.blocks and self.block(number).name == name:
                numbers.append(number)
            elif not name.startswith("."):  # hidden files are drafts
                raise InputError(
                    str(self.parts), name, None, "is not part of this campaign; move it"
                )
        return sorted(numbers)

    def part(self, number: int, *, whole: bool = False) -> Part:
        """Return a part whose file exists; read its footer only, or the whole file if `whole`."""
        block = self.block(number)
        return read_part(block, self.layout(block), self.parts / block.name, whole=whole)

    def states(self, numbers: range, *, whole: bool = False) -> Iterator[Part]:
        """Yield the parts of a range of blocks, including parts without a file.

        Raises `InputError` in the same cases as `present_numbers`.
        """
        present = set(self.present_numbers())
        for number in numbers:
            absent = None if number in present else Part(self.block(number), NOT_MADE)
            yield absent or self.part(number, whole=whole)

    def check(self, progress: Progress = quiet) -> Account:
        """Read all parts completely, and return the account of all blocks."""
        return self.account(range(self.blocks), {}, progress, whole=True)

    def account(
        self, numbers: range, faults: Mapping[int, str], progress: Progress, *, whole: bool
    ) -> Account:
        """Return the account of a range of blocks; `faults` holds the reasons for missing parts."""
        missing, processors = {}, set()
        for finished, part in enumerate(self.states(numbers, whole=whole)):
            processors.add(part.processor)
            if part.wrong:
                missing[str(part.block)] = faults.get(part.block.number, part.wrong)
            progress("parts", finished, len(numbers))
        families, tests = tuple(sorted(processors - {""})), self.tests(numbers)
        return Account(parts=len(numbers), tests=tests, missing=missing, processors=families)

    def summary(self) -> Rows[dict[str, Any]]:
        """Return verdicts, means, errors and coverage of the tests [SI].

        The table has one row per combination of bat, procedure and changed settings. Raises
        `InputError` in the same cases as `states`.
        """
        numbers = range(self.blocks)
        cases = groupby(self.states(numbers, whole=True), key=lambda part: part.block.case)
        rows, changed = [], dict[str, Any]()
        for case, parts in cases:
            changed = self._changed_values(case)
            unit = self.layouts[case.procedure]["value"][1].removeprefix("1")
            rows.append(summary_of(case, changed, unit, parts))
        title = "{laboratories} laboratories of seed {seed}, tests in each: {repeats}"
        about = {"title": title.format_map(asdict(self.study)), "words": SUMMARY_WORDS}
        columns = summary_columns(changed)
        return Rows(name="campaign", rows=with_all_flags(rows), columns=columns, **about)

    def _changed_values(self, case: StudyCase) -> dict[str, Any]:
        """Return the values of the changed keys of a case keyed by column name."""
        texts = {cast("Key", tuple(key.split("/", 1))): text for key, text in self.sheets.items()}
        with catalog.sheets_in_place(texts):
            return {name: value for name, (value, _) in case.apply_changes()[1].items()}

    @property
    def table(self) -> pd.DataFrame:
        """All tests made so far, one row per test, without those in damaged parts.

        If there are none, the table has columns but no rows. ``attrs["units"]`` has the units of
        the columns; a unit that depends on the procedure is ``of the row``.
        """
        import pandas as pd
        import pyarrow as pa

        parts = (self.part(number, whole=True) for number in self.present_numbers())
        tables = [part.table() for part in parts if not part.wrong]
        table = (
            cast("pd.DataFrame", pa.concat_tables(tables).to_pandas())
            if tables
            else pd.DataFrame(columns=list(next(iter(self.layouts.values()))))
        )
        units = {
            name: {layout[name][1] for layout in self.layouts.values()} for name in table.columns
        }
        table.attrs["units"] = {
            name: each.pop() if len(each) == 1 else PER_ROW for name, each in units.items()
        }
        return table

    def __repr__(self) -> str:
        return f"<Campaign of {len(self.cases)} cases in {self.blocks} blocks, {self.folder}>"


def read_share(text: str | None) -> tuple[int, int]:
    """Return N and M of a share ``N/M`` of a campaign; None means ``1/1``.

    Raises `InputError` if the string is not a share.
    """
    digits = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text or "1/1")
    number, many = map(int, digits.groups()) if digits else (0, 0)
    if not 1 <= number <= many:
        allowed = "allowed: N/M for share N of M, from 1/40 to 40/40 for example"
        raise InputError("", "blocks", text, allowed)
    return number, many


def read_study(path: Path) -> Study:
    """Return the study that a .toml file describes.

    Raises `InputError` for a file that cannot be read, an unknown or missing key, or a value that
    is not allowed.
    """
    return validate(read_toml(path), str(path), Study)


def _hash(content: Any) -> str:
    return hashlib.blake2b(json.dumps(content, sort_keys=True).encode()).hexdigest()
