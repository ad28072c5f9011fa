"""What data sheets and rule books say: specs, and the files that hold them."""

from virtual_lab.catalog.reading import (
    KINDS,
    Datum,
    Entry,
    find,
    load,
    load_bat,
    names,
    read,
    read_bat,
    sheet,
    text,
    title,
    unverified,
)

__all__ = [
    "KINDS",
    "Datum",
    "Entry",
    "find",
    "load",
    "load_bat",
    "names",
    "read",
    "read_bat",
    "sheet",
    "text",
    "title",
    "unverified",
]
