"""The checks: quiet on sound days, and each of them can speak."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from virtual_lab.certificate.document import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.text import certificate_text
from virtual_lab.lab import certify_bat
from virtual_lab.measurement.certification import certify_session
from virtual_lab.measurement.diagnostics.flag import chance, type_a
from virtual_lab.simulation.rig import Reality


@pytest.mark.parametrize("reality", [Reality.IDEAL, Reality.NOISE_FREE])
@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor", "ncaa-besr"])
def test_a_laboratory_without_noise_is_never_flagged(procedure: str, reality: Reality) -> None:
    """Nothing scatters there, so that rounding alone must not look like a difference."""
    found = certify_bat("r161", procedure=procedure, seed=0, reality=reality).certification
    assert found.flags == ()


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor", "proposed", "ncaa-besr"])
def test_sound_days_are_quiet(procedure: str) -> None:
    """Of 5 sound days none is flagged: 95 % likely at the 1 % a day that is allowed."""
    for seed in range(300, 305):
        assert certify_bat("r161", procedure=procedure, seed=seed).certification.flags == ()


def test_chance_is_students() -> None:
    """Against SciPy's own t: one scatter, nothing below it."""
    for value, dof in ((2.0, 5.0), (3.3, 40.0), (-4.0, 11.0)):
        u, likely = chance(value, [type_a(1.0, dof)], least=1e-9)
        assert u == pytest.approx(1.0)
        assert likely == pytest.approx(2 * stats.t.sf(abs(value), dof), rel=1e-6)


SPOKEN = {  # fault: check that speaks, by the ASTM procedure
    "balance-from-knob": "bat-shape",
    "pendulum-wide": "pendulum-swing",
    "ball-worn-out": "lot-rules",
    "wall-drift": "wall-drift",
    "gate-doubles": "chords",
    "gate-misses": "ball-seen",
    "aim-across": "aim",
    "encoder-play": "encoder-fit",
    "aim-along": "recoil-and-rebound",
}


@pytest.mark.parametrize("fault", SPOKEN)
def test_each_check_speaks(fault: str) -> None:
    """On one day each, chosen so that it does; how often it does is the table of the faults."""
    found = certify_bat("r161", procedure="astm-f1881", seed=13, faults=(fault,)).certification
    assert SPOKEN[fault] in [flag.name for flag in found.flags]


@pytest.mark.parametrize(
    ("fault", "check"), [("gate-moved", "boards-in-line"), ("sabot-trip", "edges")]
)
def test_each_check_of_boards_speaks(fault: str, check: str) -> None:
    found = certify_bat("r161", procedure="bbcor", seed=12, faults=(fault,)).certification
    assert check in [flag.name for flag in found.flags]


def test_a_flag_stands_on_every_certificate() -> None:
    found = certify_bat("r161", procedure="astm-f1881", seed=12, faults=("aim-across",))
    document = certificate(found.certification)
    (flag,) = document["flags"]
    assert flag["name"] == "aim"
    assert flag["sentence"] in certificate_text(document)
    assert flag["sentence"] in certificate_page(document, found.certification)


def test_a_softball_bat_under_a_baseball_procedure_is_flagged() -> None:
    """As the session says it, without truth."""
    found = certify_bat("softball-34", procedure="astm-f1881", seed=0, reality=Reality.IDEAL)
    (flag,) = found.certification.flags
    assert flag.name == "sports"
    assert "bat is of softball, the ball is of baseball, the procedure is of" in flag.sentence
    document = certificate(found.certification)
    assert document["flags"] == [{"name": "sports", "sentence": flag.sentence}]
    assert flag.sentence in certificate_text(document)
    assert flag.sentence in certificate_page(document, found.certification)
    unknown = replace(found.certification.session, bat_sport="")
    assert certify_session(unknown).flags == ()
    swapped = replace(found.certification.session, bat_sport="baseball", ball_sport="softball")
    assert "ball is of softball" in certify_session(swapped).flags[0].sentence


def test_a_bat_of_the_same_sport_is_not() -> None:
    found = certify_bat("softball-34", procedure="asa", seed=0, reality=Reality.IDEAL)
    assert found.certification.flags == ()


def test_a_check_standard_is_no_bat_that_passed() -> None:
    """The cylinder meets the rules' numbers, and no bat has passed by it."""
    found = certify_bat("check-cylinder", procedure="astm-f1881", seed=0, reality=Reality.IDEAL)
    assert found.certification.verdict.value == "PASS"
    assert [flag.name for flag in found.certification.flags] == ["check-standard"]
    assert "no bat" in certificate_text(certificate(found.certification))
    unmarked = replace(found.certification.session, bat_sport="")
    assert certify_session(unmarked).flags == ()


def test_a_sentence_tells_the_size_of_what_is_wrong() -> None:
    """A board knocked by 1 mm: half of it shows at the board between."""
    found = certify_bat("r161", procedure="bbcor", seed=12, faults=("gate-moved",)).certification
    (said,) = [flag.sentence for flag in found.flags if flag.name == "boards-in-line"]
    shown = float(said.split(" mm")[0].rpartition(" ")[2])
    assert abs(shown) == pytest.approx(0.5, abs=0.3)
    assert np.isfinite(shown)
