"""A field that is added, removed or has a new meaning requires a new schema."""

from __future__ import annotations

import hashlib
import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from virtual_lab.certificate import document
from virtual_lab.certificate.schema import document_classes
from virtual_lab.records import session

KEPT = Path(__file__).with_name("schemas.json")
FORMS = {
    "certificate.json": (document.SCHEMA, document.CertificateDocument),
    "session.json": (session.SCHEMA, session.SessionForm),
}


def described(kind: type) -> Iterator[str]:
    """Yield each field of a document with its type, and its meaning."""
    parts = document_classes(kind)
    for name in sorted(parts):
        yield name
        for line in inspect.getsource(parts[name]).splitlines():
            if re.match(r'    (\w+: |""")', line):
                yield " ".join(line.split())


def digest_of(kind: type) -> str:
    return hashlib.sha256("\n".join(described(kind)).encode()).hexdigest()[:16]


@pytest.mark.parametrize("form", FORMS)
def test_the_digest_of_each_schema_is_unchanged(form: str) -> None:
    """If this fails, give SCHEMA a new number, and add it with this digest to schemas.json.

    If only the wording of a meaning is better, renew the digest.
    """
    schema, kind = FORMS[form]
    kept = json.loads(KEPT.read_text("utf-8"))[form]
    assert max(map(int, kept)) == schema
    assert kept[str(schema)] == digest_of(kind)


def test_every_kind_of_schema_change_is_detected() -> None:
    """The description covers fields, types and meanings."""
    lines = list(described(document.CertificateDocument))
    assert '"""Sentence on the origin of the result, printed on every page."""' in lines
    assert "u: Uncertainty | None" in lines
    assert 'serial: Title = ""' in lines  # of the bat, a class within a class within
    assert {"Stated", "TestItem", "BudgetLine", "CommitStated"} <= {*lines}
