"""Thresholds of the reduction and its checks, just within and just beyond each."""

from collections.abc import Iterable
from dataclasses import replace
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest

from tests.laboratories import certified
from virtual_lab.errors import InputError
from virtual_lab.measurement.diagnostics.bench import bat_shape, lot_rules
from virtual_lab.measurement.diagnostics.flag import Flag, Raised
from virtual_lab.measurement.diagnostics.impact import edges
from virtual_lab.measurement.reduction.shot_algebra import BatProperties, MeasuredBalls
from virtual_lab.measurement.session_reduction import prepare
from virtual_lab.records.block import SessionBlock
from virtual_lab.simulation.stations.rig import Reality

LENGTH, RADIUS = 0.86, 0.0325  # length and radius of the bat [m]


def shape(
    *, density: float = 311.0, balance: float = 0.33, gyration: float = 0.27
) -> SimpleNamespace:
    """Return a bat of a given density [kg/m³]; balance and gyration are shares of its length."""
    mass = density * pi * RADIUS**2 * LENGTH
    bat = BatProperties(
        mass=np.full((1, 1, 1), mass),
        length=np.full((1, 1, 1), LENGTH),
        barrel_radius=np.full((1, 1, 1), RADIUS),
        z_cm=np.full((1, 1, 1), balance * LENGTH),
        inertia_cm=np.full((1, 1, 1), mass * (gyration * LENGTH) ** 2),
    )
    return SimpleNamespace(reduced=SimpleNamespace(preparation=SimpleNamespace(bat=bat)))


def flags_of(answers: Iterable[Raised]) -> list[Flag]:
    """Return the flags raised in the first laboratory."""
    return [flag for each in answers if (flag := each.row(0))]


@pytest.mark.parametrize(
    ("within", "beyond"),
    [
        ({"balance": 0.251}, {"balance": 0.249}),
        ({"balance": 0.549}, {"balance": 0.551}),
        ({"gyration": 0.201}, {"gyration": 0.199}),
        ({"gyration": 0.359}, {"gyration": 0.361}),
        (
            {"density": 0.401 / (pi * RADIUS**2 * LENGTH)},
            {"density": 0.399 / (pi * RADIUS**2 * LENGTH)},
        ),
        ({"density": 6999.0}, {"density": 7015.0}),  # density of a bat of 20 kg
    ],
)
def test_an_unlikely_shape_of_a_bat_is_a_remark(
    within: dict[str, float], beyond: dict[str, float]
) -> None:
    assert flags_of(bat_shape(shape(**within))) == []
    (flag,) = flags_of(bat_shape(shape(**beyond)))
    assert not flag.invalidates


@pytest.mark.parametrize(("density", "impossible"), [(101, 0), (99, 1), (11_900, 0), (12_100, 1)])
def test_a_density_of_no_material_makes_a_test_invalid(density: float, impossible: int) -> None:
    flags = [flag for flag in flags_of(bat_shape(shape(density=density))) if flag.invalidates]
    assert len(flags) == impossible


@pytest.mark.parametrize(("off", "refused"), [(4.9e-3, False), (5.1e-3, True), (-5.1e-3, True)])
def test_an_axis_of_another_rig_is_refused(off: float, refused: bool) -> None:
    """The rules require 6 in; the axis of a rig deviates by tenths of a millimeter."""
    session = certified(seed=7, reality=Reality.IDEAL).certification.session
    calibration = dict(session.calibration)
    key = "impact.pivot.from_knob"
    calibration[key] = replace(calibration[key], value=6 * 0.0254 + off)
    block = SessionBlock.of(replace(session, calibration=calibration))
    if refused:
        with pytest.raises(InputError, match="pivot_from_knob"):
            prepare(block)
    else:
        assert prepare(block).procedure.spec.pivot_from_knob == pytest.approx(0.1524)


@pytest.mark.parametrize(("bad", "flagged"), [(1, False), (2, True)])
def test_more_than_a_tenth_of_the_shots_off_their_flight_is_flagged(
    bad: int, flagged: bool
) -> None:
    """One of ten shots, and two of ten."""
    laboratory = SimpleNamespace(
        off_flight=np.arange(10) < bad,
        owner=np.zeros(10, dtype=int),
        per_laboratory=lambda values: np.array([values.sum()]),
    )
    assert bool(flags_of(edges(laboratory))) == flagged


@pytest.mark.parametrize(
    ("e0", "fired", "said"),
    [
        (0.5595, False, ""),
        (0.5605, False, "worn or of another type"),
        (0.5205, False, ""),
        (0.5195, False, "worn or of another type"),
        (0.5595, True, "was fired"),
        (0.5545, True, ""),
    ],
)
def test_a_ball_far_outside_the_windows_or_fired_in_spite_of_them_is_flagged(
    e0: float, fired: bool, said: str
) -> None:
    """The window is .525 to .555 at 60 mph; no sound ball is more than 5e-3 outside."""
    procedure = certified(seed=7, reality=Reality.IDEAL).certification.procedure
    at = procedure.windows.ball_restitution_speed
    balls = MeasuredBalls(
        mass=np.full((1, 1, 3), 0.145),
        restitution=np.array([[[0.54, e0, 0.54]]]),
        slope=np.zeros((1, 1, 1)),
        speed=np.full((1, 1, 1), at),
    )
    laboratory = SimpleNamespace(
        procedure=procedure,
        measured_balls=balls,
        readings=SimpleNamespace(ball=np.array([0, 1 if fired else 2])),
        owner=np.zeros(2, dtype=int),
    )
    flags = flags_of(lot_rules(laboratory))
    assert len(flags) == bool(said)
    assert all(said in flag.sentence for flag in flags)
