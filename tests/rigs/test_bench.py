"""The bench: position of its readings on the bat."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rigs.conformance import Bench
from virtual_lab.simulation.stations.rig import Stage, find_rig
from virtual_lab.streams import Quiet


def test_the_barrels_radius_is_read_six_inches_from_the_tip(tmp_path) -> None:
    """A cone of 60 mm at the tip loses 1 mm per inch: 54 mm at 6 in, a radius of 27 mm."""
    bench = Bench(find_rig("bench", Stage.BENCH), tmp_path)
    specimen = bench.specimen
    profile = specimen.bat.body.profile
    cone = tuple(0.060 - 1e-3 * z / 0.0254 for z in profile.z)
    body = replace(specimen.bat.body, profile=replace(profile, outer_diameter=cone))
    station = bench.rig.commission(Quiet(), ideal=True)
    struck = replace(specimen, bat=replace(specimen.bat, bodies=(body,)))
    read = station.play(bench.plan(), struck, Quiet()).records["barrel-radius"].readings
    offset = station.true_constants["rule.offset"]
    assert np.mean(read) - offset == pytest.approx(0.027, abs=1e-9)
