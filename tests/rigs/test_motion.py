"""The pymunk model of the motion: agreement with the closed form, and refusals."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.laboratories import certify
from virtual_lab import api, lab
from virtual_lab.cli import cli
from virtual_lab.errors import InputError
from virtual_lab.simulation.stations.rig import MotionModel, Reality

DONE = {"astm-pivot": "astm-f1881", "ball-cannon": "bbcor"}


def certified(rig: str, motion: str, reality: Reality) -> lab.BatTest:
    return certify(
        "r161", procedure=DONE[rig], rig=rig, seed=1, reality=reality, motion=MotionModel(motion)
    )


@pytest.mark.parametrize("rig", DONE)
def test_an_ideal_laboratory_by_pymunk_recovers_the_truth(rig: str) -> None:
    found = certified(rig, "pymunk", Reality.IDEAL)
    metric, true = found.certification.metric, found.sealed.measurand["metric"]
    assert metric is not None
    assert metric.value == pytest.approx(true, rel=1e-9)
    motion = found.certification.session.origin.rungs["motion"]
    assert (motion.rung, motion.reason) == ("pymunk", "pymunk, as requested")


@pytest.mark.parametrize("rig", DONE)
def test_both_models_of_the_motion_give_one_certificate(rig: str) -> None:
    """A real day with drag, gravity and an aim off the bat's axis; scenes use no closed form."""
    closed, carried = (certified(rig, motion, Reality.REAL) for motion in ("closed-form", "pymunk"))
    for name, budget in closed.certification.quantities.items():
        other = carried.certification.quantities[name]
        assert other.value == pytest.approx(budget.value, rel=1e-6), name
        assert other.u == pytest.approx(budget.u, rel=1e-6), name
    for name, shots in closed.sealed.shots.items():
        np.testing.assert_allclose(carried.sealed.shots[name], shots, rtol=1e-9, err_msg=name)
    # the last bits of a scene differ: exact equality would mean that no scene was played
    back = (each.sealed.shots["rebound_speed"] for each in (closed, carried))
    assert next(back).tobytes() != next(back).tobytes()


def test_a_rig_without_a_motion_model_refuses_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="motion = 'pymunk'; allowed at ncaa-swing: closed-form"):
        api.certify("r161", procedure="ncaa-besr", motion="pymunk")
    words = ["certify", "r161", "--procedure", "ncaa-besr", "--motion", "pymunk"]
    done = CliRunner().invoke(cli, [*words, "--out", str(tmp_path / "out")])
    assert done.exit_code != 0
    assert not (tmp_path / "out").exists()


def test_an_unknown_motion_is_refused() -> None:
    with pytest.raises(InputError, match="motion = 'slow'; allowed: closed-form or pymunk"):
        api.certify("r161", motion="slow")
