"""Machine-readable descriptions of a result folder for other programs.

``datapackage.json`` (Frictionless, Data Package 1) describes every column of every table, with
meaning and unit. ``ro-crate-metadata.json`` (RO-Crate 1.1, Process Run Crate) lists every file and
its author.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from virtual_lab.errors import DISTRIBUTION
from virtual_lab.files.column_units import unit_of
from virtual_lab.records.record import AXES, Record
from virtual_lab.records.session import Session

PACKAGE, CRATE = "datapackage.json", "ro-crate-metadata.json"
MEDIA = {
    "json": "application/json",
    "html": "text/html",
    "pdf": "application/pdf",
    "csv": "text/csv",
    "toml": "application/toml",
    "npy": "application/octet-stream",
}


class TableColumn(NamedTuple):
    """A column of a table: name, meaning and type (``integer``, ``number``, …)."""

    name: str
    meaning: str
    type: str = "number"


def record_tables(session: Session) -> Iterator[tuple[str, list[TableColumn]]]:
    """Yield the path and the columns of the table of each record in a session.

    Paths are relative to a result folder, such as ``records/impact/gates.csv``. Nothing is yielded
    without records.
    """
    for stage, records in session.records.items():
        for channel, record in records.items():
            yield f"records/{stage}/{channel}.csv", list(record_columns(type(record)))


def record_columns(kind: type[Record]) -> Iterator[TableColumn]:
    """Yield the columns of a kind of record as its file has them: index columns first, then values.

    If another package defines an index column that is not in `AXES`, its meaning is empty.
    """
    for axis in kind.axes():
        yield TableColumn(axis, AXES.get(axis, ""), "integer")
    for column in kind.columns.values():
        yield TableColumn(column.name, column.meaning)


def data_package(
    title: str, description: str, tables: Mapping[str, Iterable[TableColumn]]
) -> dict[str, Any]:
    """Return the content of ``datapackage.json`` (Frictionless) as a dictionary.

    The file describes the tables of a folder. `tables` holds the columns of each table, keyed by
    the path in the folder. The unit of a column is read from the end of its name.
    """
    return {
        "profile": "tabular-data-package",
        "name": "result",
        "title": title,
        "description": description,
        "resources": [
            {
                "profile": "tabular-data-resource",
                "name": path.removesuffix(".csv").replace("/", "-").lower(),
                "path": path,
                "mediatype": MEDIA["csv"],
                "encoding": "utf-8",
                "schema": {
                    "fields": [_field(column) for column in columns],
                    "missingValues": ["", "nan"],
                },
            }
            for path, columns in tables.items()
        ],
    }


def _field(column: TableColumn) -> dict[str, str]:
    description = {"name": column.name, "type": column.type, "title": column.name.replace("_", " ")}
    if column.meaning:
        description["description"] = column.meaning
    if column.type in ("number", "integer"):
        description["unit"] = unit_of(column.name).ucum
    return description


def crate(
    title: str, description: str, day: str, version: str, files: Iterable[str]
) -> dict[str, Any]:
    """Return the content of ``ro-crate-metadata.json`` (RO-Crate) as a dictionary.

    The file describes the files of a folder. `files` are their paths in the folder. Files in the
    folder ``records`` are listed as inputs, all others as results. `day` is the date of
    publication, or empty. `version` is the version of this program. Raises `KeyError` for a file
    with an extension that is not in `MEDIA`.
    """
    parts = [{"@id": name} for name in files]
    results = [part for part in parts if not part["@id"].startswith("records/")]
    action = {
        "@id": "#test",
        "@type": "CreateAction",
        "name": title,
        "instrument": {"@id": "#program"},
        "object": [part for part in parts if part not in results],
        "result": results,
    }
    program = {
        "@id": "#program",
        "@type": "SoftwareApplication",
        "name": DISTRIBUTION,
        "softwareVersion": version,
    }
    root = {
        "@id": "./",
        "@type": "Dataset",
        "conformsTo": {"@id": "https://w3id.org/ro/wfrun/process/0.5"},
        "name": title,
        "description": description,
        **({"datePublished": day} if day else {}),
        "hasPart": parts,
        "mentions": {"@id": "#test"},
    }
    descriptor = {
        "@id": CRATE,
        "@type": "CreativeWork",
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        "about": {"@id": "./"},
    }
    files_told = [
        {
            "@id": part["@id"],
            "@type": "File",
            "name": part["@id"].rpartition("/")[2],
            "encodingFormat": MEDIA[part["@id"].rpartition(".")[2]],
        }
        for part in parts
    ]
    graph = [descriptor, root, action, program, *files_told]
    return {"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph}
