"""Another laboratory's test: what our own laboratory for its procedure knows, it must know too."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from virtual_lab.catalog import nearest, read
from virtual_lab.certification import Certification, certify_session
from virtual_lab.errors import InputError
from virtual_lab.estimate import Estimate
from virtual_lab.foreign.laboratory import FORM, load_laboratory, procedure_name
from virtual_lab.lab import commission
from virtual_lab.procedure import Procedure
from virtual_lab.rig import installed_rigs

__all__ = ["certify_laboratory"]


def certify_laboratory(folder: Path) -> Certification:
    """Reduce and evaluate what a laboratory's form and tables hold.

    Raises
    ------
    InputError
        As `load_laboratory` and `certify_session`; and for constants that our own laboratory
        has and this one lacks, all of them, or that none has.
    """
    form = folder / FORM
    if (folder / "session.json").exists():
        raise InputError(str(folder), FORM, None, "stands beside a session.json; keep one of them")
    session = load_laboratory(folder)
    name = procedure_name(folder)
    procedure = read(session.procedure_text, Path(name).name, Procedure).spec
    if procedure.rig in installed_rigs():
        _require_constants(session.calibration, commission(name).calibration, str(form))
    try:
        return certify_session(session)
    except InputError as fault:
        sources = {"session.json": str(form), "procedure.toml": name}
        where = sources.get(fault.where, fault.where)
        raise InputError(where, fault.key, fault.value, fault.allowed) from fault


def _require_constants(given: Mapping[str, Estimate], needed: Iterable[str], where: str) -> None:
    """Refuse a form that lacks constants, or holds some that mean nothing here.

    A laboratory may have more of a numbered kind than ours: a third gate, `distance_2`.
    """
    missing = [key for key in needed if key not in given]
    kinds = {_unnumbered(key) for key in needed}
    unknown = [key for key in given if _unnumbered(key) not in kinds]
    if missing:
        allowed = f"missing: {', '.join(missing)}"
        if unknown:
            allowed += f" (not known: {', '.join(unknown)})"
        raise InputError(where, "calibration", None, allowed)
    if unknown:
        hint = nearest(unknown[0], list(needed))
        raise InputError(where, "calibration", ", ".join(unknown), f"{hint}not a constant here")


def _unnumbered(key: str) -> str:
    return re.sub(r"_\d+$", "", key)
