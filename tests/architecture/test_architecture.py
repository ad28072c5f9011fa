"""The shape of the code, held by tests: who imports whom, what loads, how long a file is."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
MODULES = sorted(path for top in ("virtual_lab", "rigs") for path in (ROOT / top).rglob("*.py"))
LINES = 300
HEAVY = {"cv2", "dask", "matplotlib", "numba", "pandas", "pydantic", "pymunk", "scipy"}
LINT = (
    "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
)


def python(*arguments: str, folder: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Run a fresh interpreter that sees the packages of `folder` first."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_import_contracts() -> None:
    """[tool.importlinter] in pyproject.toml, the contracts of the design."""
    done = python("-c", LINT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"Contracts: [1-9]\d* kept, 0 broken", done.stdout)


@pytest.mark.parametrize(
    ("module", "line", "contract"),
    [
        ("virtual_lab/reduction/gates.py", "import virtual_lab.truth", "never reaches what is"),
        ("virtual_lab/units.py", "import virtual_lab.physics.ball", "never reaches what is"),
        ("virtual_lab/lab/laboratory.py", "import rigs.bench", "no machine in particular"),
        ("rigs/bench.py", "import virtual_lab.reduction.gates", "how its records are reduced"),
        (
            "virtual_lab/faults/desk.py",
            "import virtual_lab.reduction.gates",
            "how its records are reduced",
        ),
        ("virtual_lab/diagnostics/bench.py", "import virtual_lab.truth", "never reaches what is"),
        ("virtual_lab/session.py", "import virtual_lab.report.tables", "laboratory's layers"),
        ("virtual_lab/physics/ball.py", "import virtual_lab.collision.scene", "machines' layers"),
    ],
)
def test_contracts_catch_a_breach(module: str, line: str, contract: str, tmp_path: Path) -> None:
    """Mutation of the code: one forbidden import, some of them indirect, breaks its contract."""
    for top in ("virtual_lab", "rigs"):
        shutil.copytree(ROOT / top, tmp_path / top, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    path = tmp_path / module
    path.write_text(path.read_text("utf-8") + f"\n{line}\n", "utf-8")
    done = python("-c", LINT, folder=tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    broken = [row for row in done.stdout.splitlines() if row.endswith("BROKEN")]
    assert any(contract in row for row in broken), broken


@pytest.mark.parametrize("module", ["virtual_lab", "virtual_lab.cli"])
def test_import_is_light(module: str) -> None:
    """Seconds before the first word: self times of -X importtime, less than 0.3 s in all."""
    code = f"import sys; import {module}; print(*sorted(sys.modules))"
    done = python("-X", "importtime", "-c", code)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert module in loaded
    assert loaded & HEAVY == set()
    rows = re.findall(r"import time:\s+(\d+) \|", done.stderr)
    assert len(rows) > 10
    assert sum(map(int, rows)) < 300_000  # microseconds


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_modules_are_short(path: Path) -> None:
    """300 lines are what a reader keeps in mind."""
    assert len(path.read_text("utf-8").splitlines()) <= LINES


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_randomness_has_one_door(path: Path) -> None:
    """`virtual_lab.streams` alone draws: no np.random and no random anywhere else."""
    if path.name == "streams.py":
        return
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert (node.value.id, node.attr) not in {("np", "random"), ("numpy", "random")}
        if isinstance(node, ast.Import):
            assert not {alias.name for alias in node.names} & {"random", "numpy.random"}
        if isinstance(node, ast.ImportFrom):
            assert node.module not in {"random", "numpy.random"}


def test_every_package_is_shipped() -> None:
    """A wheel holds what pyproject.toml lists: no package may be forgotten there."""
    found = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for path in MODULES
        if path.name == "__init__.py"
    }
    listed = set(PROJECT["tool"]["setuptools"]["packages"])
    assert found | {"virtual_lab.data"} == listed


def test_every_data_file_is_shipped() -> None:
    """The patterns of package-data cover all in data/ but Python and the README's pictures."""
    patterns = PROJECT["tool"]["setuptools"]["package-data"]["virtual_lab.data"]
    covered = {path for pattern in patterns for path in (ROOT / "data").glob(pattern)}
    every = {
        path
        for path in (ROOT / "data").rglob("*")
        if path.is_file() and path.suffix not in {".py", ".pyc"} and path.parent.name != "figures"
    }
    assert every - covered == set()
