"""The four bats against Table I of the paper."""

import pytest

from virtual_lab.catalog import load_bat
from virtual_lab.simulation.physics.beam import Free, beam_of
from virtual_lab.simulation.physics.modes import barrel_nodes, modes_of
from virtual_lab.units import INCH, OUNCE

BATS = ("r161", "ea70", "barrel-loaded", "knob-loaded")
TOLERANCE = {"r161": 1e-4, "ea70": 4e-3, "barrel-loaded": 4e-3, "knob-loaded": 3e-3}


@pytest.mark.parametrize("name", BATS)
def test_a_bat_has_its_published_properties(name: str) -> None:
    spec = load_bat(name).spec
    published = spec.published
    assert published is not None
    beam, modes = beam_of(spec.body), modes_of(spec.body, Free(), 2)
    near = TOLERANCE[name]
    assert beam.length == pytest.approx(published.length, rel=1e-12)
    assert beam.mass == pytest.approx(published.mass, rel=near)
    assert beam.z_cm == pytest.approx(published.z_cm, rel=near)
    assert beam.inertia_cm == pytest.approx(published.inertia_cm, rel=near)
    assert modes.bending_frequencies == pytest.approx(published.bending_frequencies, rel=near)
    assert barrel_nodes(modes) == pytest.approx(published.barrel_nodes, rel=near)
    assert beam.inertia(33 * INCH) == pytest.approx(published.inertia_knob, rel=near)


def test_the_loaded_bats_have_one_thinner_shell_and_the_same_weight_at_either_end() -> None:
    names = ("barrel-loaded", "knob-loaded", "ea70")
    barrel, knob, base = (load_bat(name).spec.body for name in names)
    assert barrel.profile == knob.profile
    assert barrel.profile.wall is not None
    assert base.profile.wall is not None
    walls = zip(barrel.profile.wall, base.profile.wall, strict=True)
    thinner = [one / whole for one, whole in walls]
    assert thinner == pytest.approx([0.9] * len(thinner), abs=0.02)  # paper: "about 10 %"
    for body, end in ((barrel, 0.0), (knob, 34 * INCH)):
        assert body.lumps[-1].mass == pytest.approx(2.3 * OUNCE)
        assert abs(body.lumps[-1].z - end) < 1.5 * INCH
