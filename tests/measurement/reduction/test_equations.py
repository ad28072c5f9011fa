"""Each equation has one implementation: a mistake in it changes the metric of an ideal test.

A mistake is a factor of 0.9 on the result of the equation.
"""

import ast
import inspect
import json
import shutil
import subprocess
import sys
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

import pytest

from tests.conftest import Play
from tests.measurement.reduction.planted import plant, reduce_arrays
from tests.one_laboratory import reduce_session
from virtual_lab.measurement.reduction import kinematics, shot_algebra
from virtual_lab.measurement.session_reduction import Reduction
from virtual_lab.simulation.stations.rig import Reality

ASTM, BESR, PROPOSED = "astm-f1881", "ncaa-besr", "proposed"
USED: dict[str, tuple[str, ...]] = {  # procedures whose metric depends on the equation
    "collision_efficiency": (ASTM, BESR, PROPOSED),
    "batted_speed": (PROPOSED,),
    "besr": (BESR,),
    "bat_performance_factor": (ASTM, BESR, PROPOSED),
    "restitution_from_efficiency": (ASTM, BESR, PROPOSED),
    "efficiency_from_restitution": (BESR, PROPOSED),
    "recoil_factor": (ASTM,),
    "inverse_mass_pivoted": (ASTM,),
    "parallel_axis": (ASTM, PROPOSED),
    "rebound_speed_from_recoil": (ASTM,),
    "restitution_of_standard_ball": (PROPOSED,),
    "impact_position": (ASTM, BESR, PROPOSED),
    "square_rebound": (BESR, PROPOSED),
    "head_on_efficiency": (ASTM, BESR, PROPOSED),
    "efficiency_at_aim": (ASTM, BESR, PROPOSED),
    "restitution_at_speed": (ASTM, BESR, PROPOSED),
}
# numbers that show the other two equations: r of a free bat cancels in the metric, and a
# laboratory that aims elsewhere is right at its own position
PRINTED = {"inverse_mass_free": "recoil_factor", "centre_of_percussion": "place"}
# combinations of the equations above
OTHERS = {
    "recoil_factor_free",
    "recoil_factor_pivoted",
    "inverse_effective_mass",
    "reduce_shot",
    "reduce_sets",
}


class Numbers(NamedTuple):
    """Printed numbers of a test."""

    metric: float
    recoil_factor: float
    place: float  # aimed position [m]

    @classmethod
    def of(cls, reduced: Reduction) -> "Numbers":
        """Return the weighted means over the hits of a result."""
        outcome = reduced.hit_weights
        mask, weights = outcome.used, outcome.weights
        means = (
            float(values[mask] @ weights[mask])
            for values in (reduced.shot_metric, reduced.shots.aimed_recoil_factor)
        )
        return cls(*means, place=float(reduced.preparation.percussion[0]))


def test_every_equation_is_tested() -> None:
    functions = {
        name
        for name, value in vars(kinematics).items()
        if isinstance(value, FunctionType) and value.__module__ == kinematics.__name__
    }
    assert functions == {*USED, *PRINTED, *OTHERS}


@pytest.mark.parametrize("procedure", [ASTM, BESR, PROPOSED])
def test_a_mistake_in_any_equation_shows(
    procedure: str, played: Play, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The metric deviates by over 1e-3 if the procedure uses the equation, otherwise below 1e-9."""
    tested = played(reality=Reality.IDEAL, procedure=procedure)
    session, true = tested.certification.session, tested.sealed.measurand["metric"]
    right = Numbers.of(reduce_session(session)[0])
    assert right.metric == pytest.approx(true, rel=1e-9)
    for name in USED | PRINTED:
        equation = getattr(kinematics, name)
        with monkeypatch.context() as patch:
            plant(patch, name, lambda *given, equation=equation: 0.9 * equation(*given))
            wrong = Numbers.of(reduce_session(session)[0])
        if name in PRINTED:
            numbers = [each._asdict()[PRINTED[name]] for each in (right, wrong)]
            moves = procedure != ASTM or name == "centre_of_percussion"
            assert (abs(numbers[1] / numbers[0] - 1) > 0.05) == moves, name
        else:
            deviation = abs(wrong.metric / true - 1)
            assert deviation > 1e-3 if procedure in USED[name] else deviation < 1e-9, name


@pytest.mark.parametrize("procedure", [ASTM, BESR, PROPOSED])
def test_compiled_equations_agree_with_arrays(
    procedure: str, played: Play, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All results of all shots of a real laboratory agree."""
    session = played(procedure=procedure).certification.session
    compiled = reduce_session(session)[0].shots
    monkeypatch.setattr(shot_algebra, "compiled_reduction", lambda: reduce_arrays)
    arrays = reduce_session(session)[0].shots
    for name in (*kinematics.RESULTS, *kinematics.DETAILS):
        expected = getattr(arrays, name)
        assert getattr(compiled, name) == pytest.approx(expected, rel=1e-14, nan_ok=True), name


RUN = """
import json, sys, virtual_lab as vl
found = {}
for procedure in sys.argv[1:]:
    try:
        result = vl.certify("r161", procedure=procedure, reality="ideal")
    except Exception:  # a mistake may leave no test at all
        found[procedure] = dict.fromkeys(("metric", "recoil_factor", "place"), (None, 0.0))
        continue
    stated, true = result.document, result.sealed.measurand
    found[procedure] = {
        name: (stated[name]["value"], true.get(name, 0.0)) for name in ("metric", "recoil_factor")
    } | {"place": (stated["impact_position_in"], 0.0)}
print(json.dumps([vl.__file__, found]))
"""


def printed(folder: Path, *procedures: str) -> dict[str, dict[str, tuple[float | None, float]]]:
    """Return printed and true numbers of ideal laboratories, by the package in a folder."""
    command = [sys.executable, "-c", RUN, *procedures]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    file, numbers = json.loads(done.stdout)
    assert Path(file).is_relative_to(folder)
    return numbers


@pytest.mark.long
def test_a_mistake_in_any_compiled_equation_shows(tmp_path: Path) -> None:
    """The mistake is in a copy of the package, which plays and reduces its own tests."""
    package = Path(inspect.getfile(kinematics)).parents[2]
    shutil.copytree(package, tmp_path / package.name)  # copy with valid compiled code
    file = tmp_path / package.name / "measurement" / "reduction" / "kinematics.py"
    text = file.read_text("utf-8")
    place, _ = printed(tmp_path, ASTM)[ASTM]["place"]
    cases = USED | {"inverse_mass_free": (BESR, PROPOSED), "centre_of_percussion": (ASTM,)}
    hidden = []
    for name, procedures in cases.items():
        file.write_text(with_mistake(text, name), "utf-8")
        for procedure, numbers in printed(tmp_path, *procedures).items():
            value, true = numbers[PRINTED.get(name, "metric")]
            if value is not None and abs(value / (true or place) - 1) < 1e-3:
                hidden.append((name, procedure))
    assert hidden == []


def with_mistake(text: str, name: str) -> str:
    """Return the text of a module in which one function returns 0.9 times its result."""
    tree: Any = ast.parse(text)
    for function in tree.body:
        if isinstance(function, ast.FunctionDef) and function.name == name:
            for node in ast.walk(function):
                if isinstance(node, ast.Return):
                    node.value = ast.BinOp(ast.Constant(0.9), ast.Mult(), node.value)
    wrong = ast.unparse(ast.fix_missing_locations(tree))
    assert wrong != ast.unparse(ast.parse(text))
    return wrong
