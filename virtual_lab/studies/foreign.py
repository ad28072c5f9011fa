"""Test of another laboratory: it needs the same constants as our laboratory."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from virtual_lab.catalog import load, names
from virtual_lab.errors import InputError, nearest
from virtual_lab.lab import Laboratory, TestSetup, certify_bat
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.measurement.model import CONTROL
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.reduction.air import DENSITY, LOGGER
from virtual_lab.records.foreign.laboratory import FORM, load_laboratory, procedure_name
from virtual_lab.records.session import Session
from virtual_lab.simulation.rig import Reality


def our_own(procedure: str) -> Session:
    """Return the session of our laboratory for a test by a procedure.

    For speed it has no noise and rigid bats. `InputError` as `certify_bat`.
    """
    bat, rules = names("bats")[0], load("procedures", procedure, Procedure).spec
    setup = TestSetup.of(
        bat,
        procedure=procedure,
        reality=Reality.NOISE_FREE,
        rung="rigid",
        control_bat=bat if rules.controlled else None,
    )
    return certify_bat(setup).certification.session


def certify_laboratory(folder: Path, asked: Callable[[Session], Session]) -> Certification:
    """Reduce and evaluate a laboratory's form and tables, with the options that `asked` applies.

    Raises
    ------
    InputError
        As `load_laboratory` and `certify_session`; also for missing and for unknown constants,
        compared with our laboratory.
    """
    form = folder / FORM
    if (folder / "session.json").exists():
        raise InputError(str(folder), FORM, None, "stands beside a session.json; keep one of them")
    session, procedure = load_laboratory(folder), procedure_name(folder)
    try:
        needed = _constants_of(procedure)
    except InputError:
        needed = []  # rules for other machines: missing constants are reported below
    if needed:
        read = "climate" in session.records.get("bench", {})
        spared = (DENSITY,) if read else (LOGGER,)  # the density follows from the climate
        _require_constants(list(session.calibration), needed, spared, str(form))
    try:
        return certify_session(asked(session))
    except InputError as fault:
        sources = {"session.json": str(form), "procedure.toml": procedure}
        where = sources.get(fault.where, fault.where)
        raise InputError(where, fault.key, fault.value, fault.allowed) from fault


def _constants_of(procedure: str) -> list[str]:
    """Return the constants of our laboratory for a procedure."""
    laboratory = Laboratory.open(TestSetup.of(names("bats")[0], procedure=procedure))
    control = [CONTROL] if laboratory.rules.spec.controlled else []
    return [*laboratory.calibration, *control]


def _require_constants(
    given: list[str], needed: list[str], spared: tuple[str, ...], where: str
) -> None:
    """Refuse a form with missing or unknown constants. Keys that begin as `spared` are optional.

    A laboratory may have more numbered constants than ours, such as `distance_2` for a third gate.
    """
    missing = [key for key in needed if key not in given and not key.startswith(spared)]
    kinds = {_unnumbered(key) for key in needed}
    unknown = [key for key in given if _unnumbered(key) not in kinds]
    if missing:
        allowed = f"missing: {', '.join(missing)}"
        if unknown:
            allowed += f" (not known: {', '.join(unknown)})"
        raise InputError(where, "calibration", None, allowed)
    if unknown:
        hint = nearest(unknown[0], needed)
        raise InputError(
            where, "calibration", ", ".join(unknown), f"{hint}no constant of this procedure"
        )


def _unnumbered(key: str) -> str:
    return re.sub(r"_\d+$", "", key)
