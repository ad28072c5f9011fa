"""Data sheets read from raw records, against the sheets of the instruments that wrote them."""

import numpy as np
import pytest

from tests.laboratories import opened
from virtual_lab import lab
from virtual_lab.lab.laboratory import constant_name
from virtual_lab.records import AimMarks
from virtual_lab.simulation.instruments import FittedStation
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.simulation.stations.rig import Stage

# numbers that records show exactly, and noise that they show up to the scatter of few readings
EXACT = {"distances", "swings", "marks", "beams", "lowest", "pitch", "sample_rate", "duration"}
EXACT |= {"counts_per_turn", "resolution"}
NOISE = {"repeatability", "timer_jitter", "along_scatter", "across_scatter", "edge_jitter"}
ABOUT = {"release_amplitude": 0.05, "amplitude_decay": 0.3}


@pytest.mark.parametrize("procedure", ["astm-f1881", "ncaa-modified"])
def test_the_records_of_a_day_show_the_sheets_of_its_instruments(procedure) -> None:
    laboratory = opened("r161", procedure=procedure, seed=5)
    day = lab.TestDay.begin(laboratory).measure_bat().hit_wall().prepare()
    day = day.fire(day.next_shots())
    compared = set()
    for stage, station in laboratory.stations.items():
        assert isinstance(station, FittedStation)
        records = day.collect_records().records[stage.value]
        for name, instrument in station.parts().values():
            prefix = constant_name(stage, f"{name}.")
            known = {
                key.removeprefix(prefix): float(each.value[0])
                for key, each in laboratory.calibration.items()
                if key.startswith(prefix)
            }
            channels = station.channels.get(name, (name,))
            written = [records[each] for each in channels if each in records]
            spec = instrument.spec
            shown = {
                key: each.value if isinstance(each, StandardDeviation) else each
                for key, each in spec.numbers_in(written, known).items()
            }
            for key in shown.keys() & EXACT:
                assert shown[key] == pytest.approx(getattr(spec, key)), (name, key)
            for key in shown.keys() & (NOISE | ABOUT.keys()):
                wide = 1.0 if key in NOISE else ABOUT[key]
                expected = pytest.approx(getattr(spec, key), rel=wide)
                assert shown[key] == expected, (name, key)
                assert shown[key] > 0.2 * getattr(spec, key), (name, key)
            compared |= shown.keys()
    assert compared >= {"repeatability", "distances", "swings", "along_scatter", "sample_rate"}
    bench = laboratory.stations[Stage.BENCH]
    assert isinstance(bench, FittedStation)
    shown = bench.numbers_in(day.collect_records().records["bench"], {})
    assert shown == {"repeats": bench.spec.repeats, "releases": bench.spec.releases}


def test_two_marks_show_a_scatter_and_one_mark_none() -> None:
    """Marks 1 and 3 mm from the aim have a standard deviation of √2 mm."""
    laboratory = opened("r161", procedure="astm-f1881")
    _, cannon = laboratory.stations[Stage.IMPACT].parts()["cannon"]
    spec = cannon.spec
    along = np.array([1e-3, 3e-3])
    two, one = (AimMarks(along=along[:count], across=along[:count]) for count in (2, 1))
    shown = spec.numbers_in([two], {})
    assert (shown["marks"], shown["mark_resolution"]) == (2, 0)
    assert shown["along_scatter"].value == pytest.approx(2e-3 / np.sqrt(2))
    assert spec.numbers_in([one], {}) == {}


def test_each_board_has_the_stated_height() -> None:
    """The sheets of the catalog have boards at the line of fire, which a laboratory's may not."""
    _, boards = opened("r161", procedure="bbcor").stations[Stage.IMPACT].parts()["gates"]
    stated = {"distance_0": -0.6, "distance_1": -0.3, "height_0": 1e-3, "height_1": -2e-3}
    assert boards.spec.numbers_in([], stated)["heights"] == (1e-3, -2e-3)
