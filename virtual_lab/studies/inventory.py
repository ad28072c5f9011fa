"""What is on the shelf: the catalog's names and sheets, and the rigs installed here."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import entry_points
from importlib.resources import files
from typing import Any

from virtual_lab import catalog
from virtual_lab.errors import InputError, nearest
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import Column, table_text
from virtual_lab.units import MPH

__all__ = ["sheet_document", "sheet_text", "shelf"]

RIGS = "virtual_lab.rigs"  # the group of entry points
COLUMNS = {"kind": Column("kind"), "name": Column("name"), "title": Column("what it is")}


def shelf(kind: str | None = None) -> Rows:
    """Return kind, name and title of everything in the catalog, or of one kind.

    Rigs are those installed, whoever made them.
    """
    rows = []
    for each in catalog.KINDS if kind is None else (kind,):
        found = {name: catalog.title(each, name) for name in catalog.names(each)}
        if each == "rigs":
            found = _installed_rigs(found)
        rows += [{"kind": each, "name": name, "title": text} for name, text in found.items()]
    return Rows(
        name="list", title=f"the catalog: {kind or 'everything'}", columns=COLUMNS, rows=rows
    )


def _installed_rigs(known: Mapping[str, str]) -> dict[str, str]:
    """Return the titles of the rigs installed here, none of which need be loaded for that.

    One without a sheet in the catalog goes by what its package says of itself.
    """
    return {
        point.name: known.get(point.name)
        or str((point.dist and point.dist.metadata["Summary"]) or point.value)
        for point in sorted(entry_points(group=RIGS))
    }


def sheet_document(name: str) -> dict[str, Any]:
    """Return a catalog entry, every number with unit, source and whether it is verified.

    Of light gates also ``slowest_rebound``, what each sees of a ball that comes back level.

    Raises
    ------
    InputError
        Nothing in the catalog has this name; the nearest names are suggested.
    """
    for kind in catalog.KINDS:
        if name in catalog.names(kind):
            return _sheet(kind, name)
    if name.endswith(".toml"):
        return _sheet("bats", name)
    near = nearest(name, [known for kind in catalog.KINDS for known in catalog.names(kind)])
    raise InputError("", "name", name, f"{near}'virtual-lab list' shows what there is")


def _sheet(kind: str, name: str) -> dict[str, Any]:
    document, data = catalog.sheet(kind, name)
    known = tomllib.loads(files("virtual_lab.data").joinpath("sources.toml").read_text("utf-8"))
    used = sorted({datum.source for datum in data})
    numbers = {
        "kind": kind,
        "name": document.get("name", name),
        "title": document["title"],
        "words": {
            key: value
            for key, value in document.items()
            if isinstance(value, str) and key not in ("name", "title")
        },
        "numbers": [asdict(datum) for datum in data],
        "sources": {key: known[key]["text"] if key in known else key for key in used},
    }
    return numbers | _rebounds(name, document.get("kind"))


def _rebounds(name: str, kind: str | None) -> dict[str, Any]:
    """Return the slowest speeds back at which a level ball has not fallen below the beams yet."""
    if kind not in ("light-gate", "light-board"):
        return {}
    from virtual_lab.relations.flight import slowest_within
    from virtual_lab.simulation.instruments.light_board import LightBoardSpec
    from virtual_lab.simulation.instruments.light_gate import LightGateSpec

    kinds = {"light-gate": LightGateSpec, "light-board": LightBoardSpec}
    spec: type[LightGateSpec | LightBoardSpec] = kinds[kind]
    gates = catalog.load("instruments", name, spec).spec
    slowest = slowest_within(gates.distances, gates.room) / MPH
    return {
        "slowest_rebound": {
            "fall_mm": gates.room * 1e3,
            "at_gates": [
                {"distance_m": distance, "speed_mph": float(speed)}
                for distance, speed in zip(gates.distances, slowest, strict=True)
            ],
            "told_mph": float(slowest[-2]),  # a speed takes two gates
        }
    }


def sheet_text(document: Mapping[str, Any]) -> str:
    """Return a specification: words, numbers with source, and what the sources are."""
    rows = [
        {
            "key": number["key"],
            "value": number["value"],
            "unit": number["unit"].removesuffix("1") if number["unit"] == "1" else number["unit"],
            "source": number["source"] + ("" if number["verified"] else " (unverified)"),
            "note": number["note"],
        }
        for number in document["numbers"]
    ]
    parts = [f"{document['name']}: {document['title']} ({document['kind']})"]
    parts += [f"  {key}: {value}" for key, value in document["words"].items()]
    if rows:
        parts += ["", table_text(rows)]
    if "slowest_rebound" in document:
        parts += ["", _rebound_line(document["slowest_rebound"])]
    parts += [""] + [f"{key}: {text}" for key, text in document["sources"].items()]
    return "\n".join(parts).rstrip()


def _rebound_line(slowest: Mapping[str, Any]) -> str:
    gates = ", ".join(
        f"{gate['speed_mph']:.1f} mph at {gate['distance_m']:g} m" for gate in slowest["at_gates"]
    )
    return (
        f"slowest level rebound seen, {slowest['fall_mm']:g} mm of fall: {gates}; "
        f"a speed takes two gates: from {slowest['told_mph']:.1f} mph"
    )
