"""Prices of plans: what they change, and bad input in one line."""

import numpy as np
import pytest

import virtual_lab as vl
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml
from virtual_lab.studies.plan.prices import Prices

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


def test_price_of_plans(prices):
    table = Prices.read(prices)
    assert list(table.offers(prices, RIGS)) == ["balance-stand", "pivot-gates"]
    minutes, balls = np.array([100.0, 120.0]), np.array([12, 24])
    price = table.of_plans(["balance-stand", "pivot-gates"], minutes, balls)
    tests = [50 * (150 + 72), 50 * (180 + 144)]
    assert price.tolist() == [[base + more for base in tests] for more in (0, 900, 5000, 5900)]


def test_plans_by_price(prices, monkeypatch):
    monkeypatch.setattr("virtual_lab.studies.plan.laboratory.PILOT", 256)
    plans = vl.plan("asa", bat="softball-34", target_u=0.11, prices=prices, laboratories=200)
    present, *rows = plans
    assert present.currency == "EUR"
    assert present.price == pytest.approx(50 * (1.5 * present.minutes + 6 * 12))
    for compared in ("chosen", "equal", "higher"):
        cost = [row.price for row in rows if row.plan.isdigit() and row.compared == compared]
        assert cost == sorted(cost)
    assert f"; chosen by price: {rows[0].price:.0f} EUR; exchanged: " in plans.title
    assert plans.text.count("less than 375 EUR above") == 2  # five minutes of 50 tests
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
    with pytest.raises(InputError, match=r"source = ''; must not be empty"):
        Prices.read(path)
