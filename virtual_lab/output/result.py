"""Result of a study: rows, text, figure if there is one, and saving."""

from __future__ import annotations

from abc import ABC, abstractmethod
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from virtual_lab.errors import InputError
from virtual_lab.files import new_folder
from virtual_lab.files.dictionary import with_units
from virtual_lab.files.tables import write_csv
from virtual_lab.output.tables import Column, record, table_text

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.output.page_figure import PageFigure

Row = TypeVar("Row")
Json = dict[str, Any]  # JSON document


def frame(rows: Sequence[Any]) -> pd.DataFrame:
    """Return rows as a table. A row is a dataclass or a mapping, and each field or key is a column.

    ``attrs["units"]`` of the table holds the units of the columns, keyed by name.
    """
    import pandas as pd

    return with_units(pd.DataFrame([record(row) for row in rows]))


def preformatted_html(text: str) -> str:
    """Return text as HTML for a notebook. Line breaks and spaces are kept."""
    return f"<pre>{escape(text)}</pre>"


def _table_html(table: pd.DataFrame) -> str:
    return str(table.to_html(index=False, float_format="{:.4g}".format))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StudyResult(ABC):
    """Base class of every study's result.

    A study sets the `name` of its files, a `title` of one line and its `rows`. Table, text and
    files are made from these, but a study can override them. A study with a picture has a method
    `draw`.
    """

    # arguments of the call that made it, as ``settings.toml``
    settings: str = field(default="", compare=False)

    @property
    @abstractmethod
    def name(self) -> str: ...
    @property
    @abstractmethod
    def title(self) -> str: ...
    @property
    @abstractmethod
    def rows(self) -> Sequence[Any]: ...

    @property
    def table(self) -> pd.DataFrame:
        """The rows as a table, columns by the keys of the JSON document."""
        return frame(self.rows)

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Tables that `save` writes as CSV, by file name."""
        return {self.name: self.table}

    @property
    def document(self) -> Any:
        """The result for JSON."""
        return [record(row) for row in self.rows]

    @property
    def text(self) -> str:
        """The result for a terminal."""
        return table_text(self.rows)

    def plot(self, path: str | Path | None = None) -> PageFigure:
        """Return the picture, which a notebook shows, and write it into a file if `path` is stated.

        Parameters
        ----------
        path
            File to write; its name ends in .png, .svg or .pdf. By default no file is written.

        Raises
        ------
        InputError
            This result has no picture.
        """
        draw = getattr(self, "draw", None)
        if draw is None:
            raise InputError("", "plot", self.name, "this result has no picture")
        picture: PageFigure = draw()
        return picture.write(path)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write the tables as CSV and the picture as PNG into a new folder.

        Parameters
        ----------
        folder
            The new folder.
        overwrite
            Replace a result folder of this name, as a whole.

        Raises
        ------
        InputError
            The folder is not empty, is not a result folder if it is to be overwritten, or cannot be
            written. No partial files are left.
        """
        with new_folder(Path(folder), self.settings, overwrite=overwrite) as draft:
            self.fill(draft)
        return Path(folder)

    def fill(self, folder: Path) -> None:
        """Write the files of `save` into an existing folder."""
        for name, table in self.tables.items():
            write_csv(table, folder / f"{name}.csv")
        if hasattr(self, "draw"):
            self.plot(folder / f"{self.name}.png")

    @property
    def _picture(self) -> str:
        """The picture as HTML, empty without a picture."""
        try:
            code = b64encode(self.plot()._repr_png_()).decode()
        except InputError:
            return ""
        return f'<img alt="{escape(self.title)}" src="data:image/png;base64,{code}">'

    def __repr__(self) -> str:
        return f"<{self.title}, {len(self.rows)} rows>"

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: rows as a table, or text if it is overridden; picture."""
        plain = type(self).text is not StudyResult.text
        return (preformatted_html(self.text) if plain else _table_html(self.table)) + self._picture


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Rows(StudyResult, Generic[Row]):
    """A result that consists only of rows, and can be used as their sequence.

    A row is a frozen dataclass whose fields are the columns, or a mapping if the columns depend on
    the input of the study.
    """

    name: str
    title: str
    rows: list[Row]
    columns: Mapping[str, Column] | None = None
    across: str = ""  # key whose values are the column heads of a transposed table
    words: str = ""  # text beneath the table

    @property
    def text(self) -> str:
        """The title, the table and the words beneath it."""
        body = table_text(self.rows, self.columns, across=self.across)
        return "\n\n".join(part for part in (self.title, body, self.words) if part)

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: title, table, the words beneath it, and the picture."""
        parts = (f"<p>{escape(each)}</p>" if each else "" for each in (self.title, self.words))
        return _table_html(self.table).join(parts) + self._picture

    def __iter__(self) -> Iterator[Row]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, place: int) -> Row:
        """Return a row by its index. Raises `InputError` for a name, which `table` accepts."""
        try:
            return self.rows[place]
        except TypeError as fault:
            allowed = "allowed: the number of a row; .table has columns by name"
            raise InputError("", "row", place, allowed) from fault
