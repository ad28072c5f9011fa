"""Reduction of the records of another laboratory, which must state the same constants as ours."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from virtual_lab.catalog import load, names
from virtual_lab.errors import InputError, nearest
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.model import CONTROL
from virtual_lab.measurement.reduction.air import DENSITY, LOGGER
from virtual_lab.measurement.reduction.gates import THICKNESS
from virtual_lab.records import BoardRecord, GateRecord, Record
from virtual_lab.records.foreign.laboratory import FORM, load_laboratory, procedure_name
from virtual_lab.records.origin import Simulated
from virtual_lab.records.session import SESSION, Session, load_session

RECORDS = "records"  # folder of the records in a result folder
LOGGER_TABLES = ("climate", "store")  # channels of the bench that need the logger's constants


def our_session(procedure: str) -> Session:
    """Return the session of a simulated test by a procedure.

    The session is the pattern for the empty record forms that `template` writes. To save time the
    test has no noise, and the bat is rigid. Raises `InputError` for an unknown procedure.
    """
    from virtual_lab.lab import TestSetup, certify_bat
    from virtual_lab.simulation.stations.rig import Reality

    bat, rules = names("bats")[0], load("procedures", procedure, Procedure).spec
    setup = TestSetup.of(
        bat,
        procedure=procedure,
        reality=Reality.NOISE_FREE,
        collision_model="rigid",
        control_bat=bat if rules.controlled else None,
    )
    return certify_bat(setup).certification.session


def certify_folder(folder: Path, apply_options: Callable[[Session], Session]) -> Certification:
    """Return the certification of a folder of raw records.

    The folder holds either a session of this program, or a record form that another laboratory
    filled in.

    Parameters
    ----------
    folder
        Folder with ``session.json``, or with ``laboratory.toml`` and the tables that it names.
    apply_options
        Function that receives the session and returns it with the options of the user.

    Raises
    ------
    InputError
        The folder has no records, the records are in a subfolder, or they cannot be reduced.
    """
    if (folder / FORM).exists():
        return certify_laboratory(folder, apply_options)
    inner = [path.parent for path in sorted(folder.glob(f"*/{SESSION}"))]
    if inner and not (folder / SESSION).exists():
        raise InputError(
            "", "records", str(folder), f"the records are in {inner[0]}; name this folder"
        )
    if not inner and not (folder / SESSION).exists():
        allowed = f"holds no {SESSION} and no {FORM}; template writes empty forms of all records"
        raise InputError("", "records", str(folder), allowed)
    return certify_session(apply_options(load_session(folder)))


def certify_laboratory(folder: Path, apply_options: Callable[[Session], Session]) -> Certification:
    """Return the certification of one test from the form and the tables of a laboratory.

    Parameters
    ----------
    folder
        Folder with ``laboratory.toml`` and the tables that it names.
    apply_options
        Function that receives the session and returns it with the options of the user.

    Raises
    ------
    InputError
        The form or a table is not valid, a constant is missing or unknown, the folder also contains
        a ``session.json``, or the session cannot be reduced.
    """
    form = folder / FORM
    if (folder / "session.json").exists():
        raise InputError(str(folder), FORM, None, "is beside a session.json; keep only one of them")
    session, procedure = load_laboratory(folder), procedure_name(folder)
    try:
        needed = _constants_of(procedure)
    except InputError:
        needed = []  # the rules are for other machines, so the reduction reports missing constants
    if needed:
        channels = session.records.get("bench", {}).keys()
        optional = offered = optional_constants(session.records)
        if "climate" in channels:  # the density follows from it
            optional = [*optional, DENSITY]
        if channels.isdisjoint(LOGGER_TABLES):
            optional = [*optional, LOGGER]
        known = [*needed, *offered]
        _require_constants(list(session.calibration), known, tuple(optional), str(form))
    try:
        return certify_session(apply_options(session))
    except InputError as fault:
        sources = {"session.json": str(form), "procedure.toml": procedure}
        where = sources.get(fault.where, fault.where)
        raise InputError(where, fault.key, fault.value, fault.allowed) from fault


def optional_constants(records: Mapping[str, Mapping[str, Record]]) -> list[str]:
    """Return the names of the constants that a laboratory may state: thickness of its beams.

    `records` are keyed by stage and channel.
    """
    return [
        stage + THICKNESS
        for stage, channels in records.items()
        if isinstance(channels.get("gates"), GateRecord | BoardRecord)
    ]


def _constants_of(procedure: str) -> list[str]:
    """Return the names of the calibration constants that a procedure needs."""
    from virtual_lab.lab import Laboratory, TestSetup

    laboratory = Laboratory.open(TestSetup.of(names("bats")[0], procedure=procedure))
    control = [CONTROL] if laboratory.rules.spec.controlled else []
    return [*laboratory.calibration, *control]


def _require_constants(
    keys: list[str], known: list[str], optional: tuple[str, ...], where: str
) -> None:
    """Raise `InputError` if constants are missing or unknown.

    A constant may be missing if its name begins with one of `optional`. Further numbered constants
    are allowed, such as `distance_2` for a third gate.
    """
    missing = [key for key in known if key not in keys and not key.startswith(optional)]
    kinds = {_without_number(key) for key in known}
    unknown = [key for key in keys if _without_number(key) not in kinds]
    if missing:
        allowed = f"missing: {', '.join(missing)}"
        if unknown:
            allowed += f" (unknown: {', '.join(unknown)})"
        raise InputError(where, "calibration", None, allowed)
    if unknown:
        hint = nearest(unknown[0], known)
        raise InputError(
            where, "calibration", ", ".join(unknown), f"{hint}no constant of this procedure"
        )


def _without_number(key: str) -> str:
    return re.sub(r"_\d+$", "", key)


def certify_records(folder: Path) -> Certification:
    """Certify the records in a folder again, and return the certification.

    `folder` is a result folder or a folder of records. Raises `InputError` if it has no records, or
    if they cannot be reduced.
    """
    inner = folder / RECORDS
    return certify_folder(inner if (inner / SESSION).exists() else folder, lambda each: each)


def with_installed_rigs(session: Session, impact: str) -> Session:
    """Return the session of another laboratory with the rigs that stand for its own.

    A laboratory describes its rigs in words of its own. The usual rig of the stage stands for a rig
    that is not installed here, or not named. `impact` is the name of the procedure's rig for the
    bat.
    """
    from virtual_lab.lab.setup import rigs_of
    from virtual_lab.simulation.stations.rig import installed_rigs

    if isinstance(session.origin, Simulated):
        return session
    usual = {stage.value: name for stage, name in rigs_of(impact).items()}
    ours = {stage: name for stage, name in session.rigs.items() if name in installed_rigs()}
    return replace(session, rigs={**session.rigs, **usual, **ours})


def replaced_rigs(theirs: Session, ours: Session) -> list[str]:
    """Return a sentence for each rig of the records that another rig stands for."""
    return [
        f"The records describe the rig of the stage {stage} as '{name}'; {ours.rigs[stage]} stands "
        "for it."
        for stage, name in theirs.rigs.items()
        if name != ours.rigs[stage]
    ]
