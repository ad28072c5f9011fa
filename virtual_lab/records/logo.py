"""A laboratory's logo: a small PNG or SVG without anything that could run or load something.

It is stored as a ``data:`` address among the particulars, so that records and certificate contain
the complete picture.
"""

from __future__ import annotations

import base64
import binascii
import re
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from xml.etree import ElementTree

from virtual_lab.errors import InputError
from virtual_lab.files import inside, read_bytes

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

MOST = 200_000  # largest size of a file [bytes]
MOST_PIXELS = 4_000_000
SVG = "http://www.w3.org/2000/svg"
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
KINDS = {".png": "image/png", ".svg": "image/svg+xml"}
DRAWN = re.compile(
    "svg|g|path|rect|circle|ellipse|line|polyline|polygon|text|tspan|defs|linearGradient|"
    "radialGradient|stop|clipPath|mask|symbol|use|title|desc|style"
)
MOST_DRAWN = 10_000  # largest number of drawn shapes; a shape used n times is n shapes
LARGEST_SIDE = 1e6  # largest side of a drawing, in any unit
SIDE = re.compile(r"\s*\+?((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?:[a-z]{2}|%)?\s*")
REFERENCE = re.compile(r"url\(\s*['\"]?#([^'\")]+)")
LOADING = re.compile(r"url\(\s*['\"]?(?!['\"#\s])|@|\\|expression|script|data:|//", re.IGNORECASE)


def logo_of(name: str, folder: Path, where: str) -> str:
    """Return the logo in a PNG or SVG file as a ``data:`` URL.

    Scripts, links and references to other files are removed from an SVG. `name` is the name of the
    file in `folder`. `where` is the document that states this name, for error messages.

    Raises
    ------
    InputError
        The file is missing, is outside the folder, is not a PNG or SVG, is damaged, is too large,
        or states a size that is not valid.
    """
    key, path = "laboratory.logo", inside(folder, name, where, "laboratory.logo")
    kind = KINDS.get(path.suffix.lower())
    if kind is None:
        raise InputError(where, key, name, "allowed: a .png or .svg file")
    data = read_bytes(path, most=2 * MOST)
    try:
        data = _clean_svg(data) if kind == KINDS[".svg"] else _require_png(data)
    except ValueError as fault:
        raise InputError(where, key, name, str(fault)) from fault
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def picture_in(address: str) -> tuple[str, bytes]:
    """Return the kind (``png`` or ``svg``) and the bytes of the picture in a ``data:`` URL.

    Raises `ValueError` if the text is not such a URL, or if the picture is damaged, is too large,
    or contains scripts or references.
    """
    head, _, text = address.partition(";base64,")
    kinds = {f"data:{kind}": suffix[1:] for suffix, kind in KINDS.items()}
    if head not in kinds:
        raise ValueError("must be a picture embedded by 'reduce' or 'certify'")
    try:
        data = base64.b64decode(text, validate=True)
    except binascii.Error:
        raise ValueError("must be a picture in base64") from None
    cleaned = _clean_svg(data) if kinds[head] == "svg" else _require_png(data)
    if cleaned != data:
        raise ValueError("must not contain scripts or references")
    return kinds[head], data


@dataclass(frozen=True, slots=True)
class LogoAddress:
    """Annotation of a field whose entry is a picture without unsafe parts, or empty."""

    def read(self, raw: object) -> object:
        """Return the entry. Raises `ValueError` if it is not such a picture."""
        if isinstance(raw, str) and raw:
            picture_in(raw)
        return raw

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.no_info_before_validator_function(self.read, handler(source))


Logo = Annotated[str, LogoAddress()]


def _require_png(data: bytes) -> bytes:
    head = data[16:24]
    if not data.startswith(PNG_SIGNATURE) or data[12:16] != b"IHDR" or len(head) < 8:
        raise ValueError("is not a PNG picture")
    _require_small(data)
    width, height = (int.from_bytes(part, "big") for part in (head[:4], head[4:]))
    if not 0 < width * height <= MOST_PIXELS:
        raise ValueError(f"has {width} x {height} pixels, allowed up to {MOST_PIXELS:,} in all")
    import cv2
    import numpy as np

    if cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) is None:
        raise ValueError("is a PNG picture that cannot be read")
    return data


def _clean_svg(data: bytes) -> bytes:
    """Return a drawing with plain shapes only: no scripts, links or references to other files."""
    text = re.sub(rb"<!DOCTYPE[^>\[]*>", b"", data)
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise ValueError("declares its own document type, which is not allowed")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as fault:
        raise ValueError(f"is not an SVG drawing: {fault}") from fault
    if root.tag != f"{{{SVG}}}svg":
        raise ValueError("is not an SVG drawing: its root element is not <svg>")
    ElementTree.register_namespace("", SVG)
    try:
        _strip(root)
        _require_size(root)
        _require_few(root)
        cleaned = ElementTree.tostring(root)
    except RecursionError:
        raise ValueError("has elements nested too deeply") from None
    _require_small(cleaned)
    return cleaned


def _strip(element: ElementTree.Element) -> None:
    for name, value in list(element.attrib.items()):
        plain = name.rpartition("}")[2]
        if plain == "href":
            harmless = value.startswith("#")
        else:
            harmless = name == plain and plain[:2].lower() != "on" and not LOADING.search(value)
        if not harmless:
            del element.attrib[name]
        elif plain == "href":
            element.attrib["href"] = element.attrib.pop(name)
    for child in list(element):
        space, _, name = str(child.tag).rpartition("}")
        styled = name == "style" and re.search(f"url|{LOADING.pattern}", child.text or "", re.I)
        if space != f"{{{SVG}" or not DRAWN.fullmatch(name) or styled:
            element.remove(child)
        else:
            _strip(child)


def _require_size(root: ElementTree.Element) -> None:
    """Raise `ValueError` if a stated side of the drawing is not above 0, or is too large."""
    sides = [root.get(key, "1") for key in ("width", "height")]
    box = re.split(r"[\s,]+", root.get("viewBox", "0 0 1 1").strip())
    for side in (*sides, *(box[2:] if len(box) == 4 else ["none"])):
        size = SIDE.fullmatch(side)
        if size is None or not 0 < float(size[1]) <= LARGEST_SIDE:
            stated = ", ".join(f"{key} {root.get(key)!r}" for key in ("width", "height", "viewBox"))
            raise ValueError(f"has no valid size ({stated}); allowed: sides larger than 0")


def _require_few(root: ElementTree.Element) -> None:
    """Raise `ValueError` for a drawing with too many shapes; a shape used n times is n shapes."""
    by_id = {each.get("id"): each for each in root.iter()}
    counts: dict[ElementTree.Element, float] = {}

    def count(element: ElementTree.Element) -> float:
        if element not in counts:
            counts[element] = inf  # it remains inf for a shape that uses itself
            references = [element.get("href", "")[1:]]
            references += [
                name for each in element.attrib.values() for name in REFERENCE.findall(each)
            ]
            parts = [*element, *(by_id[name] for name in references if name in by_id)]
            counts[element] = 1 + sum(map(count, parts))
        return counts[element]

    shapes = count(root)
    if shapes > MOST_DRAWN:
        raise ValueError(f"has {shapes:g} shapes, allowed up to {MOST_DRAWN:,}")


def _require_small(data: bytes) -> None:
    if len(data) > MOST:
        raise ValueError(f"has {len(data)} bytes, allowed up to {MOST}")
