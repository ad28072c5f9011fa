"""The certificate as a document: what `certificate.json` holds and the page is made from."""

from __future__ import annotations

from importlib.metadata import version
from math import isfinite
from typing import Any

import numpy as np

from virtual_lab.certification import QUANTITIES, Certification
from virtual_lab.report.tables import budget_rows
from virtual_lab.uncertainty.budget import Budget
from virtual_lab.units import INCH, MPH

__all__ = ["SCHEMA", "certificate"]

SCHEMA = 1
DECISION_RULE = (
    "PASS where the value is at most the limit (simple acceptance); "
    "marginal where the limit lies within the 95 % interval"
)
SIMULATED = "SIMULATED: no real bat was tested and no accredited laboratory issued this."


def certificate(certification: Certification, *, truth_digest: str | None = None) -> dict[str, Any]:
    """Return the certificate, ready for JSON: numbers as measured, unrounded, NaN as null.

    `truth_digest` binds it to the sealed truth of a simulated test.
    """
    session, procedure = certification.session, certification.procedure
    valid = certification.judgement.valid
    metric = certification.metric
    shots, readings = certification.shots, certification.readings
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
        },
        "rigs": dict(session.rigs),
        "date": session.date,
        "metric": {
            "name": procedure.metric,
            "value": metric.value if metric else None,
            "u": metric.u if metric else None,
            "interval_95": list(metric.interval_95) if metric else None,
            "degrees_of_freedom": _finite(metric.dof) if metric else None,
            "u_type_a": metric.u_type_a if metric else None,
            "u_type_b": metric.u_type_b if metric else None,
            "limit": procedure.limit,
        },
        "verdict": certification.verdict.value,
        "marginal": certification.marginal,
        "decision_rule": DECISION_RULE,
    }
    for name in QUANTITIES:
        if name != procedure.metric:
            document[name] = _estimate(certification.quantities.get(name))
    document |= {
        "recoil": {
            "which": procedure.recoil,
            "with_free_bat": {
                "recoil_factor": certification.free.recoil_factor,
                "restitution": certification.free.restitution,
                "bat_performance_factor": certification.free.bat_performance_factor,
            }
            if certification.free
            else None,
        },
        "nominal_speed_mph": procedure.speed / MPH,
        "v_rel_mph": float(shots.speed[valid].mean() / MPH) if valid.any() else None,
        "impact_position_in": float(readings.place[0] / INCH),
        "valid_hits": int(valid.sum()),
        "rejected_hits": [
            {"shot": shot, "reason": reason}
            for shot, reason in enumerate(certification.judgement.reasons)
            if reason
        ],
        "rebound_check": _rebound_check(certification),
        "ring": {
            "frequencies_hz": certification.readings.recoil.ring_frequency.tolist(),
            "decays_per_s": certification.readings.recoil.ring_decay.tolist(),
        },
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


def _estimate(budget: Budget | None) -> dict[str, float | None]:
    return {"value": budget.value if budget else None, "u": budget.u if budget else None}


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _rebound_check(certification: Certification) -> dict[str, Any]:
    """Return how the ball's own rebound agrees: the gates' e_A less the encoder's, same shots."""
    shots, valid = certification.shots, certification.judgement.valid
    seen = valid & np.isfinite(shots.rebound_efficiency)
    if not seen.any():
        return {"shots": 0, "collision_efficiency": None, "difference": None}
    rebound = shots.rebound_efficiency[seen]
    return {
        "shots": int(seen.sum()),
        "collision_efficiency": float(rebound.mean()),
        "difference": float((rebound - shots.collision_efficiency[seen]).mean()),
    }
