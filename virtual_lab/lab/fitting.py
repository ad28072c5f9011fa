"""Checks that rig, bat and ball fit a procedure: channels, motion, impact positions, windows."""

from __future__ import annotations

from collections.abc import Iterable

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure, percussion_position
from virtual_lab.records import BallRecord
from virtual_lab.records.particulars import InstrumentIdentity
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.stations.rig import MotionModel, MotionRig, Rig, Stage, installed_rigs
from virtual_lab.units import INCH, OUNCE


def nominal_positions(procedure: Procedure, bat: BatSpec) -> tuple[float, float]:
    """Return the lowest and the highest impact position that a procedure plans for a bat [m].

    Positions are distances from the barrel tip. If the procedure has no scan, both are the center
    of percussion of the nominal bat.
    """
    if procedure.scan:
        return procedure.scan.low, procedure.scan.high
    beam = beam_of(bat.body)
    properties = {"length": beam.length, "mass": beam.mass, "z_cm": beam.z_cm}
    centre = percussion_position(
        properties | {"inertia_cm": beam.inertia_cm}, procedure.pivot_from_knob
    )
    return centre, centre


def require_rig(rig: Rig, procedure: Procedure) -> None:
    """Raise `InputError` if a rig does not suit a procedure.

    This is so if the rig lacks a record that the procedure needs, or if the rig swings the bat but
    the procedure tests a bat at rest.
    """
    if lacking := _missing_channels(rig, procedure):
        able = [
            name
            for name, candidate in installed_rigs().items()
            if candidate.stage is Stage.IMPACT and not _missing_channels(candidate, procedure)
        ]
        allowed = (
            f"records no {', '.join(lacking)}, which {procedure.name} needs; "
            f"allowed: {', '.join(able)}"
        )
        raise InputError("", "rig", rig.name, allowed)
    if "swing" in rig.channels and procedure.bat_speed is None:
        raise InputError("", "rig", rig.name, f"swings the bat; {procedure.name} needs it at rest")


def _missing_channels(rig: Rig, procedure: Procedure) -> list[str]:
    """Return the channels that a procedure needs but a rig does not write."""
    timed = any(issubclass(kind, BallRecord) for kind in rig.channels.values())
    return sorted(procedure.needs - rig.channels.keys() | (set() if timed else {"gates"}))


def require_motion(rig: Rig, motion: MotionModel) -> None:
    """Raise `InputError` if a rig does not have a motion model.

    Every rig has the closed form.
    """
    if motion is MotionModel.CLOSED_FORM:  # every rig has it
        return
    able = rig.motions if isinstance(rig, MotionRig) else {MotionModel.CLOSED_FORM}
    if motion not in able:
        names = ", ".join(sorted(each.value for each in able))
        raise InputError("", "motion", motion.value, f"allowed at {rig.name}: {names}")


def require_camera(rig: Rig) -> None:
    """Raise `InputError` if a rig has no camera to film a shot."""
    if "camera" not in rig.channels:
        able = [
            name for name, candidate in installed_rigs().items() if "camera" in candidate.channels
        ]
        allowed = f"has no camera to film a shot; allowed with a film: {', '.join(able)}"
        raise InputError("", "rig", rig.name, allowed)


def require_positions(procedure: Procedure, bat: BatSpec) -> None:
    """Raise `InputError` unless a scan stays between the barrel tip and the pivot of a bat.

    A procedure without a scan is always accepted.
    """
    if procedure.scan is None:
        return
    axis = bat.body.length - procedure.pivot_from_knob
    for name in ("low", "high"):
        place = getattr(procedure.scan, name)
        if not 0 < place < axis:
            raise InputError(
                f"procedures/{procedure.name}",
                f"scan.{name}",
                f"{place / INCH:.4g} in",
                f"{bat.name} has its axis {axis / INCH:.4g} in from the tip; allowed: between them",
            )


def require_ball(procedure: Procedure, ball: BallSpec) -> None:
    """Raise `InputError` if a procedure would reject most balls of a sheet for their mass or e0.

    This is so if the mean of the sheet is outside the limits by more than one standard deviation
    between balls. A mean closer to a limit is accepted, because a sound laboratory can measure it.
    """
    windows = procedure.windows
    e0 = ball.restitution.at(windows.ball_restitution_speed)
    for name, value, spread, unit, unit_si in (
        ("ball_mass", ball.mass, ball.spread.mass, " oz", OUNCE),
        ("ball_restitution", e0, ball.spread.restitution, "", 1.0),
    ):
        low, high = (getattr(windows, f"{name}_{end}") / unit_si for end in ("low", "high"))
        margin = spread / unit_si
        if not low - margin <= value / unit_si <= high + margin:
            raise InputError(
                f"procedures/{procedure.name}",
                f"windows.{name}",
                f"{low:.4g} to {high:.4g}{unit}",
                f"the mean {ball.name} has {value / unit_si:.4g}{unit}, so it rejects most",
            )


def unverified_rigs(rigs: Iterable[str]) -> dict[str, str]:
    """Return the number of unverified values in the data sheets of rigs and of their instruments.

    The result has the form ``{"rigs/astm-pivot": "4 of 5", …}``. Here 4 of the 5 values on the data
    sheet are unverified. Data sheets without unverified values are left out. Rigs that are
    installed from other packages are also left out.
    """
    counts: dict[str, str] = {}
    for rig in rigs:
        if catalog.has("rigs", rig):
            counts |= catalog.count_unverified("rigs", rig)
    return counts


def identities(rigs: Iterable[str]) -> dict[str, InstrumentIdentity]:
    """Return the identities of the instruments of `rigs`, keyed by instrument name.

    An identity is, for example, a serial number. It is read from the data sheet of the instrument.
    Two kinds of instruments are left out:

    * instruments whose data sheet has no identity;
    * instruments of a rig that is not in the catalog, because another package supplies it.

    Raises `InputError` for an identity with a wrong entry.
    """
    stated = {}
    for rig in rigs:
        for name in catalog.rig_instruments(rig).values():
            where = f"instruments/{name}"
            if identity := catalog.sheet("instruments", name)[0].get("identity"):
                stated[name] = validate(identity, f"{where} [identity]", InstrumentIdentity)
    return stated
