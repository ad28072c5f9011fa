"""Mutations: how many wrong lines of the program the tests notice.

    python -m tests.mutations OUT.csv SEED NUMBER FOLDER [--before EARLIER.csv]

The command chooses NUMBER one-line mutations in FOLDER by the seed: another operator, comparison
or constant, or a statement less. It writes each into a copy of the clone and runs there the test
files that could notice, nearest first: those that name the function, then by the length of the
imports between test and module. A mutation is killed by the first test that fails, if this test
passes without the mutation. It survives if all tests pass, or `LIMIT` is used up. With EARLIER.csv,
the mutations are instead those killed there whose line is still in the file, and each runs first
against the test file that killed it: is a kill lost since?
"""

from __future__ import annotations

import ast
import csv
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # see conftest.py
sys.dont_write_bytecode = False

ROOT = Path(__file__).parents[1]
LIMIT = 20  # longest run of one group of test files [s of processor time]
TEST_LIMIT = 15  # longest test, then it has failed [s of processor time]
GROUPS = 3, 9  # number of test files run together, the nearest first
FINISHED = (0, 1, 2, 5)  # exit codes of pytest: passed, failed, interrupted, no test chosen
HEADER = ("file", "line", "before", "after", "killed_by", "processor_s")
LOADED = ("numpy", "scipy.optimize", "scipy.stats", "pandas", "numba")
OPERATORS: dict[type[ast.AST], Any] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}


class Mutation(NamedTuple):
    """A change of one line: `after` replaces the bytes from `start` to `stop` of the line."""

    path: Path
    line: int
    start: int
    stop: int
    after: str
    name: str  # function or class around the line, or ""

    def apply(self, source: bytes) -> bytes:
        lines = source.splitlines(keepends=True)
        line = lines[self.line - 1]
        lines[self.line - 1] = line[: self.start] + self.after.encode() + line[self.stop :]
        return b"".join(lines)


def mutations(path: Path) -> Iterator[Mutation]:
    """Yield all mutations of a module."""
    yield from _inside(path, ast.parse(path.read_bytes()), "")


def _inside(path: Path, node: ast.AST, name: str) -> Iterator[Mutation]:
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        name = name or node.name
    if isinstance(node, ast.expr | ast.stmt) and node.lineno == node.end_lineno:
        for after in _replacements(node):
            stop = node.end_col_offset or 0
            yield Mutation(path, node.lineno, node.col_offset, stop, after, name)
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not isinstance(child, ast.JoinedStr):
                yield from _inside(path, child, name)


def _replacements(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.BinOp(op=operator) | ast.BoolOp(op=operator) if type(operator) in OPERATORS:
            node.op = OPERATORS[type(operator)]()
            yield f"({ast.unparse(node)})"
            node.op = operator
        case ast.Compare(ops=[operator]) if type(operator) in OPERATORS:
            node.ops = [OPERATORS[type(operator)]()]
            yield f"({ast.unparse(node)})"
            node.ops = [operator]
        case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert(), operand=inner):
            yield ast.unparse(inner)
        case ast.Constant(value=bool(value)):
            yield str(not value)
        case ast.Constant(value=int(value)):
            yield str(value + 1)
        case ast.Constant(value=float(value)):
            yield repr(1.1 * value if value else 1.0)
        case ast.Expr(value=ast.Call() | ast.Yield()) | ast.AugAssign() | ast.Raise():
            yield "pass"
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield "pass"


@cache
def _imports() -> Any:
    import grimp

    return grimp.build_graph("virtual_lab", "rigs", "tests", cache_dir=None)


def _dotted(path: Path) -> str:
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return name.removesuffix(".__init__")


def _near(mutation: Mutation, first: str) -> list[str]:
    """Return the test files that could notice, the most promising first."""
    module = _dotted(mutation.path)
    orders = []
    for path in sorted(ROOT.glob("tests/**/test_*.py")):
        chain = _imports().find_shortest_chain(importer=_dotted(path), imported=module)
        file = str(path.relative_to(ROOT))
        if chain is not None:
            unnamed = not mutation.name or mutation.name not in path.read_text("utf-8")
            orders.append((file != first, unnamed, len(chain), path.stat().st_size, file))
    return [order[-1] for order in sorted(orders)][: sum(GROUPS)]


class _Watch:
    """The plugin that names the first failure, and ends a test that runs for too long."""

    failed = ""

    def pytest_runtest_logstart(self) -> None:
        signal.setitimer(signal.ITIMER_PROF, TEST_LIMIT)

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.failed = self.failed or report.nodeid

    pytest_collectreport = pytest_runtest_logreport


def _first_failure(copy: Path, tests: Sequence[str]) -> str:
    """Return the first test that fails, or "" if none does within the limits."""
    report = copy.with_name("failed")
    report.write_text("")
    child = os.fork()
    if not child:
        with suppress(BaseException):
            _run_tests(copy, tests, report)
        os._exit(0)
    os.waitpid(child, 0)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # the tests may have started processes
    return report.read_text()


def _processor_time() -> float:
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def _run_tests(copy: Path, tests: Sequence[str], report: Path) -> None:
    import pytest

    def stop(*_: object) -> None:
        raise TimeoutError(f"longer than {TEST_LIMIT} s")

    os.setsid()
    null = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(null, stream)
    signal.alarm(60 * LIMIT)  # a test that waits uses no processor time
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT + 5))
    signal.signal(signal.SIGPROF, stop)
    os.chdir(copy)
    os.environ["PYTHONPATH"] = sys.path[0] = str(copy)
    for name in [name for name in sys.modules if name.partition(".")[0] == "tests"]:
        del sys.modules[name]
    watch = _Watch()
    options = ["-xq", "-pno:cacheprovider", "-pno:xdist", "-oaddopts=-m 'not long'"]
    if pytest.main([*options, *tests], plugins=[watch]) not in FINISHED:
        watch.failed = tests[0]  # no test ran, because a conftest could not be imported
    report.write_text(watch.failed)


def study(
    mutants: Sequence[Mutation], killers: dict[tuple[str, ...], str]
) -> Iterator[tuple[object, ...]]:
    """Yield the row of each mutation; `killers` has the killing test by `_change`."""
    for name in LOADED:
        __import__(name)
    sound: dict[str, bool] = {"": False}
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "clone"
        unused = shutil.ignore_patterns(".git", ".venv*", ".*_cache", "out", "generated")
        shutil.copytree(ROOT, copy, ignore=unused)
        for mutation in mutants:
            path = mutation.path.relative_to(ROOT)
            source = mutation.path.read_bytes()
            change = _change(mutation)
            tests = _near(mutation, killers.get(change, "").partition("::")[0])
            times, begun = (copy / path).stat(), _processor_time()
            (copy / path).write_bytes(mutation.apply(source))
            try:
                failed = _first_failure(copy, tests[: GROUPS[0]])
                if not failed and tests[GROUPS[0] :]:
                    failed = _first_failure(copy, tests[GROUPS[0] :])
            finally:
                (copy / path).write_bytes(source)
                os.utime(copy / path, ns=(times.st_atime_ns, times.st_mtime_ns))
                for compiled in (copy / path).parent.glob(f"__pycache__/{path.stem}.*.pyc"):
                    compiled.unlink()
            seconds = _processor_time() - begun
            if failed not in sound:
                sound[failed] = not _first_failure(copy, [failed])
            row = (change[0], mutation.line, *change[1:])
            yield (*row, failed if sound[failed] else "", f"{seconds:.0f}")


def _change(mutation: Mutation) -> tuple[str, ...]:
    """Return the file, and the line before and after, without its number."""
    source = mutation.path.read_bytes()
    texts = (source, mutation.apply(source))
    lines = [text.splitlines()[mutation.line - 1].decode().strip() for text in texts]
    return (str(mutation.path.relative_to(ROOT)), *lines)


def main(out: str, seed: str, number: str, folder: str, *earlier: str) -> None:
    """Write the table, a row per mutation, and print how many were killed."""
    paths = sorted((ROOT / folder).rglob("*.py"))
    every = [each for path in paths if "docs" not in path.parts for each in mutations(path)]
    killers: dict[tuple[str, ...], str] = {}
    if earlier:
        with open(earlier[-1], encoding="utf-8", newline="") as file:
            killers = {(row[0], *row[2:4]): row[4] for row in csv.reader(file) if row[4]}
        chosen = list({_change(each): each for each in every if _change(each) in killers}.values())
    else:
        chosen = random.Random(int(seed)).sample(every, int(number))
    killed = 0
    with open(out, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEADER)
        for row in study(chosen, killers):
            table.writerow(row)
            file.flush()
            killed += bool(row[4])
    print(f"{killed} of {len(chosen)} killed, seed {seed}, {len(every)} mutations in {folder}")


if __name__ == "__main__":
    main(*(each for each in sys.argv[1:] if each != "--before"))
