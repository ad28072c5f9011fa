"""The page of an empty folder, in a visitor's browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.web.visiting import Visitor


@pytest.fixture
def visitor(tmp_path: Path) -> Iterator[Visitor]:
    (tmp_path / "lab").mkdir()
    visitor = Visitor(tmp_path / "lab")
    yield visitor
    visitor.page.runs.end()
