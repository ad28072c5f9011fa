"""The recipes of virtual_lab/README.md ("Where to add something"), carried out in a copy.

Each recipe edits only the files that its row names, in a copy of the program; all edits are made
before the program starts once. A recipe has found a place that its row does not name if its check
fails. A rig, an instrument and its record in another package are in tests/third_party_rig; a study
and a command are in the pages "Add a study" and "Add a command", which the site runs.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COPIED = ("virtual_lab", "rigs", "data")


class Copy:
    """A copy of the program, whose files a recipe edits."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in COPIED:
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("docs"))

    def edit(self, name: str, old: str, new: str) -> None:
        """Replace the first match of a pattern in a file."""
        text, count = re.subn(
            old, new, (self.folder / name).read_text("utf-8"), count=1, flags=re.M
        )
        assert count == 1, (name, old)
        (self.folder / name).write_text(text, "utf-8")

    def add(self, name: str, text: str) -> None:
        """Add text to the end of a file, which may be new."""
        with (self.folder / name).open("a", encoding="utf-8") as file:
            file.write(text)

    def read(self, name: str) -> str:
        return (self.folder / name).read_text("utf-8")


def a_procedure(copy: Copy) -> None:
    rules = copy.read("data/procedures/astm-f1881.toml")
    copy.add("data/procedures/mine.toml", rules.replace('name = "astm-f1881"', 'name = "mine"'))


A_PROCEDURE = """
assert "mine" in {row.name for row in vl.shelf("procedures")}
assert vl.certify("r161", procedure="mine", **QUIET).certification.procedure.name == "mine"
"""


def a_metric(copy: Copy) -> None:
    """E minus e0, computed twice: as the reduction does, and as the truth does."""
    copy.edit(
        "virtual_lab/measurement/procedure/metric.py",
        r'^( +)case "restitution":$',
        r'\1case "gain":\n\1    return np.asarray(e - curve.ball_restitution)\n\g<0>',
    )
    copy.edit(
        "virtual_lab/lab/true_metric.py",
        r'^( +)case "restitution":$',
        r'\1case "gain":\n\1    return e - self.ball_restitution\n\g<0>',
    )
    copy.edit(
        "virtual_lab/output/metrics.py",
        r"^METRICS = \{$",
        r'\g<0>\n    "gain": MetricFormat("Gain of restitution", "g", "", 1.0, "", 3),',
    )
    rules = copy.read("data/procedures/astm-f1881.toml")
    rules = re.sub('^name = ".*"', 'name = "gain"', rules, flags=re.M)
    rules = re.sub('^metric = ".*"', 'metric = "gain"', rules, flags=re.M)
    copy.add("gain.toml", rules)


A_METRIC = """
test = vl.certify("r161", procedure="gain.toml", **QUIET)
by_hand = test.document["restitution"]["value"] - test.document["ball_restitution"]["value"]
assert abs(test.value - by_hand) < 1e-12
assert abs(test.score()["metric"].error) < 1e-3
assert "g " in test.text
Path("study.toml").write_text(STUDY)
rows = [row for row in vl.interlab("study.toml", predict=True) if "gain" in row.procedure]
assert rows and all(row.predicted >= 0 for row in rows)
"""


def a_fault(copy: Copy) -> None:
    copy.edit(
        "virtual_lab/simulation/faults/catalogue.py",
        r'^( +)Fault\(name="gate-clock", .*$',
        r'\g<0>\n\1Fault(name="gate-far", '
        r'station=change_constant("gates", "distance", plus=2e-3)),',
    )
    start, _, end = copy.read("data/faults/gate-moved.toml").partition("[found_by]")
    sheet = start + 'unfound = "nobody looks there"\n\n' + end[end.index("[[predictions]]") :]
    copy.add("data/faults/gate-far.toml", sheet.replace('"gate-moved"', '"gate-far"'))


A_FAULT = """
assert "gate-far" in {row.name for row in vl.shelf("faults")}
tests = [TEST, *(vl.certify("r161", faults=[n], **QUIET) for n in ("gate-moved", "gate-far"))]
e = [each.certification.quantities["collision_efficiency"].value for each in tests]
assert abs((e[2] - e[0]) / (e[1] - e[0]) - 2) < 0.1
"""


def a_flag(copy: Copy) -> None:
    copy.add(
        "virtual_lab/measurement/diagnostics/short.py",
        "from virtual_lab.measurement.diagnostics.flag import Raised\n\n\n"
        "def short(evidence):\n"
        "    where = evidence.reduced.preparation.bat.length.ravel() < 2\n"
        '    yield Raised(name="short", where=where, sentence=lambda _: "the bat is short")\n',
    )
    copy.edit(
        "virtual_lab/measurement/diagnostics/flags.py",
        r"^CHECKS: (.*)$",
        r"from virtual_lab.measurement.diagnostics.short import short\n\nCHECKS: \1\n"
        r'    "short": short,',
    )


A_FLAG = """
assert "short" in TEST.flags
"""


def a_certificate_field(copy: Copy) -> None:
    copy.edit(
        "virtual_lab/certificate/document.py",
        r"^    marginal: YesNo$",
        r'    moon: str\n    """Phase of the moon."""\n\g<0>',
    )
    copy.edit("virtual_lab/certificate/filling.py", r"^( +)marginal=", r'\1moon="new",\n\g<0>')


A_CERTIFICATE_FIELD = """
assert TEST.document["moon"] == "new"
from virtual_lab.certificate.schema import json_schema
assert json_schema()["properties"]["moon"]["description"] == "Phase of the moon."
"""


def a_constant(copy: Copy) -> None:
    copy.edit(
        "virtual_lab/records/constants.py",
        r"^CONSTANTS = \{.*$",
        r'\g<0>\n    "gates.tilt": '
        r'Constant("angle", "tilt of the gate", "gates, tilt", "mrad", -1, 1),',
    )


A_CONSTANT = """
from virtual_lab.records.foreign.constants import read_constants
entry = {"value": 2, "unit": "mrad", "u": 0.1}
assert read_constants({"impact.gates.tilt": entry}, "x")["impact.gates.tilt"].value == 2e-3
try:
    read_constants({"impact.gates.tilt": {**entry, "unit": "mm"}}, "x")
except vl.InputError as fault:
    assert "rad" in str(fault)
"""


def a_method(copy: Copy) -> None:
    copy.edit(
        "virtual_lab/uncertainty/propagating.py",
        r"^    SECOND: second_order,$",
        r'\g<0>\n    "safe": '
        r'lambda m, linear, d: replace(second_order(m, linear, d), method="safe"),',
    )
    copy.edit("virtual_lab/parameters.py", r"^(Propagation = Literal\[)", r'\1"safe", ')


A_METHOD = """
assert vl.propagate(lambda x: x, {"x": vl.Input(1, 0.1)}, method="safe").method == "safe"
test = vl.certify("r161", seed=1, uncertainty="safe", progress=lambda *_: None)
assert test.certification.refined.method == "safe"
"""


def a_distribution(copy: Copy) -> None:
    """Two values, one at each limit."""
    copy.edit(
        "virtual_lab/uncertainty/laws.py",
        r"^LAWS = \{$",
        r'\g<0>\n    "ends": Law(\n        lambda _: 1.0,\n        lambda _: 1.0,\n'
        r"        lambda r, n, _: np.where(r.uniform(-1, 1, n) < 0, -1.0, 1.0),\n"
        r"        lambda q, _: np.where(q < 0.5, -1.0, 1.0),\n    ),",
    )


A_DISTRIBUTION = """
ends = {"x": vl.Input(low=1.0, high=3.0, distribution="ends")}
assert abs(vl.propagate(lambda x: x, ends).u - 1) < 1e-12
drawn = vl.propagate(lambda x: x, ends, method="monte-carlo", draws=10_000)
assert abs(drawn.u - 1) < 0.01
"""


ACTION = """
[actions.%s]
title = "%s"
part = "bench"
skipped = "nothing happens"
in_book = false
minutes = { value = 3, unit = "min", source = "assumed", verified = false }
"""


def an_action(copy: Copy) -> None:
    copy.add("data/bench/actions.toml", ACTION % ("tare-twice", "Tare the scale again"))
    copy.edit(
        "virtual_lab/bench/day/day.py",
        r'^    "tare": .*$',
        r'\g<0>\n    "tare-twice": lambda *_: {"tared": True},',
    )


DAY = """
from virtual_lab.bench.day.actions import action_of
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.machines.stored_day import StoredDay
day = StoredDay.begin(Path("%s"), load_scenario("%s"), 3)
"""
AN_ACTION = (
    DAY % ("acted", "plain-day")
    + """
assert not day.day.tared
day.do(action_of("tare-twice"))
assert day.day.tared and day.day.seconds == 180
"""
)


def a_repair(copy: Copy) -> None:
    copy.add("data/bench/actions.toml", ACTION % ("dust", "Dust the gates"))
    copy.add("data/bench/actions.toml", 'mends = ["gate-misses"]\nagain = ["weigh-bat"]\n')


A_REPAIR = (
    DAY % ("repaired", "plain-day")
    + """
day.do(action_of("dust"))
assert day.day.repaired_faults == {"gate-misses"}
"""
)


def a_scenario(copy: Copy) -> None:
    text = copy.read("data/bench/scenarios/plain-day.toml")
    copy.add("data/bench/scenarios/heavy.toml", text.replace('"plain-day"', '"heavy"'))


A_SCENARIO = (
    DAY % ("heavy-day", "heavy")
    + """
assert day.day.events == ()
"""
)


def an_operator(copy: Copy) -> None:
    copy.edit(
        "virtual_lab/bench/day/operators.py",
        r"^HABITS = \{$",
        r'\g<0>\n    "lazy": Habits(forgets=1.0),',
    )
    copy.edit("virtual_lab/parameters.py", r"^(OperatorName = Literal\[)", r'\1"lazy", ')


AN_OPERATOR = """
from virtual_lab.cli import cli
assert cli.main(["rehearse", "--operator", "lazy", "--seed", "3", "--out", "lazy"],
    standalone_mode=False) == 0
actions = {each["do"] for each in json.loads(Path("lazy/actions.json").read_text())["actions"]}
assert "fire" in actions and not actions & {"tare", "wait-rest"}
from virtual_lab.lab import Laboratory, TestDay, TestSetup
from virtual_lab.measurement.procedure import Judgement
def every_other(procedure, results, *others):
    return Judgement(reasons=tuple("odd" * (at % 2) for at in range(len(results.speed))))
setup = TestSetup.of("r161", procedure="astm-f1881", seed=3)
day = TestDay.begin(Laboratory.open(setup)).measure_bat().hit_wall().prepare()
day = day.fire(day.next_shots()).judge(every_other)
assert day.reduced.valid.tolist() == [at % 2 == 0 for at in range(len(day.reduced.valid))]
"""


def a_deviation(copy: Copy) -> None:
    """Justify a skipped step always."""
    copy.edit(
        "virtual_lab/bench/scoring/deviations.py",
        r'^( +)elif step == "tare":$',
        r'\1elif step == "level-stand":\n\1    reason = (True, "the floor is level")\n\g<0>',
    )


A_DEVIATION = (
    """
from virtual_lab.bench.day.actions import action_of
from virtual_lab.bench.day.operators import by_script
from virtual_lab.bench.scoring.deviations import JUSTIFIED, deviations
steps = [{"do": "note-deviation", "step": "level-stand", "because": "new floor"}]
script = {"actions": [{"do": "weigh-bat"}, {"do": "measure-balance"}, *steps]}
"""
    + DAY % ("deviated", "plain-day")
    + """
day.run_operator(by_script(script, "script"))
(judged,) = deviations(day.desk)
assert (judged.judged, judged.why) == (JUSTIFIED, "the floor is level")
"""
)


def a_picture(copy: Copy) -> None:
    """Draw the counts of the encoder once more, below their first panel."""
    copy.edit(
        "virtual_lab/bench/pages/traces.py",
        r"^( +)(panels\.append\(_encoder_panel\(times, counts, .*)bottom \+ 52\.0\)\)$",
        r"\g<0>\n\1\2bottom + 204.0))",
    )


A_PICTURE = (
    DAY % ("pictured", "plain-day")
    + """
from virtual_lab.bench.day.operators import operator_of
from virtual_lab.bench.pages.traces import traces_of
shots = [each for each in day.run_operator(operator_of("book")).events if each.action == "fire"]
assert traces_of(1, shots[0].records).drawn.count("encoder [counts]") == 2
"""
)


def a_locating_method(copy: Copy) -> None:
    """Return the start of the search."""
    copy.add(
        "virtual_lab/video/locate/start.py",
        "def at_the_start(regions, start):\n    return start\n",
    )
    copy.edit(
        "virtual_lab/fidelity/camera_estimators.py",
        r"^OURS: .*= \{",
        "from virtual_lab.video.locate.start import at_the_start\n\n"
        r'\g<0>"start": lambda inputs: at_the_start(inputs.regions, inputs.start), ',
    )


A_LOCATING_METHOD = """
from virtual_lab.fidelity.camera_chart import camera_chart
from virtual_lab.fidelity.camera_estimators import ESTIMATORS
from virtual_lab.fidelity.camera_scenes import Case
chosen = {name: ESTIMATORS[name] for name in ("start", "edge fit")}
scenes = {("plain ball", "flat background"): Case(phases=2, repeats=2)}
chart = camera_chart(scenes=scenes, estimators=chosen)
assert {row["estimator"] for row in chart.rows} == {"start", "edge fit"}
chart.plot()
"""


def a_collision_model(copy: Copy) -> None:
    """Add a rigid bat, and balls with half of their restitution."""
    copy.add(
        "virtual_lab/simulation/collision/half.py",
        "from dataclasses import dataclass, replace\n\n"
        "from virtual_lab.simulation.collision.rigid import RigidModel\n\n\n"
        "@dataclass(frozen=True, slots=True, kw_only=True)\n"
        "class HalfModel(RigidModel):\n"
        '    name: str = "half"\n\n'
        "    def collide(self, scenes):\n"
        "        half = replace(scenes, ball_restitution=scenes.ball_restitution / 2)\n"
        "        return RigidModel.collide(self, half)\n",
    )
    copy.edit(
        "virtual_lab/simulation/collision/ladder.py",
        r"^(SIMPLE: .*)\{(.*)\}$",
        "from virtual_lab.simulation.collision.half import HalfModel\n\n"
        r'\1{"half": HalfModel.of, \2}',
    )


A_COLLISION_MODEL = """
from virtual_lab.lab import TestSetup, certify_bat
from virtual_lab.simulation.stations.rig import Reality
e, given = {}, {"procedure": "astm-f1881", "seed": 0, "reality": Reality.NOISE_FREE}
for name in ("half", "rigid"):
    certification = certify_bat(TestSetup.of("r161", collision_model=name, **given)).certification
    e[name] = certification.quantities["restitution"].value
assert certification.session.origin.rungs["collision"].rung == "rigid"
assert abs(e["half"] / e["rigid"] - 0.5) < 0.01
assert TEST.certification.session.origin.rungs["collision"].rung == "modal"
"""


def a_motion_model(copy: Copy) -> None:
    """Play all shots event by event."""
    copy.edit(
        "virtual_lab/simulation/stations/rig.py",
        r'^( +)PYMUNK = "pymunk".*$',
        r'\g<0>\n\1EVENTS = "events"',
    )
    copy.edit("virtual_lab/parameters.py", r"^(MotionName = Literal\[)", r'\1"events", ')
    copy.edit(
        "virtual_lab/simulation/stations/flights.py",
        r"^( +)MotionModel\.PYMUNK: play_pymunk$",
        r"\g<0>,\n\1MotionModel.EVENTS: play_events",
    )


A_MOTION_MODEL = """
test = vl.certify("r161", motion="events", **QUIET)
assert test.certification.session.origin.rungs["motion"].rung == "events"
e = [each.certification.quantities["restitution"].value for each in (test, TEST)]
assert abs(e[0] - e[1]) < 1e-4
"""


def a_factor(copy: Copy) -> None:
    """Add a factor of a lot that changes every result by a tenth of its number."""
    name = "virtual_lab/studies/interlab/study.py"
    copy.edit(
        name,
        r"^@dataclass.*\nclass Factors\(Spec\):$",
        "@dataclass(frozen=True, slots=True, kw_only=True)\n"
        "class MoonFactor(Factor):\n"
        '    pull: Annotated[Share, InSheet("balls", "", "stiffness_spread")] = None\n'
        '    streams = ("moon",)\n'
        "    of_lot = True\n\n"
        "    def effect(self, test, result):\n"
        r"        return self.pull / 10\n\n\n\g<0>",
    )
    copy.edit(name, r"^    wall: WallFactor .*$", r"\g<0>\n    moon: MoonFactor | None = None")


A_FACTOR = r"""
import tomllib
from virtual_lab.studies.interlab.study import read_interlab, sheets_of
text = STUDY.replace("gain.toml", "astm-f1881").replace("lot]", "calibration]")
number = '{ value = 0.05, unit = "1", source = "assumed", verified = false }'
Path("moon.toml").write_text(f"{text}[factors.moon]\npull = {number}\n")
study = read_interlab(Path("moon.toml"))
assert study.spec.varied_factors == ("calibration", "moon")
assert "-moon" not in study.spec.varied_streams
(sheet,) = sheets_of(study, "astm-f1881", ["moon"]).values()
assert tomllib.loads(sheet)["stiffness_spread"]["value"] == 0.05
rows = {row.term: row.predicted for row in vl.interlab("moon.toml", predict=True)}
assert abs(rows["moon"] - 0.005) < 1e-12
Path("moonless.toml").write_text(text)
assert "-moon" in read_interlab(Path("moonless.toml")).spec.varied_streams
"""


def a_parameter(copy: Copy) -> None:
    copy.edit(
        "virtual_lab/studies/place_slope.py",
        r"^    laboratory: ",
        r"    color: bool = False,\n\g<0>",
    )
    copy.edit(
        "virtual_lab/studies/place_slope.py",
        r"^    procedure$",
        r"    color\n        Whether colors are used.\n\g<0>",
    )


A_PARAMETER = """
from virtual_lab.cli import cli
forms = [form for each in cli.get_command(None, "slope").params for form in each.opts]
assert "--color" in forms
assert "color" in inspect.signature(vl.slope).parameters
"""

RECIPES: dict[str, tuple[Callable[[Copy], None], str]] = {
    "a procedure": (a_procedure, A_PROCEDURE),
    "a metric": (a_metric, A_METRIC),
    "a fault": (a_fault, A_FAULT),
    "a flag": (a_flag, A_FLAG),
    "a certificate field": (a_certificate_field, A_CERTIFICATE_FIELD),
    "a calibration constant": (a_constant, A_CONSTANT),
    "a method to propagate uncertainty": (a_method, A_METHOD),
    "a distribution of an input": (a_distribution, A_DISTRIBUTION),
    "an action at the rehearsal bench": (an_action, AN_ACTION),
    "a repair at the rehearsal bench": (a_repair, A_REPAIR),
    "a scenario": (a_scenario, A_SCENARIO),
    "an operator": (an_operator, AN_OPERATOR),
    "what justifies a deviation from the procedure": (a_deviation, A_DEVIATION),
    "a picture on the rehearsal page": (a_picture, A_PICTURE),
    "a method to locate a ball": (a_locating_method, A_LOCATING_METHOD),
    "a model of the collision (a *rung* of the ladder from cheap to expensive)": (
        a_collision_model,
        A_COLLISION_MODEL,
    ),
    "a model of the motion": (a_motion_model, A_MOTION_MODEL),
    "a factor of an interlaboratory study": (a_factor, A_FACTOR),
    "a parameter of a public function": (a_parameter, A_PARAMETER),
}
START = '''
import inspect, json, sys, traceback
from pathlib import Path
import virtual_lab as vl
QUIET = {"reality": "noise-free", "progress": lambda *_: None}
TEST = vl.certify("r161", **QUIET)
STUDY = """
procedures = ["gain.toml"]
bats = ["r161"]
laboratories = 2
lots = 2
repeats = 2
seed = 1
[factors.lot]
"""
found = {}
for name, text in json.loads(Path(sys.argv[1]).read_text("utf-8")).items():
    try:
        exec(text, {**globals()})
        found[name] = ""
    except BaseException:
        found[name] = traceback.format_exc()
Path("found.json").write_text(json.dumps(found))
'''


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the traceback of each recipe; empty if its check passed."""
    folder = tmp_path_factory.mktemp("recipes")
    copy = Copy(folder)
    for edit, _ in RECIPES.values():
        edit(copy)
    (folder / "start.py").write_text(START)
    (folder / "recipes.json").write_text(
        json.dumps({key: text for key, (_, text) in RECIPES.items()})
    )
    subprocess.run(
        [sys.executable, "start.py", "recipes.json"],
        cwd=folder,
        check=True,
        env={**os.environ, "PYTHONPATH": str(folder)},
    )
    return json.loads((folder / "found.json").read_text())


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_is_complete(name: str, found: dict[str, str]) -> None:
    assert found[name] == ""


def test_each_recipe_is_a_row_of_the_page() -> None:
    rows = re.findall(
        r"^\| (an? .+?|what .+?) \|", (ROOT / "virtual_lab/README.md").read_text("utf-8"), re.M
    )
    assert set(RECIPES) < set(rows)
