"""Hits off the center of percussion, against free bats that take up the clearance by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.laboratories import opened
from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.simulation.faults.fault import with_sheet
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.stations.rig import Reality, ShotPlan, Stage
from virtual_lab.studies.bats.percussion import PercussionStudy, PositionReadings, percussion

INCH = 0.0254


@pytest.fixture(scope="module")
def found() -> PercussionStudy:
    return percussion("r161", laboratories=2, shots=3)


def at(found: PercussionStudy, z: float) -> PositionReadings:
    """Return the row of an impact position."""
    return min(found.rows, key=lambda row: abs(row.impact_position_in - z))


def test_the_axis_bears_nothing_at_the_centre_of_percussion(found: PercussionStudy) -> None:
    """Eq. (11) for Table I gives 6.3956 in; beyond it the force changes sign."""
    assert found.percussion_in == pytest.approx(6.3956, abs=2e-3)
    assert at(found, found.percussion_in).reaction_ns == pytest.approx(0, abs=1e-12)
    assert at(found, 2).reaction_ns < -0.5
    assert at(found, 12).reaction_ns > 0.5


def test_a_plain_bearing_costs_what_it_rubs(found: PercussionStudy) -> None:
    """δω = μ R_j |J| / I_p, 0.09 less the installed 0.003, and δe_A = (1 + e_A) δω/ω."""
    beam = beam_of(catalog.load_bat("r161").spec.body)
    axis = 28 * INCH
    lever = axis - beam.z_cm
    for row in (at(found, 3), at(found, 11)):
        b = axis - row.impact_position_in * INCH
        # the impulse of the ball is J; the axis takes J - M d ω with ω = J b / I_p
        blow = row.reaction_ns / (1 - beam.mass * lever * b / beam.inertia(axis))
        turn = blow * b / beam.inertia(axis)
        lost = 0.087 * 0.010 * abs(row.reaction_ns) / beam.inertia(axis)
        assert row.plain_shift == pytest.approx(
            -(1 + row.collision_efficiency) * lost / turn, rel=0.02
        )


def test_play_costs_nothing_but_hard_by_the_centre_of_percussion(found: PercussionStudy) -> None:
    """The angle of the play is a constant of the fit, unless it is taken up during the fit."""
    for row in found.rows:
        if abs(row.impact_position_in - found.percussion_in) > 0.1:
            assert abs(row.loose_shift) < 1e-9
        elif abs(row.impact_position_in - found.percussion_in) > 1e-6:
            assert abs(row.loose_shift) > 5e-4


@pytest.mark.parametrize("place", [3.0, 10.0])
def test_a_loose_bat_turns_as_a_free_one_until_its_journal_bears(place: float) -> None:
    """By hand: a free rigid bat is hit, stops at the axis after 0.2 mm, then turns about it."""
    laboratory = opened("r161", procedure="astm-f1881", seed=0, reality=Reality.NOISE_FREE)
    fixed = laboratory.stations[Stage.IMPACT]
    one = np.zeros(1, dtype=int)
    speed = laboratory.rules.spec.ball_speed
    plan = ShotPlan(slot=one, ball=one, speed=np.array([speed]), place=np.array([place * INCH]))
    fine = with_sheet(fixed, "pivot", friction=0.0, clearance=0.0)
    fine = replace(fine, encoder=replace(fine.encoder, spec=laboratory_spec(fine)))
    counts, truth = [], {}
    for clearance in (0.0, 0.2e-3):
        play = with_sheet(fine, "pivot", clearance=clearance).play(
            plan, laboratory.specimen, laboratory.draws
        )
        counts.append(play.records["encoder"].counts[0])
        truth = play.truth
    beam = beam_of(laboratory.specimen.bat.body)
    axis = beam.length - 6 * INCH
    d, z = axis - beam.z_cm, place * INCH
    ball = laboratory.specimen.balls.mass[0]
    blow = ball * speed * (1 + truth["collision_efficiency"][0])
    free = blow * (beam.z_cm - z) / beam.inertia_cm
    slips = blow / beam.mass - free * d  # force at the journal, along the ball's flight
    pinned = blow * (axis - z) / beam.inertia(axis)
    by_hand = (free - pinned) * 0.2e-3 / abs(slips)
    turned = (counts[1] - counts[0]) * 2 * np.pi / 10_000
    assert turned[-1] == pytest.approx(by_hand, rel=1e-3)
    late = turned[len(turned) // 2 :]
    assert np.ptp(late) < 1e-12


def laboratory_spec(station: object) -> object:
    """Return the encoder's sheet with a continuous count."""
    return replace(station.encoder.spec, whole_counts=False)  # type: ignore[attr-defined]


def test_table_text_and_picture_are_saved(found: PercussionStudy, tmp_path: Path) -> None:
    said = found.text
    assert "At the center of percussion, 6.40 in, the impulse on the axis" in said
    assert "The gates miss most rebounds at 2, " in said
    found.save(tmp_path / "out")
    assert len(pd.read_csv(tmp_path / "out" / "percussion.csv")) == len(found.rows) == 14
    assert (tmp_path / "out" / "percussion.png").read_bytes().startswith(b"\x89PNG")


def test_one_laboratory_is_too_few() -> None:
    with pytest.raises(InputError, match="at least 2"):
        percussion("r161", laboratories=1)
