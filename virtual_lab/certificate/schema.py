"""The JSON Schema of ``certificate.json``, with the meaning and unit of every field."""

from __future__ import annotations

import ast
import inspect
import re
from dataclasses import is_dataclass
from itertools import pairwise
from textwrap import dedent
from typing import Any, get_args, get_type_hints

from virtual_lab.certificate.columns import SHOTS
from virtual_lab.certificate.document import SCHEMA, CertificateDocument, ShotRow
from virtual_lab.errors import DISTRIBUTION
from virtual_lab.files.column_units import PURE, unit_of


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of ``certificate.json``, draft 2020-12.

    Each property has a ``description``, and a ``unit`` (UCUM code) if its name ends in a unit.
    """
    from pydantic import TypeAdapter

    schema = TypeAdapter(CertificateDocument).json_schema()
    classes = document_classes(CertificateDocument)
    for name, definition in {**schema["$defs"], CertificateDocument.__name__: schema}.items():
        meanings = field_meanings(classes[name])
        for key, described in definition["properties"].items():
            described["description"] = meanings[key]
            if (unit := unit_of(key)) != PURE:
                described["unit"] = unit.ucum
    named = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:{DISTRIBUTION}:certificate:{SCHEMA}",
    }
    return named | schema


def document_classes(kind: Any) -> dict[str, type]:
    """Return all dataclasses in a type annotation, keyed by class name.

    For example, ``list[A] | None`` gives the dataclass A, and all dataclasses in the annotations of
    the fields of A. The result is empty for a type without dataclasses.
    """
    if isinstance(kind, type) and is_dataclass(kind):
        inner = [document_classes(each) for each in get_type_hints(kind).values()]
        return {kind.__name__: kind} | {name: each for part in inner for name, each in part.items()}
    return {name: each for part in get_args(kind) for name, each in document_classes(part).items()}


def field_meanings(kind: type) -> dict[str, str]:
    """Return the meaning of each field of a dataclass, keyed by field name.

    The meaning is the string below the field in the source code of the class or of one of its
    bases, joined to one line. A field without such a string is left out. For `ShotRow`, the
    meanings come from the columns of the table of shots.
    """
    if kind is ShotRow:
        return {column.row: column.meaning for column in SHOTS if column.row}
    meanings = {}
    for base in reversed(kind.__mro__):
        if not is_dataclass(base):
            continue
        (body,) = ast.parse(dedent(inspect.getsource(base))).body
        statements = body.body if isinstance(body, ast.ClassDef) else []
        for field, below in pairwise(statements):
            match field, below:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    meanings[name] = re.sub(r"\s+", " ", text).strip()
    return meanings
