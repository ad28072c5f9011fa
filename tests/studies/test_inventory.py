"""The statement of a gate's sheet on slow rebounds, against the gates themselves."""

import numpy as np
import pytest

import virtual_lab as vl
from virtual_lab import catalog
from virtual_lab.measurement.reduction.gates import passages
from virtual_lab.relations.flight import slowest_within
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.light_board import LightBoards, LightBoardSpec
from virtual_lab.simulation.instruments.light_gate import LightGates, LightGateSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Quiet
from virtual_lab.studies.inventory import show
from virtual_lab.units import MPH, STANDARD_GRAVITY

RADIUS = 0.0366


@pytest.mark.parametrize(
    ("v_in_mph", "efficiency", "distance", "fall"),
    [(60, 0.2, 0.25, 11e-3), (60, 0.2, 0.5, 43e-3), (60, 0.1, 0.5, 170e-3), (136, 0.1, 0.5, 33e-3)],
)
def test_the_fall_of_a_ball_agrees_with_a_hand_calculation(
    v_in_mph: float, efficiency: float, distance: float, fall: float
) -> None:
    """A rebound of a 60 mph ball at e_A = 0.2 falls 43 mm in half a meter [mm]."""
    slowest = slowest_within(distance, fall)
    assert slowest == pytest.approx(efficiency * v_in_mph * MPH, rel=0.03)  # half of 11 mm


def test_a_source_that_only_a_note_names_is_listed() -> None:
    assert {"nathan2003", "verypages", "axebat"} <= show("astm-f1881").document["sources"].keys()


def balls(speeds: np.ndarray) -> Passage:
    return Passage(
        speed_in=np.full(speeds.shape, 60.0),
        speed_out=speeds,
        drag=np.zeros(speeds.shape),
        radius=RADIUS,
        gravity=STANDARD_GRAVITY,
    )


@pytest.mark.parametrize("name", ["pivot-gates", "wall-gates"])
def test_curtains_lose_a_ball_that_is_slower_than_the_sheet_says(name: str) -> None:
    gates = LightGates.commission(
        catalog.load("instruments", name, LightGateSpec).spec, Quiet(), "g"
    )
    said = show(name).document["slowest_rebound"]
    for gate, row in enumerate(said["at_gates"]):
        speeds = row["speed_mph"] * MPH * np.array([0.999, 1.001])
        contact = np.full(2, 0.1)
        record = gates.watch(
            balls(speeds),
            contact,
            contact,
            Quiet(),
            "g",
            np.arange(speeds.size),
            RecordDetail.SUMMED,
        )
        assert np.isnan(record.times[:, 1, gate]).tolist() == [True, False]
    assert said["told_mph"] == said["at_gates"][0]["speed_mph"]


@pytest.mark.parametrize("detail", RecordDetail)
@pytest.mark.parametrize("name", ["light-boards", "swing-boards"])
def test_boards_see_a_ball_that_is_as_fast_as_the_sheet_says(
    name: str, detail: RecordDetail
) -> None:
    """At half that speed the ball falls four times as far, and is not detected."""
    spec = catalog.load("instruments", name, LightBoardSpec).spec
    boards = LightBoards.commission(spec, Quiet(), "b")
    said = show(name).document["slowest_rebound"]
    for board, row in enumerate(said["at_gates"]):
        speeds = row["speed_mph"] * MPH * np.array([0.5, 1.001])
        contact = np.full(2, 0.1)
        record = boards.watch(
            balls(speeds), contact, contact, Quiet(), "b", np.arange(speeds.size), detail
        )
        times = passages(record, lowest=spec.lowest, pitch=spec.pitch).times
        assert np.isnan(times[:, 1, board]).tolist() == [True, False]
    assert said["told_mph"] == said["at_gates"][-2]["speed_mph"]


def test_a_sheet_states_the_slowest_rebound_of_its_gates() -> None:
    """0.5502 m √(g / 0.15 m) = 4.449 m/s = 9.952 mph."""
    text = show("pivot-gates").text
    assert "75 mm of fall: 10.0 mph (4.4 m/s) at 0.5502 m, 4.5 mph (2.0 m/s) at 0.2499 m; " in text
    assert "slowest" not in show("lab-scale").text


def test_the_text_of_a_sheet_can_be_copied_and_used(tmp_path):
    """It is the text of the file, with comments and sources."""
    path = tmp_path / "copy.toml"
    path.write_text(vl.show("pivot-gates", toml=True).text + "\n", "utf-8")
    assert vl.Sheet.of("instruments", path).text == vl.instrument("pivot-gates").text
    assert vl.show("bbcor", toml=True).document["toml"].startswith('name = "bbcor"')
    for kind, function in (("instruments", vl.instrument), ("rigs", vl.rig)):
        shown = vl.show(f"{kind}/ball-cannon", toml=True)
        assert shown.text == function("ball-cannon").text.rstrip()


@pytest.mark.parametrize(
    "name", ["balls/baseball-2003", "instruments/pivot-gates", "rigs/astm-pivot", "bats/r161"]
)
def test_the_folder_of_a_file_tells_its_kind(name, tmp_path):
    path = tmp_path / f"{name}.toml"
    path.parent.mkdir()
    path.write_text(vl.show(name, toml=True).text, "utf-8")
    own, of_catalog = (show(each).document for each in (path, name))
    assert (own["kind"], own["numbers"]) == (of_catalog["kind"], of_catalog["numbers"])
