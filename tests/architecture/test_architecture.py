"""Tests of the structure of the code: imports, loaded modules and shipped files."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from graphlib import TopologicalSorter
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
MODULES = sorted(
    path
    for top in ("virtual_lab", "rigs")
    for path in (ROOT / top).rglob("*.py")
    if not path.is_relative_to(ROOT / "virtual_lab" / "docs")
)
HEAVY = {"cv2", "dask", "matplotlib", "numba", "pandas", "pydantic", "pymunk", "scipy", "tqdm"}
LINT = (
    "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
)
NEVER_TRUE = "Measurement never imports the simulation"
NEVER_REDUCED = "Simulation and rigs never import the measurement"
AT_THE_BENCH = "Operators at the bench never import the simulation"
FLOORS = "Imports run downward"
NO_CLICK = "Only the command line imports click"
CONTRACTS = [each["name"] for each in PROJECT["tool"]["importlinter"]["contracts"]]


def python(*arguments: str, folder: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Run a new interpreter that finds the packages of `folder` first."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder), "COLUMNS": "300"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_import_contracts_are_kept() -> None:
    """The contracts are in [tool.importlinter] in pyproject.toml."""
    done = python("-c", LINT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Contracts: 6 kept, 0 broken" in done.stdout


# module, forbidden import, contract; several lists, because one breach may hide another
BREACHES = [
    [
        ("measurement.reduction.gates", "simulation.physics.truth", NEVER_TRUE),
        ("measurement.diagnostics.bench", "simulation.physics.truth", NEVER_TRUE),
        ("video.clips.clip", "simulation.physics.truth", NEVER_TRUE),
        ("records.session", "simulation.physics.truth", NEVER_TRUE),
        ("certificate.text", "lab.measurand", NEVER_TRUE),
        ("output.style", "studies.score", NEVER_TRUE),
        ("rigs.bench", "measurement.reduction.gates", NEVER_REDUCED),
        ("simulation.faults.catalogue", "measurement.reduction.gates", NEVER_REDUCED),
        ("simulation.instruments.indicator", "video.clips.clip", NEVER_REDUCED),
        ("bench.day.desk", "bench.machines.firing", AT_THE_BENCH),
        ("simulation.physics.ball", "simulation.collision.scene", FLOORS),
        ("commands.call", "click", NO_CLICK),
        ("commands.call", "cli.commands", FLOORS),
    ],
    [
        ("units", "simulation.physics.ball", NEVER_TRUE),
        ("measurement.reduction.gates", "measurement.procedure.rules", FLOORS),
        ("video.locate.noise", "video.locate.edge_fit", FLOORS),
    ],
    [
        ("records.session", "certificate.tables", FLOORS),
        ("video.clips.clip", "video.follow.joint", FLOORS),
        ("lab.laboratory", "rigs.bench", "virtual_lab never imports rigs"),
    ],
]


@pytest.mark.parametrize("breaches", BREACHES)
def test_a_forbidden_import_breaks_its_contract(
    breaches: list[tuple[str, str, str]], tmp_path: Path
) -> None:
    """Forbidden imports, some of them indirect, are added to a copy and break their contracts."""
    for top in ("virtual_lab", "rigs"):
        shutil.copytree(ROOT / top, tmp_path / top, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    links = []
    for importer, imported, contract in breaches:
        module, target = (
            name if name.startswith(("rigs.", "click")) else f"virtual_lab.{name}"
            for name in (importer, imported)
        )
        path = (tmp_path / module.replace(".", "/")).with_suffix(".py")
        path.write_text(path.read_text("utf-8") + f"\nimport {target}\n", "utf-8")
        links.append((contract, f"{module} -> {target} (l."))
    done = python("-c", LINT, folder=tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    _, report = done.stdout.split("Broken contracts\n", 1)
    for contract, link in links:
        head = report.index(f"\n{contract}")
        following = [at for other in CONTRACTS if (at := report.find(f"\n{other}\n")) > head]
        assert link in report[head : min(following, default=None)], (contract, link)


@pytest.fixture(scope="module")
def imports() -> dict[str, set[str]]:
    """Return the project's own modules that each module imports, for type checking included."""
    graph = grimp.build_graph("virtual_lab", "rigs", cache_dir=None)
    return {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}


@pytest.fixture(scope="module")
def trees() -> dict[Path, ast.Module]:
    """Return the syntax trees of all modules."""
    return {path: ast.parse(path.read_text("utf-8")) for path in MODULES}


def room(module: str) -> str:
    """Return the entry of `virtual_lab` that contains a module, or ``rigs``."""
    top, _, rest = module.partition(".")
    return "rigs" if top == "rigs" else rest.partition(".")[0] or "__init__"


def test_imports_have_no_cycle(imports: dict[str, set[str]]) -> None:
    """A cycle raises `graphlib.CycleError`, which names its modules."""
    assert len(list(TopologicalSorter(imports).static_order())) == len(imports)


def test_simulation_and_measurement_share_no_formula_of_a_result(
    imports: dict[str, set[str]],
) -> None:
    """They share flight, pendulum, pinhole, board and air, but not e, r, e0 or a metric.

    So a wrong formula on either side shows as an error of an ideal test.
    """
    of = {
        wing: {
            other
            for module, others in imports.items()
            if room(module) in rooms
            for other in others
            if room(other) == "relations"
        }
        for wing, rooms in (
            ("truth", {"simulation", "rigs"}),
            ("measured", {"measurement", "video"}),
        )
    }
    shared = {name.removeprefix("virtual_lab.relations.") for name in of["truth"] & of["measured"]}
    assert shared <= {"flight", "flight_kernel", "pendulum", "pinhole", "board", "air"}
    imported = imports["virtual_lab.lab.true_metric"] | imports["virtual_lab.lab.measurand"]
    functions = {
        name for name in imported if ".measurement.reduction" in name or ".relations" in name
    }
    assert functions == set()


def test_packages_and_layers_are_few(imports: dict[str, set[str]]) -> None:
    """At most 30 packages, 11 layers (the longest chain of packages) and nine loose modules."""
    below: dict[str, set[str]] = {room(module): set() for module in imports}
    for module, others in imports.items():
        below[room(module)] |= {room(other) for other in others} - {room(module)}
    height: dict[str, int] = {}
    for name in TopologicalSorter(below).static_order():
        height[name] = 1 + max((height[other] for other in below[name]), default=0)
    assert len(below) <= 30
    assert max(height.values()) <= 11
    assert len(list((ROOT / "virtual_lab").glob("*.py"))) <= 9


def test_the_program_and_a_list_load_no_slow_module() -> None:
    """Modules that take seconds to load are loaded only when they are used."""
    code = "from virtual_lab.cli import cli; cli(['list'], standalone_mode=False)"
    done = python("-c", f"import sys; {code}; print(*sorted(sys.modules))")
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.splitlines()[-1].split())
    assert {"virtual_lab"} < loaded
    assert loaded & HEAVY == set()


def test_a_certificate_loads_only_what_it_uses(tmp_path: Path) -> None:
    """Each of these takes as long to load as a certificate takes to compute, or longer.

    The same holds for the commands that read the certificate's records.
    """
    out = tmp_path / "out"
    commands = [
        ["certify", "r161", "--seed", "1", "--out", str(out)],
        ["reduce", str(out / "records"), "--out", str(tmp_path / "again")],
        ["verify", str(out)],
    ]
    code = f"for words in {commands}: cli(words, standalone_mode=False)"
    done = python("-c", f"import sys\nfrom virtual_lab.cli import cli\n{code}\nprint(*sys.modules)")
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.splitlines()[-1].split())
    assert (out / "certificate.html").is_file()
    assert (tmp_path / "again/certificate.html").is_file()
    slow = {f"scipy.{name}" for name in ("fft", "integrate", "interpolate", "optimize", "stats")}
    locator = {"virtual_lab.video.locate.sharp", "rigs.filmed_cannon"}
    # lines of progress if kernels are compiled for ten seconds
    shown = {"tqdm"} if done.stderr else set()
    used = {"numba", "pydantic", "scipy"} | shown
    assert loaded & (HEAVY - used | slow | locator) == set()
    # Commands that read the records of another laboratory do not load the simulation.
    commands = [["reduce", str(out / "records"), "--out", str(tmp_path / "alone")], commands[2]]
    code = f"for words in {commands}: cli(words, standalone_mode=False)"
    done = python("-c", f"import sys\nfrom virtual_lab.cli import cli\n{code}\nprint(*sys.modules)")
    loaded = set(done.stdout.splitlines()[-1].split())
    assert (tmp_path / "alone/certificate.html").is_file()
    simulated = ("rigs", "virtual_lab.lab", "virtual_lab.simulation")
    assert not [name for name in loaded if name.startswith(simulated)]


def draws_of_its_own(tree: ast.AST) -> Iterator[int]:
    """Yield the lines of a module that use random numbers of numpy or of Python."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if (node.value.id, node.attr) in {("np", "random"), ("numpy", "random")}:
                yield node.lineno
        elif isinstance(node, ast.Import):
            if {alias.name for alias in node.names} & {"random", "numpy.random"}:
                yield node.lineno
        elif isinstance(node, ast.ImportFrom) and node.module in {"random", "numpy.random"}:
            yield node.lineno


def test_only_streams_draws_random_numbers(trees: dict[Path, ast.Module]) -> None:
    """No module outside `virtual_lab.streams` uses np.random or random."""
    offenders = [
        f"{path.relative_to(ROOT)}:{line}"
        for path, tree in trees.items()
        if path.parent.name != "streams"
        for line in draws_of_its_own(tree)
    ]
    assert offenders == []


@pytest.mark.parametrize(
    "code",
    ["import random", "from numpy.random import default_rng", "np.random.default_rng(1)"],
)
def test_other_random_numbers_are_detected(code: str) -> None:
    assert list(draws_of_its_own(ast.parse(code))) == [1]


def installed_with(requirements: list[str]) -> set[str]:
    """Return the names of installed distributions that come with requirements, of any depth."""
    names: set[str] = set()
    waiting = list(requirements)
    while waiting:
        name = re.split(r"[^\w.-]", waiting.pop(), maxsplit=1)[0].lower().replace("_", "-")
        if name not in names and name != PROJECT["project"]["name"]:
            with suppress(PackageNotFoundError):  # a package for another system
                waiting += [each for each in requires(name) or () if "extra ==" not in each]
                names.add(name)
    return names


def test_every_imported_package_is_a_dependency(trees: dict[Path, ast.Module]) -> None:
    """The tools of the dev group are installed here, but not in the environment of a user."""
    project = PROJECT["project"]
    extras = [each for name in project["optional-dependencies"].values() for each in name]
    allowed = installed_with(project["dependencies"] + extras)
    distributions = packages_distributions()
    imported = {
        (name.split(".")[0], path)
        for path, tree in trees.items()
        for node in ast.walk(tree)
        for name in imported_by(node)
    }
    ours = {"virtual_lab", "rigs", *sys.stdlib_module_names}
    missing = [
        f"{path.relative_to(ROOT)}: {name}"
        for name, path in sorted(imported)
        if name not in ours
        if not allowed & {each.lower().replace("_", "-") for each in distributions.get(name, ())}
    ]
    assert missing == []
    assert not allowed & {"hypothesis", "pytest", "ruff"}


def imported_by(node: ast.AST) -> list[str]:
    """Return the names of the modules that a statement imports."""
    if isinstance(node, ast.Import):
        return [each.name for each in node.names]
    return [node.module] if isinstance(node, ast.ImportFrom) and node.module else []


def test_every_package_is_shipped() -> None:
    """A wheel contains only the packages listed in pyproject.toml, so all must be listed."""
    packages = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for path in MODULES
        if path.name == "__init__.py"
    }
    listed = set(PROJECT["tool"]["setuptools"]["packages"])
    assert packages | {"virtual_lab.data"} == listed


def test_every_data_file_is_shipped() -> None:
    """The patterns of package-data cover all of data/ but Python files, README and pictures."""
    patterns = PROJECT["tool"]["setuptools"]["package-data"]["virtual_lab.data"]
    covered = {path for pattern in patterns for path in (ROOT / "data").glob(pattern)}
    every = {
        path
        for path in (ROOT / "data").rglob("*")
        if path.is_file() and path.suffix not in {".md", ".py", ".pyc"}
        if path.parent.name != "figures"
    }
    assert every - covered == set()


def parameters(node: ast.AST) -> int:
    """Return the number of a function's parameters, with self; 0 for another node."""
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return 0
    arguments = node.args
    return len([*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs])


def test_only_a_users_functions_have_many_parameters(trees: dict[Path, ast.Module]) -> None:
    """Outside the user interfaces, no function has more than twelve."""
    rooms = [ROOT / "virtual_lab" / name for name in ("api", "cli", "commands")]
    long = [
        f"{path.relative_to(ROOT)}: {node.name}"
        for path, tree in trees.items()
        if path.parent not in rooms
        for node in ast.walk(tree)
        if parameters(node) > 12
    ]
    assert long == []


def statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements of a body and the statements nested in them."""
    for each in body:
        yield each
        for inner in ("body", "orelse", "finalbody"):
            yield from statements(getattr(each, inner, []))


def test_no_public_name_has_two_meanings(trees: dict[Path, ast.Module]) -> None:
    """The test covers public classes and functions, and constants that other modules import."""
    bodies = {path: tree.body for path, tree in trees.items()}
    imported = {
        (each.module, alias.name)
        for body in bodies.values()
        for each in statements(body)
        if isinstance(each, ast.ImportFrom)
        for alias in each.names
    }
    paths_by_name: dict[str, list[str]] = {}
    for path, body in bodies.items():
        if {"cli", "commands"} & {*path.parts}:
            continue
        public_names = {
            each.name for each in body if isinstance(each, ast.ClassDef | ast.FunctionDef)
        }
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        assigned = (
            target for each in body if isinstance(each, ast.Assign) for target in each.targets
        )
        names = {target.id for target in assigned if isinstance(target, ast.Name)}
        public_names |= {name for name in names if (module, name) in imported}
        for public in (each for each in public_names if not each.startswith("_")):
            paths_by_name.setdefault(public, []).append(str(path.relative_to(ROOT)))
    twice = {name: paths for name, paths in paths_by_name.items() if len(paths) > 1}
    assert not twice, twice


def test_no_file_has_merge_markers() -> None:
    kinds = {".py", ".md", ".toml", ".html", ".css", ".js"}
    tops = [ROOT / name for name in ("virtual_lab", "rigs", "tests", "data")]
    paths = [*ROOT.glob("*.md"), *(path for top in tops for path in top.rglob("*"))]
    for path in (each for each in paths if each.suffix in kinds):
        lines = path.read_text("utf-8").splitlines()
        assert not [line for line in lines if line.startswith(("<<<" + "<<<< ", ">>>>" + ">>> "))]
