"""Plans of a laboratory: those in the table, their simulation, and bad input."""

import base64
from dataclasses import replace

import numpy as np
import pytest

import virtual_lab as vl
from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.lab import RoundRobin
from virtual_lab.studies.plan.laboratory import PlannedLaboratory, better_instruments, feasible
from virtual_lab.studies.plan.prediction import Counts, Forecast
from virtual_lab.studies.plan.sample import SampledTests

TESTS = 200


@pytest.fixture(scope="module")
def plans():
    return vl.plan("asa", bat="softball-34", target_u=0.11, laboratories=TESTS)


@pytest.fixture
def few_tests(monkeypatch):
    """Let few simulated tests predict u."""
    monkeypatch.setattr("virtual_lab.studies.plan.laboratory.PILOT", 256)


@pytest.fixture(scope="module")
def scanned():
    """Return the laboratory of a procedure that scans the barrel, from a few tests."""
    shared = RoundRobin.of("r161", "bbcor")
    forecast = Forecast(rules=shared.setup.rules.spec, sample=SampledTests.of(shared, 64, 3))
    return PlannedLaboratory(shared=shared, seed=1, workers=1, exchanges={}, forecast=forecast)


def test_plans_reach_the_target_for_the_fewest_minutes(plans):
    present, *rows = plans
    assert (present.plan, present.exchanged, present.reaches) == ("present", "none", "no")
    assert (present.hits, present.balls, present.wall_hits) == (6, 12, 4)
    assert plans.text.count("\npresent ") == 1  # one line says all of a plan
    names = [str(number) for number in range(1, 11)]
    assert [row.plan for row in rows] == [*names, "single change"]
    assert all(row.reaches != "no" for row in rows)
    for row in plans:  # two standard errors on either side of the target are not decided
        away = (row.simulated_u - 0.11) / row.simulated_u_se
        assert row.reaches == ("not decided" if abs(away) < 2 else "yes" if away < 0 else "no")
    best, *others = rows[:10]
    assert (best.compared, best.reaches) == ("chosen", "yes")
    for row in others:  # the best plan has the fewest changes among those within five minutes
        assert row.compared == ("equal" if row.minutes < best.minutes + 5 else "higher")
    for compared in ("equal", "higher"):
        minutes = [row.minutes for row in others if row.compared == compared]
        assert minutes == sorted(minutes)
    assert f"plan 1 reaches {best.simulated_u:.3g}, with {best.hits} hits" in plans.title
    assert "minutes; chosen by minutes: instruments cost nothing without prices; " in plans.title
    assert plans.text.count("less than 5 min above") == 2
    single = rows[-1]
    changed = [single.exchanged != "none", single.hits > 6, single.balls > 12, single.wall_hits > 4]
    assert sum(changed) == 1
    for row in plans:
        assert row.planned_u == pytest.approx(row.simulated_u, rel=0.05)
        assert 0 < row.simulated_u_se < 0.03 * row.simulated_u


def test_simulated_u_is_the_median_of_a_sweep(plans):
    """The sweep has the same laboratories and makes its tests without the code of plans."""
    row = plans[1]
    changed = [
        vl.rig("astm-pivot").with_({"pivot.from_knob_u": 0.1})
        if name == "pivot"
        else _with_half_u(name)
        for name in row.exchanged.split(", ")
    ]
    rules = vl.procedure("asa").with_(valid_hits=row.hits, attempts=2 * row.hits)
    tests = vl.sweep("softball-34", procedures=[rules], laboratories=row.tests, instruments=changed)
    assert (row.balls, row.wall_hits) == (12, 4)
    assert row.simulated_u == pytest.approx(tests["u"].median(), rel=1e-6)


def _with_half_u(name):
    sheet = vl.instrument(name)
    numbers = sheet.numbers.set_index("key")["value"]
    return sheet.with_(
        {key: value / 2 for key, value in numbers.items() if key.endswith(("_u", "_scatter"))}
    )


def test_minutes_of_the_present_laboratory(plans):
    actions = catalog.sheet("bench", "actions")[0]["actions"]
    minutes = {name: action["minutes"]["value"] for name, action in actions.items()}
    once = ["tare", "weigh-bat", "weigh-balls", "measure-length", "measure-barrel", "level-stand"]
    once += ["measure-balance", "fit-clamp", "swing", "hit-wall", "aim-paper", "set-place"]
    once += ["reduce", "give-verdict", "hand-in"]
    shot = ["load-ball", "zero-encoder", "clear-scrap", "wait-pressure", "wait-rest", "fire"]
    per_shot = sum(minutes[name] for name in [*shot, "accept"])
    least = sum(minutes[name] for name in once) + 6 * per_shot
    assert least <= plans[0].minutes <= least + 0.3 * per_shot  # few shots are rejected


def test_minutes_follow_the_counts(scanned):
    """By hand, at a rig without an encoder: nobody zeroes it."""
    forecast = scanned.forecast
    actions = catalog.sheet("bench", "actions")[0]["actions"]
    minutes = {name: action["minutes"]["value"] for name, action in actions.items()}
    present = forecast.present

    def more(**counts):
        changed = replace(present, **counts)
        shots = forecast.shots(changed) - forecast.shots(present)
        return scanned.minutes(changed) - scanned.minutes(present), shots

    boxes = forecast.sample.boxes.mean()  # all balls of a box are weighed and fired at the wall
    assert 1 < boxes < 1.1
    twice, _ = more(wall_hits=2 * present.wall_hits)
    assert twice == pytest.approx(boxes * minutes["hit-wall"])
    twice, _ = more(balls=2 * present.balls)
    assert twice == pytest.approx(boxes * (minutes["hit-wall"] + minutes["weigh-balls"]))
    twice, shots = more(hits=2 * present.hits)
    shot = ["load-ball", "clear-scrap", "wait-pressure", "wait-rest", "fire", "accept"]
    assert twice == pytest.approx(shots * sum(minutes[name] for name in shot))


def test_exchanges_of_a_laboratory():
    exchanges = better_instruments(["astm-pivot", "bench"])
    assert {"pivot", "pivot-gates", "pivot-encoder", "lab-scale"} <= exchanges.keys()
    gates = exchanges["pivot-gates"].document
    assert (gates["distance_u"]["value"], gates["clock_u"]["value"]) == (0.0365, 10)
    assert gates["edge_jitter"]["value"] == 1
    assert exchanges["slow-cannon"].document["along_scatter"]["value"] == 0.75
    assert exchanges["pivot"].document["pivot"]["from_knob_u"]["value"] == 0.1


@pytest.mark.usefixtures("few_tests")
def test_present_laboratory_may_reach_the_target():
    """Nearly half of the tests have a larger u than the procedure allows, as in a sweep."""
    rules = vl.procedure("asa").with_(largest_speed_u="0.137 mph")
    plans = vl.plan(rules, bat="softball-34", target_u=0.2, laboratories=TESTS)
    assert [(row.plan, row.compared) for row in plans] == [("present", "chosen")]
    assert "u up to 0.2 mph (0.0894 m/s): the present laboratory reaches 0." in plans.title
    tests = vl.sweep("softball-34", procedures=rules, laboratories=TESTS)
    assert plans[0].invalid == (tests["verdict"] == "INVALID").sum() > 20


@pytest.mark.usefixtures("few_tests")
def test_an_exchange_that_hardly_lowers_u_is_left_out():
    better = better_instruments(["astm-pivot", "bench"])
    few = {name: better[name] for name in ("hall-gravity", "balance-stand")}
    laboratory = PlannedLaboratory.of("softball-34", "asa", few, seed=1, workers=1)
    assert list(laboratory.exchanges) == ["balance-stand"]
    assert len(laboratory.predict_u(laboratory.forecast.present)) == 2


def test_a_plan_with_too_many_shots_is_impossible(scanned):
    """1000 shots are the most that a procedure may allow; bbcor allows 120 for about 30."""
    forecast = scanned.forecast
    hits = np.array([6, 12, 300])
    counts = Counts(hits=hits, final_hits=0 * hits + 6, balls=0 * hits + 12, wall_hits=0 * hits + 4)
    wall = replace(forecast.present, wall_hits=np.array([1000, 1001]))
    assert feasible(forecast, counts).tolist() == [True, True, False]
    assert feasible(forecast, wall).tolist() == [True, False]
    assert np.isinf(scanned.predict_u(counts)).tolist() == [[False, False, True]]


def test_the_title_says_if_hits_alone_do_not_reach_the_target(plans):
    """The sweep has four times the hits, balls and wall hits of the procedure."""
    assert "alone" not in plans.title  # a target that hits alone reach
    low = vl.plan("asa", bat="softball-34", target_u=0.08, laboratories=TESTS)
    rules = vl.procedure("asa").with_(valid_hits=24, balls=48, wall_hits=16, attempts=96)
    u = vl.sweep("softball-34", procedures=rules, laboratories=TESTS)["u"].median()
    assert low.title.endswith(f"; more hits, balls and wall hits alone reach {u:.3g} at best")
    assert "final" not in low.text  # the procedure has no final hits


@pytest.mark.usefixtures("few_tests")
def test_floor_if_no_plan_reaches_the_target():
    plans = vl.plan("asa", bat="softball-34", target_u=0.01, laboratories=TESTS)
    present, floor = plans
    assert (floor.plan, floor.hits, floor.reaches) == ("floor", 24, "no")
    assert plans.title.endswith("no plan is sure to reach it")
    assert floor.simulated_u < 0.6 * present.simulated_u
    assert floor.planned_u == pytest.approx(floor.simulated_u, rel=0.05)
    (sentence,) = (line for line in plans.text.split(". ") if "floor is" in line)
    u = floor.simulated_u
    size = f"{u:.3g} mph ({0.44704 * u:.3g} m/s)"
    assert f"floor is {size}, with Balance point, readings 0." in sentence
    assert sentence.count(";") == 2


def test_picture_and_table(plans, tmp_path):
    folder = plans.save(tmp_path / "plan")
    assert {"plan.csv", "plan.png", "settings.toml"} <= {path.name for path in folder.iterdir()}
    assert np.isfinite(plans.table["simulated_u"]).all()
    html = plans._repr_html_()
    png = base64.b64decode(html.split('src="data:image/png;base64,')[1].split('"')[0])
    assert png == (folder / "plan.png").read_bytes()
    assert "<table" in html
    assert f'<img alt="{plans.title}"' in html


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target_u": 0}, "target_u = 0"),
        ({"target_u": np.inf}, "target_u = inf; allowed: a number, more than 0, finite"),
        ({"laboratories": 99}, "laboratories = 99; allowed: one whole number from 100"),
        ({"bat": "no-such-bat"}, "bat = .no-such-bat"),
    ],
)
def test_bad_input(changes, message):
    with pytest.raises(InputError, match=message) as fault:
        vl.plan("asa", **{"bat": "softball-34", "target_u": 0.1, **changes})
    assert "\n" not in str(fault.value)
