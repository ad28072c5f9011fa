"""What data sheets and rule books say: specs, and the files that hold them."""

from virtual_lab.catalog.reading import (
    KINDS,
    Datum,
    Entry,
    datums,
    find,
    load,
    load_bat,
    names,
    read,
    read_bat,
    sheet,
    sheets_in_place,
    source,
    text,
    title,
    unverified,
)

__all__ = [
    "KINDS",
    "Datum",
    "Entry",
    "datums",
    "find",
    "load",
    "load_bat",
    "names",
    "read",
    "read_bat",
    "sheet",
    "sheets_in_place",
    "source",
    "text",
    "title",
    "unverified",
]
