"""The data sheets of a laboratory from its own records, and the table that compares them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from virtual_lab import catalog
from virtual_lab.catalog.reading import Key
from virtual_lab.files import parse_toml
from virtual_lab.files.folders import TestFolders
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.session_reduction import reduce_block
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.parameters import paths_of
from virtual_lab.records.particulars import NOTHING_STATED, PARTICULARS, Particulars
from virtual_lab.sheets import toml_text
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.simulation.stations.rig import Stage
from virtual_lab.studies.foreign import certify_records, replaced_rigs, with_installed_rigs
from virtual_lab.studies.own_laboratory.ball import ball_of_tests
from virtual_lab.studies.own_laboratory.rig_sheets import (
    Document,
    RigSheets,
    SheetNumbers,
    StatedNumber,
    Statements,
    in_unit,
    inner_table,
    numbers_of,
    stated_rigs,
    write_numbers,
)
from virtual_lab.studies.own_laboratory.scatter import scatter_of_shots
from virtual_lab.uncertainty.estimate import Estimate

SOURCE = "stated in the records of {}"
DIFFERING = "The folders state different constants of {}; those of {} are used."
WORDS = (
    "Ours: stated in the records. Low, high: 95 % interval of a scatter that few readings show.\n"
    "{} numbers of these sheets stay as in the catalog, because the records do not state them."
)


def _text(number: Any) -> str:
    values = number if isinstance(number, list) else [number]
    return ", ".join("" if each is None else f"{each:.5g}" for each in values)


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnNumber:
    """A number of a data sheet as the records state it, beside that of the catalog."""

    sheet: str = column("sheet")
    key: str = column("key")
    ours: Any = column("ours", form=lambda row: _text(row.ours))
    low: float | None = column("low")  # limits of the 95 % interval of a scatter
    high: float | None = column("high")
    catalog: Any = column("catalog", form=lambda row: _text(row.catalog))
    unit: str = column("unit")
    record: str = column("record")  # constant or channel that states the number

    @classmethod
    def of(
        cls, sheet: Key, key: str, number: StatedNumber | None, usual: Mapping[str, Any]
    ) -> OwnNumber:
        """Return the row of a statement, or of a number that the sheet does not need."""
        value, old = number and number.value, usual.get(key, {})
        unit = old.get("unit", "1")
        low = high = None
        if number is not None and number.spread and number.spread.dof >= 1:
            low, high = (in_unit(limit, unit) for limit in number.spread.interval)
        return cls(
            sheet="/".join(sheet),
            key=key,
            ours=value,
            low=low,
            high=high,
            catalog=old.get("value"),
            unit=unit,
            record=number.record if number else "",
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class OwnLaboratory(StudyResult):
    """The sheets of a laboratory and its particulars, with a table of the changed numbers."""

    title: str
    rows: list[OwnNumber]
    sheets: Mapping[Key, str]  # texts of the sheets
    particulars: Particulars
    kept: int  # number of numbers that stay as in the catalog
    remark: str = ""  # rigs that stand for those of the records

    name = "laboratory"

    @property
    def text(self) -> str:
        """The table, with an explanation below it."""
        words = "\n".join(each for each in (WORDS.format(self.kept), self.remark) if each)
        return "\n\n".join([self.title, table_text(self.rows), words])

    @property
    def document(self) -> Json:
        """The result for JSON."""
        rows = [dict(record(row)) for row in self.rows]
        return {"title": self.title, "numbers": rows, "kept": self.kept, "remark": self.remark}

    def fill(self, folder: Path) -> None:
        """Write table, sheets and particulars into an existing folder."""
        super(OwnLaboratory, self).fill(folder)
        for (kind, name), text in self.sheets.items():
            (folder / kind).mkdir(exist_ok=True)
            (folder / kind / f"{name}.toml").write_text(text, encoding="utf-8")
        if stated := self.particulars.stated:
            names = {f'"{name}"': each for name, each in stated.pop("instruments", {}).items()}
            text = toml_text({**stated, "instruments": names})
            (folder / PARTICULARS).write_text(text, encoding="utf-8")


def laboratory(folders: TestFolders) -> OwnLaboratory:
    """Make data sheets of your own laboratory.

    They are those of its instruments, rigs and ball, made from its records. The sheets state the
    values and standard uncertainties of the certificates in the records, and the scatter that the
    readings show. Simulated hits at wall and bat scatter as those of the records. For each test,
    its u is compared with the rms of u over simulated tests, which have as many hits if all are at
    one position. What the records do not state stays as in the catalog. Save the result in a
    folder, and hand this folder to the other studies as their laboratory. Only records are read,
    never the sealed true values.

    Parameters
    ----------
    folders
        Result folder of ``certify``, its folder ``records``, or the folder of another laboratory
        with its ``laboratory.toml``. Several folders of one laboratory are pooled: scatters are the
        pooled ones of all. Constants are those of the last one, and the text names instruments for
        which other folders state other constants.

    Raises
    ------
    InputError
        The records in a folder cannot be used, the procedure would reject most of their balls, or a
        rig is not installed here.
    """
    paths = paths_of(folders)
    read, remarks = dict[tuple[Stage, str], list[RigSheets]](), dict[str, None]()
    particulars, tests, constants = NOTHING_STATED, [], list[Mapping[str, Estimate]]()
    for path in paths:
        certification = certify_records(path)
        tests.append(certification)
        theirs = certification.session
        session = with_installed_rigs(theirs, certification.procedure.rig)
        remarks |= dict.fromkeys(replaced_rigs(theirs, session))
        constants.append(session.calibration)
        scatter = scatter_of_shots(reduce_block(certification.block)[0])
        particulars = session.particulars
        for sheets in stated_rigs(session, scatter):
            read.setdefault((sheets.stage, sheets.rig), []).append(sheets)
    names = ", ".join(dict.fromkeys(path.resolve().name for path in paths))
    if differing := _differing_instruments(constants):
        remarks[DIFFERING.format(", ".join(differing), paths[-1].resolve().name)] = None
    pooled = {rig: _pool_days(each) for (_, rig), each in read.items()}
    found, texts, kept = list[OwnNumber](), dict[Key, str](), 0

    def add(key: Key, base: Key, numbers: SheetNumbers, parts: Mapping[str, str]) -> None:
        nonlocal kept
        document = parse_toml(*catalog.source(*base))
        usual = {path: table[last] for path, table, last in numbers_of(document)}
        found.extend(OwnNumber.of(key, path, numbers[path], usual) for path in sorted(numbers))
        kept += len(usual.keys() - numbers.keys())
        texts[key] = sheet_text(document, numbers, parts, SOURCE.format(names))

    for key, base, numbers, parts in sorted(restated_sheets(pooled), key=itemgetter(0)):
        add(key, base, numbers, parts)
    by_rules = groupby(sorted(tests, key=_rules), key=_rules)
    for days in (list(group) for _, group in by_rules):
        with catalog.sheets_in_place(texts):
            ball, numbers, remark = ball_of_tests(days)
        add(("balls", ball), ("balls", ball), numbers, {})
        remarks |= dict.fromkeys(remark)
    return OwnLaboratory(
        title=f"the laboratory of {names}",
        rows=found,
        sheets=texts,
        particulars=replace(
            NOTHING_STATED,
            laboratory=replace(particulars.laboratory, logo=""),
            instruments=particulars.instruments,
        ),
        kept=kept,
        remark="\n".join(remarks),
    )


def sheet_text(
    document: Document, numbers: SheetNumbers, parts: Mapping[str, str], source: str
) -> str:
    """Return the text of a sheet with other numbers and renamed parts."""
    document = deepcopy({**document, **parts})
    document.pop("identity", None)  # identities are among the particulars
    return toml_text(write_numbers(document, numbers, source))


def _rules(test: Certification) -> str:
    return test.session.procedure_text


def _differing_instruments(days: Sequence[Mapping[str, Estimate]]) -> list[str]:
    """Return the instruments of whose constants a day states another value or u than the last."""
    last = days[-1]
    return sorted(
        {
            name.rpartition(".")[0]
            for day in days
            for name, each in day.items()
            if name in last and (each.value, each.u) != (last[name].value, last[name].u)
        }
    )


def _pool_days(days: Sequence[RigSheets]) -> Statements:
    """Return the statements of the last day, with standard deviations pooled over all days."""
    pooled: Statements = {}
    for sheet, numbers in days[-1].statements.items():
        pooled[sheet] = dict(numbers)
        for key, number in numbers.items():
            if number is not None and number.spread:
                every = (day.statements[sheet].get(key) for day in days)
                spread = StandardDeviation.pool(
                    [each.spread for each in every if each and each.spread]
                )
                table, last = inner_table(days[-1].documents[sheet], key)
                value = in_unit(spread.value, table[last]["unit"])
                pooled[sheet][key] = replace(number, value=value, spread=spread)
    return pooled


def restated_sheets(
    rigs: Mapping[str, Statements],
) -> Iterator[tuple[Key, Key, SheetNumbers, dict[str, str]]]:
    """Yield key, key in the catalog, statements and renamed parts of each sheet.

    Two rigs may share the sheet of an instrument, such as a cannon, but state different numbers.
    Each then has a sheet of its own, whose name ends in the name of the rig.
    """
    merged: Statements = {}
    split = set[Key]()
    for statements in rigs.values():
        for sheet, numbers in statements.items():
            known = merged.setdefault(sheet, {})
            if any(known[key] != numbers[key] for key in known.keys() & numbers.keys()):
                split.add(sheet)
            known |= numbers
    for sheet in merged.keys() - split:
        rig = sheet[1] if sheet[0] == "rigs" else ""
        parts = {
            part: f"{name}-{rig}"
            for part, name in catalog.rig_instruments(rig).items()
            if ("instruments", name) in split
        }
        yield sheet, sheet, merged[sheet], parts
    for rig, statements in rigs.items():
        for kind, name in statements.keys() & split:
            yield (kind, f"{name}-{rig}"), (kind, name), statements[kind, name], {}
