"""The number of tuning constants in video is limited: a new constant must be worth its place."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2] / "virtual_lab"
ROOMS = (ROOT / "video", ROOT / "measurement" / "camera")
MOST = 170


def constants(text: str) -> Iterator[str]:
    """Yield numeric defaults of frozen dataclasses and named tuples, and upper-case names."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.ClassDef):
            kinds = [ast.unparse(each) for each in (*node.decorator_list, *node.bases)]
            if any("frozen=True" in each or each == "NamedTuple" for each in kinds):
                for line in node.body:
                    if isinstance(line, ast.AnnAssign) and _numeric(line.value):
                        yield f"{node.name}.{ast.unparse(line.target)}"
        elif isinstance(node, ast.Assign) and _numeric(node.value):
            for target in node.targets:
                for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                    if isinstance(name, ast.Name) and name.id.isupper():
                        yield name.id


def _numeric(value: ast.expr | None) -> bool:
    numbers = (
        each.value for each in ast.walk(value or ast.Pass()) if isinstance(each, ast.Constant)
    )
    return any(isinstance(each, int | float) and not isinstance(each, bool) for each in numbers)


def test_the_number_of_constants_does_not_grow() -> None:
    files = [file for room in ROOMS for file in sorted(room.rglob("*.py"))]
    names = [f"{file.stem}.{name}" for file in files for name in constants(file.read_text("utf-8"))]
    assert len(names) <= MOST, "\n".join(names)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("A = 3.0", ["A"]),
        ("B, C = 1, 2", ["B", "C"]),
        ("b = 1", []),
        ('A = "word"', []),
        ("@dataclass(frozen=True)\nclass D:\n    a: float = 1.0\n    b: bool = True", ["D.a"]),
        ("class E(NamedTuple):\n    a: int = 1", ["E.a"]),
        ("class F:\n    a: int = 1", []),
    ],
)
def test_constants_are_counted(text: str, names: list[str]) -> None:
    assert list(constants(text)) == names
