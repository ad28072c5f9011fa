"""The certificate as a document: what `certificate.json` holds and the page is made from."""

from __future__ import annotations

from dataclasses import asdict
from importlib.metadata import version
from math import isfinite
from typing import Any

import numpy as np

from virtual_lab.certificate.camera import witness_document
from virtual_lab.certificate.tables import budget_rows, place_rows
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.model import CONTROL, QUANTITIES
from virtual_lab.measurement.procedure import CHOICE, Procedure
from virtual_lab.measurement.procedure.peak_width import Width
from virtual_lab.measurement.swing_range import SwingResult
from virtual_lab.output.metrics import METRICS
from virtual_lab.uncertainty.budget import Budget
from virtual_lab.units import INCH, MPH

__all__ = ["SCHEMA", "certificate"]

SCHEMA = 1
DECISION_RULE = (
    "PASS where the value is at most the limit (simple acceptance); "
    "marginal where the limit lies within the 95 % interval"
)
LAW_SPREAD = 0.045  # of r161's peak e over the laws of the ball: virtual-lab sensitivity r161
SIMULATED = "SIMULATED: no real bat was tested and no accredited laboratory issued this."


def certificate(certification: Certification, *, truth_digest: str | None = None) -> dict[str, Any]:
    """Return the certificate, ready for JSON: numbers as measured, unrounded, NaN as null.

    `truth_digest` binds it to the sealed truth of a simulated test.
    """
    session, procedure = certification.session, certification.procedure
    valid = certification.judgement.valid
    metric = certification.metric
    shots, recoil = certification.shots, certification.readings.recoil
    used = certification.outcome.used
    document = {
        "schema": SCHEMA,
        "statement": SIMULATED if session.simulation else "",
        "procedure": {
            "name": procedure.name,
            "title": procedure.title,
            "edition": procedure.edition,
        },
        "bat": {
            "name": session.bat,
            "mass_kg": _estimate(certification.bat["mass"]),
            "length_m": _estimate(certification.bat["length"]),
            "z_cm_m": _estimate(certification.bat["z_cm"]),
            "inertia_cm_kg_m2": _estimate(certification.bat["inertia_cm"]),
        },
        "ball": {
            "name": session.ball,
            "ball_restitution_is": "the mean of the lot, every ball measured",
            "set_aside": [asdict(ball) for ball in certification.set_aside],
        },
        "rigs": dict(session.rigs),
        "laboratory": session.laboratory,
        "customer": session.customer,
        "date": session.date,
        "metric": {
            "name": procedure.metric,
            "value": metric.value if metric else None,
            "u": metric.u if metric else None,
            "interval_95": list(metric.interval_95) if metric else None,
            "degrees_of_freedom": _finite(metric.dof) if metric else None,
            "u_type_a": metric.u_type_a if metric else None,
            "u_type_b": metric.u_type_b if metric else None,
            "unit": METRICS[procedure.metric].si_unit,
            "limit": procedure.most,
            "place_in": certification.outcome.place / INCH if metric else None,
        },
        "verdict": certification.verdict.value,
        "marginal": certification.marginal,
        "decision_rule": DECISION_RULE,
    }
    for name in QUANTITIES:
        if name != procedure.metric or _of_standard_ball(procedure):
            document[name] = _estimate(certification.quantities.get(name))
    document |= {
        "recoil": {
            "which": procedure.recoil,
            "other": asdict(certification.other) if certification.other else None,
        },
        "ball_correction": _correction(certification),
        "nominal_speed_mph": procedure.ball_speed / MPH,
        "nominal_bat_speed_mph": (procedure.bat_speed or 0.0) / MPH,
        "v_rel_mph": float(shots.relative_speed[used].mean() / MPH) if used.any() else None,
        "impact_position_in": float(certification.outcome.place / INCH)
        if isfinite(certification.outcome.place)
        else None,
        "width_m": _width(certification.width),
        "swing_range": [_swing(result) for result in certification.swings],
        "places": place_rows(certification) if procedure.scan else [],
        "findings": [asdict(finding) for finding in certification.findings],
        "flags": [asdict(flag) for flag in certification.flags],
        "incomplete": certification.outcome.reason,
        "reasons": list(certification.reasons),
        "valid_hits": int(valid.sum()),
        "rejected_hits": [
            {"shot": shot, "reason": reason}
            for shot, reason in enumerate(certification.judgement.reasons)
            if reason
        ],
        "rebound_check": _rebound_check(certification),
        "second_witness": witness_document(certification.second_witness),
        "ring": {
            "frequencies_hz": recoil.ring_frequency.tolist(),
            "decays_per_s": recoil.ring_decay.tolist(),
        }
        if recoil
        else None,
        "choice": _choice(metric),
        "conditional_on": conditional_on(certification),
        "budget": budget_rows(metric) if metric else [],
        "unverified": [
            {
                "key": datum.key,
                "value": f"{datum.value} {datum.unit}".removesuffix(" 1"),
                "source": datum.source,
            }
            for datum in certification.unverified
        ],
        "simulation": dict(session.simulation)
        | ({"truth_digest": truth_digest} if truth_digest else {}),
        "versions": {
            name: version(name) for name in ("virtual-lab", "numpy", "scipy", "pandas", "numba")
        },
    }
    return document


def conditional_on(certification: Certification) -> str:
    """Return in a sentence what the result and its uncertainty take for granted."""
    unverified = len(certification.unverified)
    values = "1 of its values is" if unverified == 1 else f"{unverified} of its values are"
    model = (
        "the model of the collision (the force law of the ball alone moves the peak e of a bat "
        f"by {LAW_SPREAD:g}) and on "
        if certification.session.simulation
        else ""
    )
    return (
        f"The result and its uncertainty are conditional on {model}the procedure as it is known "
        f"here ({values} unverified)."
    )


def _choice(metric: Budget | None) -> dict[str, float] | None:
    """Return by how much the value is raised for the place chosen by a scan, None where by none."""
    chosen = [part for part in metric.components if part.name == CHOICE] if metric else []
    return {"correction": chosen[0].value, "u": chosen[0].u} if chosen else None


def _estimate(budget: Budget | None) -> dict[str, float | None]:
    return {"value": budget.value if budget else None, "u": budget.u if budget else None}


def _width(width: Width | None) -> dict[str, Any] | None:
    if width is None:
        return None
    whole = width.span.whole
    return {
        "value": width.budget.value,
        "u": width.budget.u if whole else None,
        "drop": width.drop,
        "at_least": not whole,
        "from_in": width.span.low / INCH,
        "to_in": width.span.high / INCH,
    }


def _swing(result: SwingResult) -> dict[str, Any]:
    """Return v_f for one exponent of the swing law, in SI units as the metric."""
    return {
        "exponent": result.exponent,
        "value": result.budget.value,
        "u": result.budget.u,
        "interval_95": list(result.budget.interval_95),
        "place_in": result.place / INCH,
    }


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _of_standard_ball(procedure: Procedure) -> bool:
    """Return whether the metric is carried to another ball than the lot's own."""
    return procedure.correction is not None and procedure.correction.method != "none"


def _correction(certification: Certification) -> dict[str, Any] | None:
    """Return what is done about balls that are not the standard one, None where nothing is."""
    correction = certification.procedure.correction
    if correction is None or not _of_standard_ball(certification.procedure):
        return None
    ratio = certification.session.calibration.get(CONTROL)
    return {
        "method": correction.method,
        "standard": correction.standard,
        "control": {"value": ratio.value, "u": ratio.u, "source": ratio.source} if ratio else None,
    }


def _rebound_check(certification: Certification) -> dict[str, Any] | None:
    """Return how the ball's own rebound agrees with the recoil: the gates' e_A less the encoder's.

    None where nothing watched the recoil.
    """
    if certification.readings.recoil is None:
        return None
    shots, valid = certification.shots, certification.judgement.valid
    seen = valid & np.isfinite(shots.rebound_efficiency)
    if not seen.any():
        return {"shots": 0, "collision_efficiency": None, "difference": None}
    rebound = shots.rebound_efficiency[seen]
    return {
        "shots": int(seen.sum()),
        "collision_efficiency": float(rebound.mean()),
        "difference": float((rebound - shots.recoil_efficiency[seen]).mean()),
    }
