"""Docstrings name a quantity, comments have a subject, functions are verbs: few exceptions."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = [
    path
    for name in ("virtual_lab", "rigs")
    for path in sorted((ROOT / name).rglob("*.py"))
    if "generated" not in path.parts  # written by the build of the site
]
CLAUSE = re.compile(
    r"((Return|Yield|Give|Fill in|Say|Tell|Find) )?"
    r"(how|what|which|where|who|the same|that of|those)\b",
    re.IGNORECASE,
)
NO_SUBJECT = re.compile(
    r"# (of|that|which|(at|by|in|from|to) which|beyond|what|how|where|who|whose|are|was|by)\b"
)
PARTICIPLE = re.compile(r"_?[a-z]+(ed|own|een|iven|aken|ade|ept|old|aid|ought|ound)")
# names that end like a participle but are nouns, adjectives or infinitives
NO_PARTICIPLES = """
    background between bound cold embed exceed feed fold ground hold inbound need outbound proceed
    rebound red round seed shed sound speed spread threshold unified
"""


@cache
def documented(text: str) -> list[ast.FunctionDef | ast.ClassDef | ast.Module]:
    """Return the parts of a module that may have a docstring."""
    kinds = ast.FunctionDef | ast.ClassDef | ast.Module
    return [node for node in ast.walk(ast.parse(text)) if isinstance(node, kinds)]


def clauses(text: str) -> Iterator[str]:
    """Yield the docstrings that open with a clause in place of a noun."""
    for node in documented(text):
        doc = ast.get_docstring(node) or ""
        if CLAUSE.match(doc):
            yield doc.splitlines()[0]


def without_subject(text: str) -> Iterator[str]:
    """Yield the comments that begin with a preposition or a relative word."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and NO_SUBJECT.match(token.string):
            yield token.string


def participles(text: str) -> Iterator[str]:
    """Yield the functions that are named by a participle alone; a property may be."""
    for node in documented(text):
        if isinstance(node, ast.FunctionDef) and PARTICIPLE.fullmatch(node.name):
            is_property = any("property" in ast.dump(each) for each in node.decorator_list)
            if not is_property and node.name.strip("_") not in NO_PARTICIPLES.split():
                yield f"def {node.name}"


@pytest.mark.parametrize(
    ("pattern", "most"), [(clauses, 15), (without_subject, 40), (participles, 20)]
)
def test_clauses_and_participles_in_place_of_nouns_and_verbs_are_rare(
    pattern: object, most: int
) -> None:
    assert callable(pattern)
    places = [f"{path}: {line}" for path in FILES for line in pattern(path.read_text("utf-8"))]
    assert len(places) <= most, "\n".join(places)


def test_each_pattern_is_recognised() -> None:
    assert list(clauses('def f():\n    """Return how fast it is."""\n')) == [
        "Return how fast it is."
    ]
    assert list(clauses('def f():\n    """Return the speed [m/s]."""\n')) == []
    assert list(without_subject("x = 1  # of the ball\ny = 2  # mass of the ball\n")) == [
        "# of the ball"
    ]
    assert list(participles("def measured(): ...\ndef _shown(): ...\ndef measure(): ...\n")) == [
        "def measured",
        "def _shown",
    ]
    assert list(participles("def rebound_speed(): ...\ndef rebound(): ...\n")) == []
    assert list(participles("class A:\n    @property\n    def valued(self): ...\n")) == []
