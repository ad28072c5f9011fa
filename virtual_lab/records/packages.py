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
    """Yield the path and the columns of every table among the records of a session.

    Paths are those in a result folder, such as ``records/impact/gates.csv``. Nothing is yielded
    without records.
    """
    for stage, records in session.records.items():
        for channel, record in records.items():
            yield f"records/{stage}/{channel}.csv", list(record_columns(type(record)))


def record_columns(kind: type[Record]) -> Iterator[TableColumn]:
    """Yield the columns of a kind of record in the order of its file: index columns, then values.

    An index column of another package's record that is not in `AXES` has an empty meaning.
    """
    for axis in kind.axes():
        yield TableColumn(axis, AXES.get(axis, ""), "integer")
    for column in kind.columns.values():
        yield TableColumn(column.name, column.meaning)


def data_package(
    title: str, description: str, tables: Mapping[str, Iterable[TableColumn]]
) -> dict[str, Any]:
    """Return the content of ``datapackage.json`` (Frictionless) for a folder's tables, as JSON.

    `tables` maps the path of each table in the folder to its columns. The unit of a column is read
    from the ending of its name.
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
    """Return the content of ``ro-crate-metadata.json`` (RO-Crate) for a folder's files, as JSON.

    `files` are paths in the folder. Files below ``records`` are listed as inputs, all others as
    results. `day` is the date of publication, empty if there is none. `version` is the version of
    this program. Raises `KeyError` for a file whose ending is not in `MEDIA`.
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
