"""Test of a bat by the procedure, after the test of a control bat if one is required."""

from __future__ import annotations

from dataclasses import replace

from virtual_lab.errors import InputError
from virtual_lab.lab.bat_test import BatTest, BlockTest
from virtual_lab.lab.fitting import require_positions
from virtual_lab.lab.laboratory import Laboratory, collision_of
from virtual_lab.lab.recipe import Recipe
from virtual_lab.lab.setup import TestSetup
from virtual_lab.lab.test_day import run_test
from virtual_lab.measurement.procedure import Verdict
from virtual_lab.measurement.procedure.model import CONTROL
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.collision.modal import kernel_is_compiled
from virtual_lab.simulation.physics.truth import make_bat
from virtual_lab.uncertainty.estimate import Estimate, Estimates

CONTROL_TEST = 1_000_000  # branch of the control test's random numbers, above any test number


def certify_bat(setup: TestSetup, progress: Progress = quiet) -> BatTest:
    """Return the test of a bat in one laboratory, with its certification and the sealed truth.

    Raises `InputError` in the same cases as `certify_block`.
    """
    return certify_block(setup, progress).of(0)


def certify_block(setup: TestSetup, progress: Progress = quiet) -> BlockTest:
    """Return the tests of one bat design in a block of laboratories, one test per laboratory.

    `progress` is called with a sentence before each stage. If the procedure uses a control bat,
    this bat is tested first, on the same rigs and with the same balls. The ratio of its measured e
    to its known e becomes the constant ``control.restitution_ratio`` of the main test. Calibration
    errors common to both tests largely cancel in this ratio. The budget nevertheless includes them
    in both tests, so u is slightly too large.

    Raises
    ------
    InputError
        `Laboratory.open` rejects the setup; a control bat is stated, but the procedure uses none;
        the procedure needs a control bat, but none is stated; or the test of the control bat gives
        no result.
    """
    if not kernel_is_compiled():
        progress("compiling the numerical code, which happens once and takes some fifteen seconds")
    laboratory = Laboratory.open(setup)
    rules, control_bat = setup.rules.spec, setup.control_bat
    if not rules.controlled:
        if control_bat is not None:
            allowed = f"{rules.name} does not correct by a control bat; leave it out"
            raise InputError("", "control bat", control_bat.spec.name, allowed)
        return run_test(laboratory, progress)
    if control_bat is None:
        allowed = f"is missing: {rules.name} corrects its balls by one"
        raise InputError("", "control bat", None, allowed)
    assert rules.correction is not None
    bat, standard = control_bat.spec, rules.correction.standard
    require_positions(rules, bat)
    tests = () if setup.test is None else (setup.test,)
    draws = setup.draws(laboratory.seed, *tests, CONTROL_TEST)
    progress(f"control bat {bat.name}, with the same balls")
    collision = collision_of(bat, setup.ball.spec, rules, setup.collision_model)
    control = run_test(
        replace(
            laboratory,
            setup=replace(
                setup, bat=control_bat, film=False, history={}, uncertainty="first-order"
            ),
            draws=draws,
            collision=collision,
            specimen=replace(laboratory.specimen, bat=make_bat(bat, draws), collision=collision),
            calibration=_with_ratio(laboratory, Estimate(value=1.0)),
        ),
        progress,
    ).of(0)
    if control.certification.verdict is Verdict.INVALID:
        reason = "; ".join(control.certification.reasons)
        raise InputError("", "control bat", bat.name, f"its own test gives no result: {reason}")
    e = control.certification.quantities["restitution"]
    ratio = Estimate(
        value=e.value / standard,
        u=e.u / standard,
        dof=e.dof,
        source=f"control bat {bat.name}, e {standard:g}",
    )
    corrected = replace(
        laboratory,
        calibration=_with_ratio(laboratory, ratio),
        control_ratio=control.sealed.measurand["restitution"] / standard,
        most_boxes=1,
    )
    recipe = replace(Recipe.of(laboratory, 0), is_control=True).as_json()
    control = replace(control, sealed=replace(control.sealed, recipe=recipe))
    return replace(run_test(corrected, progress), control=control)


def _with_ratio(laboratory: Laboratory, ratio: Estimate) -> dict[str, Estimates]:
    return {**laboratory.calibration, CONTROL: Estimates.stack([ratio])}
