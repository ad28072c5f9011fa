"""Faults of a day: their effect on a record in closed form, and what they must not change."""

from __future__ import annotations

from itertools import pairwise
from math import radians, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipk

from tests.laboratories import certified
from virtual_lab import catalog, lab
from virtual_lab.api import certify
from virtual_lab.catalog.faults import FaultSheet
from virtual_lab.errors import InputError
from virtual_lab.measurement.diagnostics import CHECKS
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.faults import CATALOGUE, FaultSet
from virtual_lab.simulation.stations.rig import Stage, find_rig
from virtual_lab.streams import Quiet
from virtual_lab.units import MPH, OUNCE

NAMES = catalog.names("faults")


def played(*faults: str, seed: int = 11) -> lab.BatTest:
    """Play one laboratory by the ASTM procedure."""
    return certified(seed=seed, faults=faults)


def record(channel: str, *faults: str, stage: str = "impact", seed: int = 11):
    """Return one record of a day with faults."""
    return played(*faults, seed=seed).certification.session.records[stage][channel]


def test_every_fault_has_its_file_and_every_file_its_fault() -> None:
    assert set(NAMES) == set(CATALOGUE)
    assert len(NAMES) >= 20


@pytest.mark.parametrize("name", NAMES)
def test_every_fault_sheet_is_valid(name: str) -> None:
    """Each prediction names a procedure whose rig the fault can befall, and an existing check."""
    sheet = catalog.load("faults", name, FaultSheet).spec
    assert sheet.name == name
    for prediction in sheet.predictions:
        rules = catalog.load("procedures", prediction.procedure, Procedure).spec
        assert FaultSet.of([name], rig=rules.rig).names == (name,)
        catches = {each for each in prediction.caught_by.split(", ") if each}
        assert catches <= {"INVALID", *CHECKS}


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor"])
def test_edge_times_of_an_egg_shaped_ball_are_in_order(procedure: str) -> None:
    """The outer beams of a board see the ball for less time than its shape removes."""
    day = certified(procedure=procedure, seed=3, faults=("ball-out-of-round",))
    for stage, records in day.certification.session.records.items():
        for channel, each in records.items():
            late = [order.column for order in each.orders() if order.first_fault() is not None]
            assert late == [], f"{stage}/{channel}"


def test_an_unknown_fault_is_named_with_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean gate-moved"):
        certify("r161", procedure="astm-f1881", seed=1, faults=("gate-move",))


def test_a_fault_that_cannot_befall_the_rig_names_those_it_can() -> None:
    with pytest.raises(InputError, match="no fault of the rig ball-cannon; allowed: aim"):
        certify("r161", procedure="bbcor", seed=1, faults=("encoder-slip",))


def test_faults_befall_a_rig_of_another_maker_by_its_instruments() -> None:
    """The rig has gates and air, but neither our cannon nor an encoder; no fault names it."""

    def possible_at(name: str) -> bool:
        try:
            return bool(FaultSet.of([name], rig="speed-gun-pivot").names)
        except InputError:
            return False

    able = {name for name in NAMES if possible_at(name)}
    assert {"gate-moved", "gate-clock", "gate-misses", "sabot-trip", "wrong-lot"} <= able
    assert not {"encoder-slip", "encoder-half-counts", "bearing-friction", "aim-along"} & able
    day = FaultSet.of(["gate-clock"], rig="speed-gun-pivot")
    sound = find_rig("speed-gun-pivot", Stage.IMPACT).commission(Quiet())
    fast = day.station(Stage.IMPACT, sound).true_constants["gates.clock"]
    assert fast == pytest.approx(sound.true_constants["gates.clock"] * (1 + 1e-4), rel=1e-12)


def test_a_sound_day_is_the_day_without_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    """The records are the same bits as without the hooks of the faults."""
    sound = certified(seed=5).certification
    monkeypatch.setattr(FaultSet, "station", lambda self, stage, station: station)
    monkeypatch.setattr(FaultSet, "calibration", lambda self, known: known)
    monkeypatch.setattr(
        FaultSet,
        "play",
        lambda self, stage, station, plan, specimen, draws: station.play(plan, specimen, draws),
    )
    bare = certify("r161", procedure="astm-f1881", seed=5).certification
    assert sound.metric == bare.metric
    for stage, records in sound.session.records.items():
        for channel, each in records.items():
            for name in each.columns:
                other = getattr(bare.session.records[stage][channel], name)
                assert np.array_equal(getattr(each, name), other, equal_nan=True)


@pytest.mark.parametrize("fault", ["encoder-slip", "clamp-forgotten", "wrong-lot", "sabot-trip"])
def test_only_the_truth_names_the_fault(fault: str, tmp_path: Path) -> None:
    certificate = certify("r161", procedure="astm-f1881", seed=3, faults=(fault,))
    folder = certificate.save(tmp_path / "out")
    for path in folder.rglob("*"):
        if path.is_file():
            assert (fault in path.read_text("utf-8")) == (path.name == "truth.json"), path


def test_two_faults_at_once_add() -> None:
    """The errors of e_A due to a gate and a scale add up to within 2 % of their sum."""
    sound, gate, scale, both = (
        played(*faults).certification.quantities["collision_efficiency"].value
        for faults in ((), ("gate-moved",), ("scale-not-tared",), ("gate-moved", "scale-not-tared"))
    )
    assert played("gate-moved", "scale-not-tared").sealed.faults == (
        "gate-moved",
        "scale-not-tared",
    )
    alone = (gate - sound) + (scale - sound)
    assert abs(alone) > 0.015
    assert both - sound == pytest.approx(alone, rel=0.02)


def test_a_moved_gate_reads_fast() -> None:
    """The gate distance is 299 mm instead of 300 mm; drag changes the ratio by 1e-5."""
    quick = [played(*on).certification.shots.speed for on in ((), ("gate-moved",))]
    assert quick[1] / quick[0] == pytest.approx(300 / 299, rel=2e-4)


def test_a_wide_pendulum_swings_by_the_elliptic_integral() -> None:
    """T/T0 = 2 K(sin²(θ/2))/π at both amplitudes, averaged over ten decaying swings."""

    def longer(released: float) -> float:
        swings = radians(released) * 0.995 ** (np.arange(10) + 0.5)
        return float(np.mean(2 / np.pi * ellipk(np.sin(swings / 2) ** 2)))

    means = [
        np.ptp(record("pendulum", *on, stage="bench").times, axis=1).mean()
        for on in ((), ("pendulum-wide",))
    ]
    assert means[1] / means[0] == pytest.approx(longer(20) / longer(4), abs=5e-6)
    noted = record("pendulum", "pendulum-wide", stage="bench").first_amplitude
    assert noted == pytest.approx(radians(4), abs=radians(0.2))


def test_a_cracked_bat_rings_lower() -> None:
    """Every frequency falls with the root of the moduli, to √0.9."""
    rings = [
        played(*on).certification.readings.recoil.ring_frequency[:3]
        for on in ((), ("bat-cracked",))
    ]
    assert rings[1] / rings[0] == pytest.approx(sqrt(0.9), abs=0.01)


def test_a_slipped_encoder_loses_its_counts() -> None:
    slipped = record("encoder", "encoder-slip").counts
    sound = record("encoder").counts
    shots = min(len(sound), len(slipped))
    lost = sound[:shots] - slipped[:shots]
    assert set(np.unique(lost)) == {0.0, 20.0}
    assert (np.diff(lost, axis=1) >= 0).all()


def test_the_encoder_lags_by_the_play_at_most() -> None:
    """Play of 0.3 degrees is 8 of 10 000 counts; the encoder lags by at most 8 and never leads."""
    sound, slack = record("encoder").counts, record("encoder", "encoder-play").counts
    shots = min(len(sound), len(slack))
    lag = sound[:shots] - slack[:shots]
    assert lag.min() == 0
    assert lag.max() == 8


def test_the_log_has_the_nominal_speed() -> None:
    log = record("log", "cannon-slow")
    assert log.nominal_speed == pytest.approx(60 * MPH)
    assert played("cannon-slow").sealed.shots["speed"].mean() == pytest.approx(
        57 * MPH, abs=0.5 * MPH
    )


def test_ounces_entered_as_grams_are_wrong_by_their_ratio() -> None:
    sound, mistaken = (
        record("ball-mass", *on, stage="bench").readings for on in ((), ("ounces-as-grams",))
    )
    # the mistaken masses are outside the windows, so these are balls of another box
    assert sound.mean() / mistaken.mean() == pytest.approx(OUNCE / 1e-3, rel=5e-3)


def test_swapped_records_have_the_same_contents() -> None:
    sound, swapped = (record("gates", *on).times for on in ((), ("records-swapped",)))
    assert np.array_equal(swapped[[0, 4, 2, 3, 1, 5]], sound, equal_nan=True)


def test_a_fault_that_comes_and_goes_spares_some_shots() -> None:
    """The fault strikes 60 % of the shots: of 36 shots, between a third and nine tenths."""
    struck = [
        np.ptp(
            record("gates", "gate-doubles", seed=seed).times[:6, 0, 1]
            - record("gates", seed=seed).times[:6, 0, 1],
            axis=-1,
        )
        for seed in range(20, 26)
    ]
    assert set(np.round(np.unique(struck), 7)) == {0.0, 4e-4}
    assert 1 / 3 < np.mean(np.array(struck) > 0) < 0.9


def test_a_fault_given_twice_counts_once() -> None:
    day = FaultSet.of(("gate-moved", "aim-along", "gate-moved"), rig="astm-pivot")
    assert day.names == ("gate-moved", "aim-along")
    assert all(one != other for one, other in pairwise(day.names))
