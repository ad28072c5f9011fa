"""A control bat: what a bat of known e gives with the very lot of balls a test is fired with."""

from __future__ import annotations

from dataclasses import replace

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.lab.fitting import require_places
from virtual_lab.lab.laboratory import Laboratory, Say, Tested
from virtual_lab.measurement.session_reduction import CONTROL
from virtual_lab.records.session import Session
from virtual_lab.simulation.truth import made_bat
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["with_control"]

BRANCH = 1_000_000  # of the seed, beyond any number of tests: hits of the control bat's own
UNCORRECTED = Estimate(value=1.0)


def with_control(
    laboratory: Laboratory, control_bat: str | None, say: Say
) -> tuple[Laboratory, Tested | None]:
    """Return the laboratory that knows what its control bat gave, and the control bat's test.

    The control bat goes through the same procedure at the same rigs with the same lot of balls,
    e as measured; over the e that the rules know of it, this is the constant
    ``control.restitution_ratio`` of the test to come. What the two tests share of calibration
    errors stands in the budget twice, though much of it goes out of the ratio: u is on the large
    side.

    Parameters
    ----------
    laboratory
        Open, and its own test not run yet.
    control_bat
        Name in the catalog or path of a .toml file; None for rules that ask for none.

    Raises
    ------
    InputError
        A control bat where the rules correct by none, or none where they do; an unknown one; one
        whose test gives no result.
    """
    rules = laboratory.rules.spec
    if not rules.controlled:
        if control_bat is None:
            return laboratory, None
        allowed = f"{rules.name} has no [correction] by the method 'control-bat'"
        raise InputError("", "control bat", control_bat, allowed)
    if control_bat is None:
        raise InputError(
            "", "control bat", None, f"is missing: {rules.name} corrects its balls by one"
        )
    assert rules.correction is not None
    bat, standard = catalog.load_bat(control_bat).spec, rules.correction.standard
    require_places(rules, bat)
    own = laboratory.reality.draws(laboratory.seed, BRANCH)
    say(f"control bat {bat.name}, with the same balls")
    tested = replace(
        laboratory,
        draws=own,
        specimen=replace(laboratory.specimen, bat=made_bat(bat, own)),
        session=replace(
            _told(laboratory.session, UNCORRECTED), bat=bat.name, bat_sport=bat.sport or ""
        ),
    ).run(say)
    if tested.certification.reasons:
        reason = "; ".join(tested.certification.reasons)
        raise InputError("", "control bat", control_bat, f"its own test gives no result: {reason}")
    e = tested.certification.quantities["restitution"]
    found = Estimate(
        value=e.value / standard,
        u=e.u / standard,
        dof=e.dof,
        source=f"control bat {bat.name}, e {standard:g}",
    )
    simulation = laboratory.session.simulation
    unverified = simulation["unverified_numbers"] | catalog.unverified("bats", control_bat)
    knowing = replace(
        laboratory,
        session=replace(
            _told(laboratory.session, found),
            simulation={**simulation, "unverified_numbers": unverified},
        ),
        control=tested.sealed.measurand["restitution"] / standard,
    )
    return knowing, tested


def _told(session: Session, ratio: Estimate) -> Session:
    return replace(session, calibration={**session.calibration, CONTROL: ratio})
