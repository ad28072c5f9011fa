"""Empty forms for the records of another laboratory.

The forms are made from a simulated test, so they have the rigs, records and constants that the
procedure needs.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import get_args

from virtual_lab import catalog
from virtual_lab.catalog.reading import DATA
from virtual_lab.catalog.specs import CHECK_STANDARD, Construction
from virtual_lab.files import check_new_folder, new_files, new_folder, read_text
from virtual_lab.files.folders import NewFolder
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.reduction.air import DENSITY, LOGGER
from virtual_lab.records import (
    REFERENCE_MASS,
    Record,
    ShotLog,
    record_name,
)
from virtual_lab.records.constants import constant_of
from virtual_lab.records.foreign.laboratory import BLANK, FORM
from virtual_lab.records.foreign.table import column_names
from virtual_lab.records.session import Session
from virtual_lab.sheets import FORM_TITLES, AnyForm, entry_name
from virtual_lab.studies.foreign import LOGGER_TABLES, optional_constants, our_session
from virtual_lab.units import DIMENSIONS

OWN_RULES = "procedure.toml"
MAY_BE_LEFT_OUT = {  # optional channels of the bench: effect of their absence
    "climate": f"{DENSITY} is used",
    "store": "the conditioning of the balls is not checked",
    REFERENCE_MASS: "the drift of the scale is not checked",
}
MEASURED = {  # quantities read in channels of the bench
    "length": "Readings of the length of the bat.",
    "barrel-radius": "Readings of the radius of the barrel, 6 in from the barrel tip.",
    "balance": "Readings of the distance of the center of mass from the barrel tip.",
    REFERENCE_MASS: "Readings of one mass: item 0 before bat and balls are weighed, item 1 after.",
}


def template(procedure: AnyForm, folder: NewFolder) -> Path:
    """Write empty forms for measurements.

    The forms of a procedure, for the records of another laboratory, are in a new folder. The other
    forms are single files: ``laboratory``, the particulars (laboratory, customer, bat) for
    ``certify``; ``measurements``, the measurements of a bat for ``fit-bat``; and ``prices`` for
    ``plan``. If an error is raised, no partial files are left. The path of the folder or file is
    returned.

    Parameters
    ----------
    procedure
        A procedure: a name in the catalog or a .toml file. Or ``laboratory``, ``measurements`` or
        ``prices``.

        In Python, a sheet such as ``vl.procedure("bbcor")`` is also allowed.
    folder
        Path of the new folder. The folder gets a file ``laboratory.toml`` for the constants, and
        one CSV table per record. For ``laboratory``, ``measurements`` and ``prices`` it is the
        path of the new file.

    Raises
    ------
    InputError
        The procedure is unknown, or the folder is not empty or cannot be written.
    """
    procedure, folder = entry_name(procedure), Path(folder)
    if procedure in FORM_TITLES:
        text = read_text(DATA / "forms" / f"{procedure}.toml")
        with new_files(folder.parent) as draft:
            (draft / folder.name).write_text(text, encoding="utf-8")
        return folder
    check_new_folder(folder)
    session = our_session(procedure)
    own_procedure = procedure.endswith(".toml")
    with new_folder(folder) as draft:
        if own_procedure:
            (draft / OWN_RULES).write_text(session.procedure_text, encoding="utf-8")
        text = "\n".join(_form(session, OWN_RULES if own_procedure else procedure))
        (draft / FORM).write_text(text + "\n", encoding="utf-8")
        for stage, records in session.records.items():
            (draft / stage).mkdir()
            for channel, record in records.items():
                (draft / stage / f"{channel}.csv").write_text(_table(record), encoding="utf-8")
    return folder


def _form(session: Session, procedure: str) -> Iterator[str]:
    rules = catalog.read(session.procedure_text, procedure, Procedure).spec
    yield f"# The form of a test by {procedure}: {rules.title}."
    yield f"# Fill in every {BLANK!r} and the tables, then: virtual-lab reduce FOLDER"
    yield '# Tables may have other numbers of rows, units, names and shapes: see the page "Forms".'
    yield ""
    yield f'laboratory = "{BLANK}"'
    for key in ("customer", "date"):
        yield f'{key} = "{BLANK}"  # optional: delete this line if it is not used'
    yield f'bat = "{BLANK}"'
    yield f'ball = "{session.ball}"'
    for key, alternative in (("bat_sport", f", {CHECK_STANDARD}"), ("ball_sport", "")):
        yield f'{key} = "{getattr(session, key)}"  # baseball, softball{alternative}, or nothing'
    yield f'bat_construction = ""  # {", ".join(get_args(Construction))}, or nothing'
    yield f'procedure = "{procedure}"'
    yield "# Particulars, such as customer and serial number, may follow in tables such as"
    yield "# particulars.bat; 'virtual-lab template laboratory FILE' writes their keys."
    yield "index_from = 0  # number of the first shot, ball, reading and so on: 0 or 1"
    yield ""
    yield "[rigs]  # descriptions of your machines"
    for stage, name in session.rigs.items():
        yield f'{stage} = "{BLANK}"  # ours: {name}'
    for stage, records in session.records.items():
        for channel, record in records.items():
            yield ""
            yield from _channel(stage, channel, record)
    yield ""
    yield "# Calibration constants. u is the standard uncertainty, in the unit of the value. You"
    yield "# may add its degrees of freedom, dof = NUMBER. There are no defaults: for a correction"
    yield "# that you do not make, enter the value 0 and the u of the omitted correction."
    yield ""
    yield "[calibration]"
    for key in session.calibration:
        yield from _constant(key)
    yield "# Optional constants; remove the # to use one:"
    for key in optional_constants(session.records):
        yield from _constant(key, sign="# ")


def _channel(stage: str, channel: str, record: Record) -> Iterator[str]:
    for line in filter(None, inspect.cleandoc(type(record).__doc__ or "").splitlines()):
        yield f"# {line}"
    if channel in MAY_BE_LEFT_OUT:
        yield f"# This table is optional: without it {MAY_BE_LEFT_OUT[channel]}."
        block = f"[channels.{stage}.{channel}]"
        yield f"# To leave it out, delete the lines from {block} to file, and the CSV file."
        if channel in LOGGER_TABLES:
            tables = " and ".join(LOGGER_TABLES)
            yield f"# If {tables} are both left out, also delete the constants {LOGGER}…"
    if stage == "balls" and isinstance(record, ShotLog):
        yield "# place_m has no effect for a shot at the wall: enter 0."
    if channel in MEASURED:
        yield f"# {MEASURED[channel]}"
    sizes = record.sizes()
    last = {axis: size - 1 for axis, size in sizes.items()}
    numbers = ", ".join(f"{axis} 0 to {end}" if end else f"{axis} 0" for axis, end in last.items())
    rest = "; the file contains only the first row" if _is_long(record) else ""
    yield f"# Index ranges of the simulated test: {numbers}{rest}."
    for column in record.columns.values():
        alternatives = [name for name in column_names(column) if name != column.name]
        once = f" once for each {', '.join(column.axes)}" if set(column.axes) < set(sizes) else ""
        units = f" (or {', '.join(alternatives)})" if alternatives else ""
        yield f"# {column.name}{units}{once}: {column.meaning}"
    yield f"[channels.{stage}.{channel}]"
    yield f'record = "{record_name(record)}"'
    yield f'file = "{stage}/{channel}.csv"'


def _constant(key: str, sign: str = "") -> Iterator[str]:
    constant = constant_of(key)
    units = list(DIMENSIONS[constant.dimension]) if constant else [BLANK]
    meaning = f"{constant.meaning}; " if constant else ""
    yield f"# {meaning}{' or '.join(units)}"
    if key == DENSITY:
        yield "# Needed only without climate readings. With them, delete this line; if you keep it,"
        yield "# a check compares the value with the readings."
    ending = f'unit = "{units[0]}", u = "{BLANK}", source = ""'
    yield f'{sign}"{key}" = {{ value = "{BLANK}", {ending} }}'


def _is_long(record: Record) -> bool:
    return prod(record.sizes().values()) > 1000  # nobody fills in a longer table by hand


def _table(record: Record) -> str:
    """Return the CSV form of a record: index columns filled in, values empty."""
    table = record.table()
    values = [column.name for column in record.columns.values() if not column.is_index]
    numbers = [column.name for column in record.columns.values() if column.is_index]
    table = table.astype(dict.fromkeys(numbers, int)).astype(dict.fromkeys(values, object))
    table[values] = ""
    return (table.head(1) if _is_long(record) else table).to_csv(index=False, lineterminator="\n")
