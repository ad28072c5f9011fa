"""Content of the catalog: names and data sheets of all entries, and installed rigs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import entry_points
from pathlib import Path

from virtual_lab import catalog
from virtual_lab.catalog.reading import DATA, Datum
from virtual_lab.certificate.document import read_document
from virtual_lab.errors import InputError, nearest
from virtual_lab.files import read_toml
from virtual_lab.output.result import Json, Rows
from virtual_lab.output.rounding import with_unit
from virtual_lab.output.tables import column, table_text
from virtual_lab.parameters import Kind
from virtual_lab.sheets import AnyName
from virtual_lab.units import MPH


@dataclass(frozen=True, slots=True, kw_only=True)
class ShelfEntry:
    """One entry of the catalog."""

    kind: str = column("kind")
    name: str = column("name")
    title: str = column("title")


def shelf(kind: Kind | None = None) -> Rows[ShelfEntry]:
    """List bats and other data sheets.

    These are the entries of the catalog: bats, balls, procedures, instruments, rigs, conditions and
    faults. The list has all rigs installed on this computer, including rigs of other packages.

    Parameters
    ----------
    kind
        Kind of the entries. By default all kinds.

    Raises
    ------
    InputError
        The kind is unknown.
    """
    if kind is not None:
        catalog.require_kind(kind)
    rows = []
    for each in catalog.KINDS if kind is None else (kind,):
        titles = {name: catalog.title(each, name) for name in catalog.names(each)}
        if each == "rigs":
            titles = _installed_rigs(titles)
        rows += [ShelfEntry(kind=each, name=name, title=text) for name, text in titles.items()]
    return Rows(name="list", title=f"the catalog: {kind or 'everything'}", rows=rows)


def _installed_rigs(sheet_titles: Mapping[str, str]) -> dict[str, str]:
    """Return the titles of the installed rigs, without loading them.

    The title of a rig without a sheet in the catalog is the summary of its package.
    """
    return {
        point.name: sheet_titles.get(point.name)
        or str((point.dist and point.dist.metadata["Summary"]) or point.value)
        for point in sorted(entry_points(group="virtual_lab.rigs"))
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowestRebound:
    """Slowest horizontal rebounds that light gates detect before the ball falls below them."""

    fall_mm: float
    at_gates: list[dict[str, float]]  # distance_m and speed_mph of each gate
    told_mph: float  # slowest rebound that two gates detect, the number that a speed requires

    @classmethod
    def of(cls, name: str, kind: str | None) -> SlowestRebound | None:
        """Return the slowest rebounds of light gates; None for other instruments."""
        if kind not in ("light-gate", "light-board"):
            return None
        from virtual_lab.relations.flight import slowest_within
        from virtual_lab.simulation.instruments.light_board import LightBoardSpec
        from virtual_lab.simulation.instruments.light_gate import LightGateSpec

        kinds = {"light-gate": LightGateSpec, "light-board": LightBoardSpec}
        spec: type[LightGateSpec | LightBoardSpec] = kinds[kind]
        gates = catalog.load("instruments", name, spec).spec
        slowest = (slowest_within(gates.distances, gates.detected_depth) / MPH).tolist()
        return cls(
            fall_mm=gates.detected_depth * 1e3,
            at_gates=[
                {"distance_m": distance, "speed_mph": speed}
                for distance, speed in zip(gates.distances, slowest, strict=True)
            ],
            told_mph=slowest[-2],
        )

    @property
    def text(self) -> str:
        """The result in one line."""
        gates = ", ".join(
            f"{with_unit(gate['speed_mph'], 'mph', '.1f')} at {gate['distance_m']:g} m"
            for gate in self.at_gates
        )
        return (
            f"slowest horizontal rebound detected, with {self.fall_mm:g} mm of fall: {gates}; "
            f"a speed needs two gates: from {with_unit(self.told_mph, 'mph', '.1f')}"
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ShownSheet:
    """An entry of the catalog: title, numbers with units and sources, and list of sources."""

    kind: str
    name: str
    title: str
    words: Mapping[str, str]
    numbers: tuple[Datum, ...]
    sources: Mapping[str, str]
    slowest_rebound: SlowestRebound | None

    @property
    def document(self) -> Json:
        """The entry as a JSON object; only light gates have `slowest_rebound`."""
        document = asdict(self)
        if self.slowest_rebound is None:
            del document["slowest_rebound"]
        return document

    @property
    def text(self) -> str:
        """The result for a terminal."""
        rows = [
            {
                "key": number.key,
                "value": number.value,
                "unit": "" if number.unit == "1" else number.unit,
                "source": number.source + ("" if number.verified else " (unverified)"),
                "note": number.note,
            }
            for number in self.numbers
        ]
        parts = [f"{self.name}: {self.title} ({self.kind})"]
        parts += [f"  {key}: {value}" for key, value in self.words.items()]
        if rows:
            parts += ["", table_text(rows)]
        if self.slowest_rebound:
            parts += ["", self.slowest_rebound.text]
        parts += [""] + [f"{key}: {text}" for key, text in self.sources.items()]
        return "\n".join(parts).rstrip()

    def __repr__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ShownFile:
    """A certificate, or the text of a sheet's file."""

    document: Json  # result for JSON
    text: str  # result for a terminal

    def __repr__(self) -> str:
        return self.text


def show(name: AnyName, *, toml: bool = False) -> ShownSheet | ShownFile:
    """Show a data sheet or a certificate.

    A data sheet is an entry of the catalog, with unit and source of every number.

    Parameters
    ----------
    name
        A name in the catalog, a .toml file, a result folder, or its ``certificate.json``. If two
        kinds have the name, the kind comes first, for example ``rigs/astm-pivot``. A file is the
        sheet of a bat, unless its folder has the name of another kind, such as ``balls``.
    toml
        Print the text of the sheet, to be copied and changed.

    Raises
    ------
    InputError
        The name is unknown (similar names are suggested), the .toml file is missing or is not of
        its kind, or the folder or .json file contains no certificate.
    """
    name = str(name)
    wanted, _, entry = name.rpartition("/")
    for kind in catalog.KINDS:
        if wanted in ("", kind) and entry in catalog.names(kind):
            if toml:
                text = catalog.text(kind, entry).rstrip()
                return ShownFile(document={"toml": text}, text=text)
            return _sheet(kind, entry)
    if name.endswith(".toml"):
        folder = Path(name).absolute().parent.name
        return _sheet(folder if folder in catalog.KINDS else "bats", name)
    if Path(name).is_dir() or name.endswith(".json"):
        from virtual_lab.certificate.text import certificate_text

        path = Path(name)
        certificate = read_document(path / "certificate.json" if path.is_dir() else path)
        return ShownFile(document=certificate.as_json(), text=certificate_text(certificate))
    suggestion = nearest(name, [entry for kind in catalog.KINDS for entry in catalog.names(kind)])
    raise InputError(
        "", "name", name, f"{suggestion}no folder, and not in the catalog (virtual-lab list)"
    )


def _sheet(kind: str, name: str) -> ShownSheet:
    document, data = catalog.sheet(kind, name)
    sources = read_toml(DATA / "sources.toml")
    words = {key: value for key, value in document.items() if isinstance(value, str)}
    notes = " ".join(datum.note for datum in data)
    cited = sorted(
        {datum.source for datum in data} | {key for key in sources if f"({key})" in notes}
    )
    return ShownSheet(
        kind=kind,
        name=words.pop("name", name),
        title=words.pop("title"),
        words=words,
        numbers=tuple(data),
        sources={key: sources[key]["text"] if key in sources else key for key in cited},
        slowest_rebound=SlowestRebound.of(name, document.get("kind")),
    )
