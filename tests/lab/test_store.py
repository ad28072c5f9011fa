"""The store of the balls: its humidity, its effect on e0 and on results, and its readings."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest

import virtual_lab as vl
from tests.laboratories import certify, opened
from virtual_lab import catalog, lab
from virtual_lab.lab.measurand import true_curve
from virtual_lab.measurement.procedure.model import AS_FOUND
from virtual_lab.simulation.stations.rig import Reality

INCH = 0.0254
ASTM_U = 0.0046  # standard uncertainty of BPF by astm-f1881
STANDARD = 0.50  # relative humidity at which the sheet's e0 holds


@contextmanager
def stored(**changes: float) -> Iterator[None]:
    """Give the store of the bench other values [%]."""
    values = {f"store.{key}": f"{value} %" for key, value in changes.items()}
    sheet = vl.rig("bench").with_(values)
    with catalog.sheets_in_place({("rigs", "bench"): sheet.text}):
        yield


def results(bat: str, procedure: str, inches: list[float], humidity: float) -> np.ndarray:
    """Return e and e0 of a lot kept at a humidity, at the greatest e of some positions."""
    laboratory = opened(bat, procedure=procedure, reality=Reality.NOISE_FREE)
    balls = laboratory.specimen.balls.after_storage(humidity)
    specimen = replace(laboratory.specimen, balls=balls)
    places = np.array(inches) * INCH
    curve = true_curve(laboratory.impact, specimen, laboratory.rules.spec, places)
    best = curve.restitution.argmax()
    return np.array([curve.restitution[best], curve.ball_restitution[best]])


def test_lots_of_a_store_have_the_published_fall_of_e0() -> None:
    """12 % of e0 from 0 to 100 % relative humidity, so .0012 of .55 per percent and lot.

    With the same draws and no spread of the store, each lot has e0 of 50 %.
    """
    setup = lab.RoundRobin.of("r161", "astm-f1881").setup

    def lots() -> lab.Laboratory:
        return lab.Laboratory.open(replace(setup, seed=3, number=np.arange(200)))

    with stored(humidity_spread=0):
        plain = lots().specimen.balls
    with stored(humidity_spread=8):
        damp = lots().specimen.balls
    assert damp.store is not None
    assert np.abs(damp.store.std() / 0.08 - 1) < 4.5 / sqrt(2 * 200)
    expected = plain.spec.restitution.value * -0.12 * (damp.store - STANDARD)
    assert (damp.restitution - plain.restitution).mean(axis=1) == pytest.approx(expected, abs=1e-12)
    slopes = damp.spec.restitution.slope / plain.spec.restitution.slope
    assert slopes == pytest.approx(1 - 0.12 * (damp.store - STANDARD), abs=1e-12)


@pytest.mark.parametrize(
    ("bat", "inches", "most"), [("r161", 6.4, 0.02), ("ea70", 7.1, 0.4)], ids=["rigid", "hollow"]
)
def test_bpf_of_damp_balls_moves_by_the_shell_alone(bat: str, inches: float, most: float) -> None:
    """A store 8 % off moves BPF of a rigid shell by nothing, of a hollow one by at most .4 u."""
    e, e0 = np.array([results(bat, "astm-f1881", [inches], h) for h in (0.42, 0.5, 0.58)]).T
    shift = np.abs(e / e0 - e[1] / e0[1]).max()
    assert np.ptp(e0) == pytest.approx(0.55 * 0.12 * 0.16, rel=1e-6)
    assert shift <= most * ASTM_U
    assert bat == "r161" or shift > 0.2 * ASTM_U


@pytest.mark.parametrize(("bat", "most"), [("r161", 5e-4), ("ea70", 3e-4)])
def test_a_result_normalized_by_trampoline_hardly_feels_the_store(bat: str, most: float) -> None:
    """From 42 to 58 % relative humidity e moves by .008, and normalized by 1/20 of it or less.

    The wood bat keeps an effect of a third of u, because a ball of lower e0 bends it less.
    """
    inches = list(np.arange(5, 7.6, 0.5))
    e, e0 = np.array([results(bat, "bbcor", inches, h) for h in (0.42, 0.5, 0.58)]).T
    stiffness = np.where(e > e0, (1 - e**2) / (e**2 - e0**2), np.inf)  # shell over ball
    rigid = 0.5 * e / e0
    sprung = np.sqrt(0.25 + 0.75 / (stiffness + 1))
    normalized = np.where(e > e0, sprung, rigid)
    assert e0 / e0[1] == pytest.approx([1.0096, 1, 0.9904], rel=1e-9)  # 12 % of e0 at 136 mph too
    assert np.ptp(e) > 0.007
    assert np.ptp(normalized) < most


def test_the_store_is_recorded_flagged_and_no_line_of_the_budget() -> None:
    """At 70 % where 40 to 60 % are allowed: readings, and a flag without INVALID.

    As found, the result is lower; it holds for these balls, so the store adds nothing to its u.
    """
    choices: dict[str, Any] = {"procedure": "bbcor", "seed": 2}
    plain = certify("r161", **choices)
    with stored(humidity=70, humidity_spread=0):
        damp = certify("r161", **choices)
    session = damp.certification.session
    record: Any = session.records["bench"]["store"]
    shown = record.humidity
    error = session.calibration["bench.climate.humidity"]
    assert shown.shape == (2,)
    assert shown.mean() - error.value == pytest.approx(0.70, abs=0.01 + 3 * error.u)
    assert damp.sealed.document()["balls"]["store_humidity"] == pytest.approx(0.70)
    (flag,) = (each for each in damp.certification.flags if each.name == "store")
    assert "% relative humidity, allowed 40 to 60 %" in flag.sentence
    assert not flag.invalidates
    assert "store" not in {each.name for each in plain.certification.flags}
    found, before = (each.certification.quantities[AS_FOUND] for each in (damp, plain))
    assert found.value < before.value - 0.005
    true, dry = (each.sealed.measurand[AS_FOUND] for each in (damp, plain))
    assert true < dry - 0.008
    assert found.u < 1.1 * before.u  # 1.7 times if the spread of the store were counted again
    assert not [each for each in found.components if "store" in each.name]
