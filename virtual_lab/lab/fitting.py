"""Whether a rig fits a procedure, by what the one writes and the other reads."""

from __future__ import annotations

from collections.abc import Iterable

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.procedure import Procedure
from virtual_lab.rig import Rig, Stage, installed_rigs

__all__ = ["require_rig", "unverified_rigs"]


def require_rig(rig: Rig, procedure: Procedure) -> None:
    """Refuse a rig that does not write what the procedure reads."""
    lacking = sorted(procedure.needs - rig.channels.keys())
    if lacking:
        able = [
            name
            for name, other in installed_rigs().items()
            if other.stage is Stage.IMPACT and procedure.needs <= other.channels.keys()
        ]
        allowed = f"{procedure.name} needs its {', '.join(lacking)}; such are {', '.join(able)}"
        raise InputError("", "rig", rig.name, allowed)
    if "swing" in rig.channels and procedure.bat_speed is None:
        raise InputError("", "rig", rig.name, f"it swings the bat; {procedure.name} has it at rest")


def unverified_rigs(rigs: Iterable[str]) -> dict[str, str]:
    """Return the unverified numbers of the rigs; another maker's rig keeps its own sheets."""
    found: dict[str, str] = {}
    for rig in rigs:
        if rig in catalog.names("rigs"):
            found |= catalog.unverified("rigs", rig)
    return found
