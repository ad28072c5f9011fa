"""Take a bat through a procedure: names in, a laboratory or a tested bat out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.lab.control import with_control
from virtual_lab.lab.fitting import unverified_rigs
from virtual_lab.lab.laboratory import BALL_RIG, BENCH_RIG, Laboratory, Say, Tested
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.rig import MotionRung, Reality

__all__ = ["certify_bat", "open_laboratory"]

METHODS = ("ratio", "trampoline")  # of converting a result to a standard ball


def certify_bat(
    bat: str,
    *,
    procedure: str,
    rig: str | None = None,
    seed: int | None = None,
    reality: Reality = Reality.REAL,
    rung: str | None = None,
    motion: str = MotionRung.CLOSED_FORM.value,
    faults: Sequence[str] = (),
    test: int | None = None,
    control_bat: str | None = None,
    correction: str | None = None,
    say: Say = lambda _: None,
) -> Tested:
    """Take a bat through a procedure.

    Parameters
    ----------
    bat, procedure
        Names in the catalog, or paths of .toml files.
    rig
        An installed rig that gives what the procedure needs; None takes the one it names.
    seed
        Of everything random; None draws one, which the sealed truth alone tells.
    reality
        How much of a real day is played.
    rung
        Of the collision: ``rigid``, ``modal`` or ``reference``; None takes the cheapest whose
        error is at most a tenth of the standard uncertainty of e_A that such a test reaches.
    motion
        Of ball and bat: ``closed-form``, or ``pymunk``, a scene a shot.
    faults
        Names of what goes wrong on the day, in the catalog; the sealed truth tells them.
    test
        Which of the laboratory's tests this is: they share rigs and calibrations, and each has
        its own bat, balls, readings and hits. None: its only one.
    control_bat
        Whose e is known, for rules that correct by one: it is tested first, with the same balls.
    correction
        ``METHOD:E0`` by which to convert to a standard ball where the rules do not.
    say
        Told what goes on, a sentence at a time.

    Raises
    ------
    InputError
        As `open_laboratory` and `with_control`.
    """
    laboratory = open_laboratory(
        bat,
        procedure=procedure,
        rig=rig,
        seed=seed,
        reality=reality,
        rung=rung,
        motion=motion,
        faults=faults,
        test=test,
        correction=correction,
    )
    laboratory, control = with_control(laboratory, control_bat, say)
    return replace(laboratory.run(say), control=control)


def open_laboratory(
    bat: str,
    *,
    procedure: str,
    rig: str | None = None,
    seed: int | None = None,
    reality: Reality = Reality.REAL,
    rung: str | None = None,
    motion: str = MotionRung.CLOSED_FORM.value,
    faults: Sequence[str] = (),
    test: int | None = None,
    correction: str | None = None,
) -> Laboratory:
    """Return the laboratory that takes a bat through a procedure; parameters of `certify_bat`.

    Raises
    ------
    InputError
        Unknown names, files that cannot be used, a negative seed, an unknown rung, a motion the
        rig does not have, a rig that lacks what the procedure needs, a fault that cannot befall
        the rig.
    """
    if seed is not None and seed < 0:
        raise InputError("", "seed", seed, "allowed: whole numbers from 0")
    rules = catalog.load("procedures", procedure, Procedure)
    if correction is not None:
        rules = _with_correction(rules, correction)
    return Laboratory.open(
        bat=catalog.load_bat(bat).spec,
        ball=catalog.load("balls", rules.spec.ball, BallSpec).spec,
        rules=rules,
        seed=seed,
        rig=rig or rules.spec.rig,
        reality=reality,
        rung=rung,
        motion=MotionRung.named(motion),
        day=FaultSet.of(faults, rig=rig or rules.spec.rig),
        test=test,
        unverified=catalog.unverified("bats", bat)
        | catalog.unverified("balls", rules.spec.ball)
        | unverified_rigs((BENCH_RIG, BALL_RIG, rig or rules.spec.rig)),
    )


def _with_correction(rules: Entry[Procedure], asked: str) -> Entry[Procedure]:
    """Return the rules with a conversion ``METHOD:E0``; `InputError` where they have one."""
    if rules.spec.correction is not None:
        allowed = f"{rules.spec.name} has a [correction]: {rules.spec.correction.method}"
        raise InputError("", "correction", asked, allowed)
    method, _, standard = asked.partition(":")
    try:
        value = float(standard)
    except ValueError:
        value = 0.0
    if method not in METHODS or not 0 < value < 1:
        allowed = f"allowed: {' or '.join(METHODS)}, a colon and an e0 below 1: trampoline:0.5"
        raise InputError("", "correction", asked, allowed)
    number = f'{{ value = {value!r}, unit = "1", source = "assumed", verified = false }}'
    table = f'[correction]  # asked for by the operator\nmethod = "{method}"\nstandard = {number}\n'
    return catalog.read(f"{rules.text}\n{table}", f"procedures/{rules.spec.name}", Procedure)
