"""The Python interface: test bats, and get certificates, tables and studies.

The imports below are the list of public names. Only type checkers execute them. A program loads a
module when one of its functions is called, so that the import of the package is fast.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.api.door import public

if TYPE_CHECKING:
    from virtual_lab.api.camera import Calibration as Calibration
    from virtual_lab.api.camera import Track as Track
    from virtual_lab.api.camera import board as board
    from virtual_lab.api.camera import calibrate as calibrate
    from virtual_lab.api.camera import track as track
    from virtual_lab.api.certificates import Certificate as Certificate
    from virtual_lab.api.certificates import certify as certify
    from virtual_lab.api.certificates import compare_with_truth, load_folder
    from virtual_lab.api.certificates import reduce as reduce
    from virtual_lab.api.certificates import sweep as sweep
    from virtual_lab.api.charts import chart as chart
    from virtual_lab.api.charts import stability as stability
    from virtual_lab.api.entries import ball as ball
    from virtual_lab.api.entries import bat as bat
    from virtual_lab.api.entries import instrument as instrument
    from virtual_lab.api.entries import procedure as procedure
    from virtual_lab.api.entries import rig as rig
    from virtual_lab.bench.entrance.operated_day import rehearse as rehearse
    from virtual_lab.campaigns.folder import Campaign as Campaign
    from virtual_lab.campaigns.running import campaign as campaign
    from virtual_lab.certificate.verify import verify as verify
    from virtual_lab.errors import IncompleteError as IncompleteError
    from virtual_lab.errors import InputError as InputError
    from virtual_lab.sheets import Sheet as Sheet
    from virtual_lab.studies.bats.ball_law import sensitivity as sensitivity
    from virtual_lab.studies.bats.compare import BatComparison as BatComparison
    from virtual_lab.studies.bats.compare import profile as profile
    from virtual_lab.studies.bats.fit_bat import fit_bat as fit_bat
    from virtual_lab.studies.bats.profile import BatProfile as BatProfile
    from virtual_lab.studies.bias import bias as bias
    from virtual_lab.studies.coverage import coverage as coverage
    from virtual_lab.studies.critique import critique as critique
    from virtual_lab.studies.daily import daily as daily
    from virtual_lab.studies.faults import faults as faults
    from virtual_lab.studies.interlab.findings import interlab as interlab
    from virtual_lab.studies.inventory import shelf as shelf
    from virtual_lab.studies.inventory import show as show
    from virtual_lab.studies.operating import operating as operating
    from virtual_lab.studies.own_laboratory.own_laboratory import laboratory as laboratory
    from virtual_lab.studies.place_slope import slope as slope
    from virtual_lab.studies.plan.planning import plan as plan
    from virtual_lab.studies.report import report as report
    from virtual_lab.studies.template import template as template
    from virtual_lab.studies.twin.twin import twin as twin
    from virtual_lab.uncertainty.decision import conformity as conformity
    from virtual_lab.uncertainty.decision import global_risk
    from virtual_lab.uncertainty.decision import guard_band as guard_band
    from virtual_lab.uncertainty.inputs import Input as Input
    from virtual_lab.uncertainty.interlaboratory import nested_study as nested_study
    from virtual_lab.uncertainty.propagating import propagate_inputs

    load, propagate, risk, score = load_folder, propagate_inputs, global_risk, compare_with_truth


def _places() -> dict[str, tuple[str, str]]:
    """Return the module of each public name, and its name there."""
    (names,) = (
        part
        for part in ast.parse(Path(__file__).read_text(encoding="utf-8")).body
        if isinstance(part, ast.If)
    )
    *imports, renamed = names.body
    places = {
        each.asname or each.name: (str(line.module), each.name)
        for line in imports
        if isinstance(line, ast.ImportFrom)
        for each in line.names
    }
    assert isinstance(renamed, ast.Assign)
    public_names, names_there = (
        ast.unparse(side).strip("()").split(", ") for side in (renamed.targets[0], renamed.value)
    )
    renames = zip(public_names, names_there, strict=True)
    return places | {public: places.pop(there) for public, there in renames}


PLACES = _places()


def __dir__() -> list[str]:
    return sorted(PLACES)


def __getattr__(name: str) -> Any:
    """Return a function that reads its arguments and loads its module when it is called."""
    if name not in PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    place = PLACES[name]
    classes = name[0].isupper()
    globals()[name] = getattr(import_module(place[0]), place[1]) if classes else public(name, place)
    return globals()[name]
