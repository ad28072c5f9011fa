"""Prices and histories of plans: what they change, and bad input in one line."""

import numpy as np
import pytest

import virtual_lab as vl
from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml
from virtual_lab.lab import RoundRobin
from virtual_lab.lab.setup import TestSetup as Setup
from virtual_lab.studies.plan.history import DailyScatter, balls_of, read_history
from virtual_lab.studies.plan.prices import Prices
from virtual_lab.studies.plan.sample import SampledTests

PRICES = """
tests = { value = 50, unit = "1", source = "orders" }
per_minute = { value = 1.5, unit = "EUR", source = "wages" }
per_ball = { value = 6, unit = "EUR", source = "shop" }
[instruments]
balance-stand = { value = 900, unit = "EUR", source = "offer" }
pivot-gates = { value = 5000, unit = "EUR", source = "offer" }
"""
RIGS = ("astm-pivot", "bench", "ball-wall")


@pytest.fixture
def prices(tmp_path):
    path = tmp_path / "prices.toml"
    path.write_text(PRICES)
    return path


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Return the folders of three tests of one laboratory."""
    top = tmp_path_factory.mktemp("tests")
    for test in (1, 2, 3):
        vl.certify("softball-34", procedure="asa", seed=7, test=test).save(top / str(test))
    return [top / str(test) for test in (1, 2, 3)]


def test_price_of_plans(prices):
    table = Prices.read(prices)
    assert list(table.offers(prices, RIGS)) == ["balance-stand", "pivot-gates"]
    minutes, balls = np.array([100.0, 120.0]), np.array([12, 24])
    price = table.of_plans(["balance-stand", "pivot-gates"], minutes, balls)
    tests = [50 * (150 + 72), 50 * (180 + 144)]
    assert price.tolist() == [[base + more for base in tests] for more in (0, 900, 5000, 5900)]


def test_plans_by_price(prices):
    plans = vl.plan("asa", bat="softball-34", target_u=0.11, prices=prices, laboratories=200)
    present, *rows = plans
    assert present.currency == "EUR"
    assert present.price == pytest.approx(50 * (1.5 * present.minutes + 6 * 12))
    for compared in ("cheapest", "equal", "higher"):
        cost = [row.price for row in rows if row.plan.isdigit() and row.compared == compared]
        assert cost == sorted(cost)
    names = {name for row in rows for name in row.exchanged.split(", ")}
    assert names <= {"none", "balance-stand", "pivot-gates"}
    assert rows[0].reaches != "no"
    assert rows[0].price == pytest.approx(
        50 * (1.5 * rows[0].minutes + 6 * rows[0].balls) + 900 * ("stand" in rows[0].exchanged)
    )


def test_prices_may_be_a_mapping(prices):
    keys = parse_toml(PRICES, "")
    assert Prices.read(keys) == Prices.read(prices)
    wrong = keys | {"per_ball": {"value": 6, "unit": "USD", "source": "shop"}}
    with pytest.raises(InputError, match=r"^prices: .*per_ball is in USD, but per_minute in EUR"):
        vl.plan("asa", bat="softball-34", target_u=0.11, prices=wrong)


def test_offered_sheet_replaces_the_instrument(prices, tmp_path):
    vl.instrument("balance-stand").with_(offset_u="0.02 mm").save(tmp_path / "stand.toml")
    offer = 'source = "offer", sheet = "stand.toml"'
    prices.write_text(PRICES.replace('source = "offer"', offer, 1))
    sheet = Prices.read(prices).offers(prices, RIGS)["balance-stand"]
    assert (sheet.name, sheet.document["offset_u"]["value"]) == ("balance-stand", 0.02)
    vl.instrument("lab-scale").save(tmp_path / "stand.toml")
    with pytest.raises(InputError, match=r"stand\.toml: kind = .*the kind of balance-stand"):
        Prices.read(prices).offers(prices, RIGS)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (', unit = "EUR", source = "wages"', ', source = "wages"', "per_minute.unit.*missing"),
        ('source = "shop"', 'source = ""', "per_ball.source"),
        ("per_ball", "balls", "unknown key.*per_ball"),
        ("pivot-gates", "pivot-gate", "instruments.pivot-gate.*pivot-gates"),
        ('5000, unit = "EUR"', '5000, unit = "USD"', "pivot-gates is in USD"),
        ("value = 50,", "value = 0,", "at least 1"),
        (PRICES.splitlines()[1], "tests = 50", "tests = 50; must be a table { value, unit, source"),
    ],
)
def test_bad_prices(prices, old, new, message):
    prices.write_text(PRICES.replace(old, new))
    with pytest.raises(InputError, match=message) as fault:
        vl.plan("asa", bat="softball-34", target_u=0.1, prices=prices)
    assert "\n" not in str(fault.value)
    assert "prices.toml" in str(fault.value)


def test_form_of_prices(tmp_path):
    path = vl.template("prices", tmp_path / "prices.toml")
    document = parse_toml(path.read_text(), str(path))
    assert set(document) == set(Prices.__dataclass_fields__)
    with pytest.raises(InputError, match="source"):
        Prices.read(path)


def test_simulated_hits_scatter_as_those_of_the_history(folders):
    history = read_history(folders, Setup.of("softball-34", procedure="asa"))
    assert history.variance.shape == (3,)
    assert history.dof.tolist() == [5, 5, 5]
    wanted = DailyScatter(variance=0.7 * history.variance, dof=history.dof, at_wall=False)
    balls = balls_of(wanted, "softball-34", "asa", seed=5)
    with catalog.sheets_in_place(balls):
        sample = SampledTests.of(RoundRobin.of("softball-34", "asa"), 1024, 6)
    assert sample.total.mean() == pytest.approx(wanted.pooled, rel=0.1)


def test_history_changes_the_plans(folders):
    arguments = {"bat": "softball-34", "target_u": 0.2, "laboratories": 200}
    plain, informed = (vl.plan("asa", history=each, **arguments) for each in ((), folders))
    assert plain[0].simulated_u != informed[0].simulated_u


def test_daily_checks_give_the_scatter_at_the_wall(tmp_path):
    folder = vl.daily(days=8, baseline=6, seed=4).save(tmp_path / "daily")
    history = read_history([folder], Setup.of("r161", procedure="astm-f1881"))
    assert history.at_wall
    assert history.pooled**0.5 == pytest.approx(0.0037, rel=0.2)  # scatter of the check ball
    (text,) = balls_of(history, "r161", "astm-f1881", seed=5).values()
    scatter = parse_toml(text, "")["spread"]["hit_restitution"]["value"]
    assert scatter == pytest.approx(0.0037, rel=0.2)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (b"", "the file is empty"),
        (b"ball_restitution_sd\n.003\n", "ball_restitution_dof; this column is missing"),
        (b"ball_restitution_sd,ball_restitution_dof\n.003,5\nx,5\n", "sd = 'x'.*see row 2"),
        (b"ball_restitution_sd,ball_restitution_dof\n.003,5\n,5\n", "sd = nan.*see row 2"),
        (b"ball_restitution_sd,ball_restitution_dof\n.003,0\n.003,5\n", "dof = 0.*see row 1"),
        (
            b"ball_restitution_sd,ball_restitution_dof\n.003,5\n.003,1e300\n",
            "up to 1e.06; see row 2",
        ),
        (b"ball_restitution_sd,ball_restitution_dof\n-.003,5\n.003,5\n", "sd = -0.003; must be"),
    ],
)
def test_bad_table_of_daily_checks(rows, message, tmp_path):
    (tmp_path / "daily.csv").write_bytes(rows)
    with pytest.raises(InputError, match=rf"daily\.csv.*{message}"):
        read_history([tmp_path], Setup.of("r161", procedure="astm-f1881"))


def test_days_are_pooled_by_their_degrees_of_freedom():
    days = DailyScatter(
        variance=np.array([1.0, 2.0, 1.5]), dof=np.array([5.0, 10.0, 30.0]), at_wall=True
    )
    assert days.pooled == pytest.approx((5 * 1 + 10 * 2 + 30 * 1.5) / 45)


def test_days_that_differ_are_not_pooled():
    """The p-value is .053 for the first days and .041 for the next."""
    near, apart = (
        DailyScatter(variance=np.array([1.0, 1.0, last]), dof=np.full(3, 20.0), at_wall=False)
        for last in (2.5, 2.6)
    )
    assert near.pooled == pytest.approx(1.5)
    with pytest.raises(InputError, match=r"p = 0\.041"):
        _ = apart.pooled
    with pytest.raises(InputError, match=r"Bartlett's test, p = 0\.0011"):
        _ = DailyScatter(
            variance=np.array([1.0, 1.0, 4.0]), dof=np.full(3, 20.0), at_wall=False
        ).pooled
    with pytest.raises(InputError, match=r"2 days.*3 or more"):
        _ = DailyScatter(variance=np.ones(2), dof=np.ones(2), at_wall=True).pooled


def test_bad_history(folders, tmp_path):
    (tmp_path / "empty").mkdir()
    cases = (
        (folders[:2], "asa", "2 tests.*3 or more"),
        (folders, "astm-f1881", "metric = .v_f mph.*BPF"),
        (folders, vl.procedure("asa").with_(valid_hits=7), "procedure; is another"),
        ([*folders[:2], folders[0]], "asa", "same test"),
        ([tmp_path / "empty"], "asa", "not found"),
    )
    for history, procedure, message in cases:
        with pytest.raises(InputError, match=message) as fault:
            vl.plan(procedure, bat="softball-34", target_u=0.1, history=history)
        assert "\n" not in str(fault.value)
