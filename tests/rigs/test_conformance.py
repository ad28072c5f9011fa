"""Every installed rig, of this project or a third party, passes the same suite."""

from pathlib import Path

import numpy as np
import pytest

from tests.rigs import conformance
from virtual_lab.errors import InputError
from virtual_lab.records import ShotLog
from virtual_lab.simulation.stations.rig import RigOutput, Stage, find_rig, installed_rigs
from virtual_lab.streams import Quiet

OURS = {"astm-pivot", "ball-cannon", "ball-wall", "bench", "ncaa-swing"}
THIRD_PARTY = "speed-gun-pivot"
INSTALLED = installed_rigs()
BENCHES: dict[str, conformance.Bench] = {}


def test_ours_and_the_third_partys_are_discovered() -> None:
    """Entry points of two distributions are found: this project and tests/third_party_rig."""
    assert OURS | {THIRD_PARTY} <= INSTALLED.keys()
    assert type(INSTALLED[THIRD_PARTY]).__module__ == "third_party_rig"


@pytest.mark.parametrize("name", INSTALLED)
def test_a_rig_is_installed_under_its_own_name(name: str) -> None:
    """`find_rig` uses the entry point and certificates print `Rig.name`: both must agree."""
    assert INSTALLED[name].name == name


@pytest.mark.parametrize("check", conformance.CHECKS, ids=conformance.name_of)
@pytest.mark.parametrize("name", INSTALLED)
def test_every_installed_rig_passes_the_conformance_suite(name: str, check, tmp_path: Path) -> None:
    """The suite of tests/rigs/conformance.py passes for each rig."""
    bench = BENCHES.setdefault(name, conformance.Bench(INSTALLED[name], tmp_path))
    bench.folder = tmp_path
    check(bench)


class Leaky:
    """A rig with every fault that the suite detects and that does not prevent a play."""

    name, stage = "Leaky ", Stage.IMPACT
    channels = {"../log": ShotLog}  # noqa: RUF012
    calibration = (
        conformance.Bench(INSTALLED["ball-wall"], Path()).rig.commission(Quiet()).calibration
    )
    true_constants = dict.fromkeys(calibration, np.nan)
    state = 0.0

    def commission(self, draws, *, ideal=False):
        return self

    def play(self, plan, specimen, draws):
        Leaky.state += 1
        log = ShotLog(
            ball=plan.ball,
            nominal_speed=plan.speed * 0 + Leaky.state,
            place=plan.place * 0 + float(conformance.SEED),
        )
        return RigOutput(records={"notes": log, "log": log}, truth={"speed": np.zeros(1)})


@pytest.mark.parametrize(
    "check",
    [
        conformance.attributes,
        conformance.records_are_as_declared,
        conformance.same_seed_same_records,
        conformance.a_shot_hangs_on_its_number_alone,
        conformance.true_constants_are_known_ones,
        conformance.quiet_laboratory_is_nominal,
        conformance.ideal_rig_has_no_uncertainty,
        conformance.calibration_is_of_estimates,
        conformance.truth_has_a_shot_axis,
        conformance.seed_is_in_no_record,
        conformance.log_is_the_order,
        conformance.impact_station_knows_the_measurand,
    ],
    ids=conformance.name_of,
)
def test_the_suite_catches_a_bad_rig(check, tmp_path: Path) -> None:
    """Each check must fail if its requirement is broken."""
    with pytest.raises((AssertionError, KeyError)):
        check(conformance.Bench(Leaky(), tmp_path))


@pytest.mark.parametrize(("name", "stage"), [("astm-pivto", "impact"), ("bench", "impact")])
def test_an_unknown_rig_is_refused_in_one_line(name: str, stage: str) -> None:
    """`find_rig` names the key, the value and the rigs of that stage."""
    with pytest.raises(InputError) as caught:
        find_rig(name, Stage(stage))
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert f"impact rig = '{name}'" in sentence
    assert "astm-pivot" in sentence
    assert "ball-wall" not in sentence
