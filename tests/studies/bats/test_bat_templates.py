"""Bats fitted to measurements: Table I of the paper, round trips, and impossible data."""

from typing import Any

import numpy as np
import pytest

from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.beam import Free, beam_of
from virtual_lab.simulation.physics.modes import barrel_nodes, modes_of
from virtual_lab.simulation.physics.shell import shell_mode
from virtual_lab.studies.bats.bat_templates import (
    MEASURED,
    TEMPLATES,
    BatMeasurements,
    compute_quantities,
    fit,
    require_plausible_hoop,
)
from virtual_lab.units import INCH, OUNCE, OZ_IN2

# z_cm, I_cm, f1, f2 and nodes of bats of 34 in and 31 oz
TABLE_ONE = {
    "r161": ("wood", 11.3, 2539, (164, 551), (6.8, 5.2)),
    "knob-loaded": ("hollow", 14.6, 3418, (191, 691), (7.8, 5.6)),
}


def measured(template: str = "wood", **other: Any) -> BatMeasurements:
    given: dict[str, Any] = {
        "name": "mine",
        "title": "Mine",
        "template": template,
        "length": 34 * INCH,
        "mass": 31 * OUNCE,
        "z_cm": 11.3 * INCH,
        "inertia": 2539 * OZ_IN2,
        "inertia_axis": 11.3 * INCH,
    }
    return BatMeasurements(**given | other)


@pytest.mark.parametrize("bat", ["r161", pytest.param("knob-loaded", marks=pytest.mark.long)])
def test_everything_of_table_one_is_met(bat: str) -> None:
    """The fit uses a coarse mesh, the test the full one."""
    template, z_cm, inertia, frequencies, nodes = TABLE_ONE[bat]
    body = fit(
        measured(
            template,
            z_cm=z_cm * INCH,
            inertia=inertia * OZ_IN2,
            inertia_axis=z_cm * INCH,
            bending_frequencies=frequencies,
            barrel_nodes=tuple(node * INCH for node in nodes),
        )
    ).body
    beam, modes = beam_of(body), modes_of(body, Free(), 2)
    found = (beam.length, beam.mass, beam.z_cm, beam.inertia_cm, *modes.bending_frequencies)
    goals = (34 * INCH, 31 * OUNCE, z_cm * INCH, inertia * OZ_IN2, *frequencies)
    assert found == pytest.approx(goals, rel=1e-4)
    assert barrel_nodes(modes) == pytest.approx([n * INCH for n in nodes], abs=1e-3 * INCH)


@pytest.mark.parametrize("template", TEMPLATES)
def test_a_bat_of_the_template_is_met_from_elsewhere(template: str) -> None:
    """Round trip: every parameter changed by half its spread, measured and fitted."""
    usual, spread = TEMPLATES[template].usual, TEMPLATES[template].spread
    signs = np.where(np.arange(usual.size) % 2, 0.5, -0.5)
    true = compute_quantities(
        TEMPLATES[template].build(usual + signs * spread, 0.84), 0.7, frequencies=0, nodes=0
    )
    found = fit(measured(template, length=0.84, inertia_axis=0.7, **true))
    assert set(found.misfits) == {"mass", "z_cm", "inertia"}
    assert max(map(abs, found.misfits.values())) < 1e-5


def test_the_usual_bat_is_its_own_fit() -> None:
    usual = TEMPLATES["wood"].usual
    true = compute_quantities(TEMPLATES["wood"].build(usual, 0.86), 0.0, frequencies=0, nodes=0)
    found = fit(measured(length=0.86, inertia_axis=0.0, **true))
    assert found.parameters == pytest.approx(usual, rel=1e-6)


def test_the_template_decides_where_the_data_leave_it_open() -> None:
    template = TEMPLATES["wood"]
    softer = template.usual - template.spread * (np.arange(template.usual.size) == 8)
    assert template.parameters[8].name == "Young's modulus"
    plain, soft = fit(measured()), fit(measured(), softer)
    assert soft.parameters[8] == pytest.approx(softer[8], rel=1e-6)
    assert soft.misfits["mass"] == pytest.approx(0, abs=1e-5)
    assert plain.parameters[8] == pytest.approx(template.usual[8], rel=1e-6)


def hollow(**other: Any) -> BatMeasurements:
    """Return measurements of EA70 in Table I."""
    given = {"z_cm": 13.1 * INCH, "inertia": 2757 * OZ_IN2, "inertia_axis": 13.1 * INCH}
    return measured("hollow", **given | other)


@pytest.mark.parametrize("seed", [2, 12])
def test_a_bat_is_found_from_a_far_target(seed: int) -> None:
    """Each of the two methods alone finds no bat from one of these targets."""
    usual, spread = TEMPLATES["hollow"].usual, TEMPLATES["hollow"].spread
    target = usual + 1.5 * spread * np.random.default_rng(seed).normal(size=usual.size)
    fitted = fit(hollow(bending_frequencies=(219.0, 705.0)), target)
    assert max(map(abs, fitted.misfits.values())) < 1e-3


def test_a_bat_is_found_from_the_limits_of_the_template() -> None:
    """The knob is at the end of the bat, and no step of the search puts it beyond."""
    target = np.array([parameter.high for parameter in TEMPLATES["hollow"].parameters])
    fitted = fit(hollow(), target)
    assert max(map(abs, fitted.misfits.values())) < 1e-3


def test_a_measured_hoop_mode_is_met() -> None:
    fitted = fit(hollow(hoop_frequency=2100.0, hoop_modal_mass=0.14))
    assert fitted.body.hoop is not None
    assert fitted.body.hoop.frequency == pytest.approx(2100, rel=1e-5)
    assert fitted.body.hoop.modal_mass == pytest.approx(0.14, rel=1e-5)
    assert max(map(abs, fitted.misfits.values())) < 1e-5


def test_an_uncertain_value_weighs_as_much_as_the_template() -> None:
    """The template has 1.1 ± .15 times the frequency of the shell, here 2194 Hz.

    Where the sum of the two squares is smallest, their derivatives by this ratio cancel.
    """
    value, u = 1800.0, 300.0
    body = fit(hollow(hoop_frequency=value, hoop_frequency_u=u)).body
    assert body.hoop is not None
    shell = shell_mode(body).frequency
    assert body.hoop.frequency < 2100
    by_data = (body.hoop.frequency - value) / u**2 * shell
    assert by_data == pytest.approx((1.1 - body.hoop.frequency / shell) / 0.15**2, rel=0.01)


@pytest.mark.parametrize("mass", [0.06, 0.32])
def test_a_modal_mass_far_from_the_shells_is_refused(mass: float) -> None:
    """The allowed range is half to twice that of the shell of this outline, .151 kg."""
    with pytest.raises(InputError, match="hoop_modal_mass") as refused:
        require_plausible_hoop(hollow(hoop_modal_mass=mass))
    words = str(refused.value).split("allowed: ")[1].split()
    assert [float(words[0]), float(words[2])] == pytest.approx([0.0753, 0.3013], abs=5e-4)


def test_data_vary_by_their_uncertainties() -> None:
    data = measured(
        mass_u=0.002,
        length_u=0.001,
        bending_frequencies=(164.0, 551.0),
        bending_frequencies_u=(2.0, 5.0),
        barrel_nodes=(0.17,),
    )
    draws = np.zeros((len(MEASURED), 2))
    draws[MEASURED.index("mass")] = 3.0
    draws[MEASURED.index("bending_frequencies")] = -1.0, 2.0
    draws[MEASURED.index("barrel_nodes")] = 5.0
    varied = data.vary(draws)
    assert varied.mass == pytest.approx(data.mass + 0.006)
    assert varied.bending_frequencies == pytest.approx((162, 561))
    assert (varied.length, varied.barrel_nodes) == (data.length, (0.17,))
    draws[MEASURED.index("length")] = 1.0
    assert data.vary(draws).length == pytest.approx(data.length + 0.001)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"mass": 70 * OUNCE, "inertia": 5700 * OZ_IN2}, "mass"),
        ({"z_cm": 19 * INCH, "inertia_axis": 19 * INCH}, "z_cm"),
        ({"bending_frequencies": (400.0,)}, "f1"),
    ],
)
def test_data_that_no_bat_of_the_template_can_have_are_refused(
    other: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError, match="no bat of this template fits the data") as caught:
        fit(measured(**other))
    assert said in str(caught.value).split("best one")[1]


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"z_cm": 35 * INCH}, "outside a bat"),
        ({"inertia_axis": 33 * INCH}, "less than mass times"),
        ({"bending_frequencies": (551.0, 164.0)}, "increase"),
        ({"bending_frequencies": (-1.0,)}, "above 0"),
        ({"barrel_nodes": (-0.1,)}, "on the bat"),
        ({"barrel_nodes": (0.17, 0.13), "barrel_nodes_u": (0.01,)}, "has 1 values where"),
        ({"hoop_frequency": 2100.0}, "belongs to a hollow bat"),
        ({"hoop_frequency_u": 20.0}, "hoop_frequency_u requires hoop_frequency"),
    ],
)
def test_contradictory_measurements_are_refused(other: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        measured(**other)
