"""The camera's word on a test: in a certificate's document, as text, as rows, as columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from virtual_lab.measurement.camera.comparison import CameraComparison, ComparedQuantity
from virtual_lab.output.rounding import decimals, with_uncertainty
from virtual_lab.uncertainty.budget import Budget
from virtual_lab.units import DEGREE, INCH, MPH

__all__ = ["witness_columns", "witness_document", "witness_rows", "witness_text"]

SYMBOLS = {"collision_efficiency": "e_A", "restitution": "e", "bat_performance_factor": "BPF"}
TOLD_BY = ("gates", "video", "joined")


def witness_document(witness: CameraComparison | None) -> dict[str, Any] | None:
    """Return a second witness as it stands in ``certificate.json``, None where there was none."""
    if witness is None:
        return None
    told = {name: _told(each) for name, each in witness.told.items()}
    return {"hits": witness.hits, "missed": witness.missed, **told}


def _told(told: ComparedQuantity) -> dict[str, Any]:
    by = {name: _stated(getattr(told, name)) for name in (*TOLD_BY, "difference")}
    return by | {"share_of_video": told.share, "agree": told.agree}


def _stated(budget: Budget) -> dict[str, float]:
    return {"value": budget.value, "u": budget.u}


def witness_text(document: Mapping[str, Any] | None) -> list[str]:
    """Return what a certificate's document says of its second witness, as lines."""
    if document is None:
        return []
    if not document["hits"]:
        return ["  the camera saw no hit that counts well enough"]
    hits = f"of {document['hits']} hits"
    missed = f", {document['missed']} more not seen well" if document["missed"] else ""
    lines = [f"  gates and video {hits}{missed}:"]
    for name, symbol in SYMBOLS.items():
        told = document[name]
        said = ", ".join(
            f"{by} {with_uncertainty(told[by]['value'], told[by]['u'])}" for by in TOLD_BY
        )
        apart = told["difference"]
        agreed = "agree" if told["agree"] else "DISAGREE"
        off = with_uncertainty(apart["value"], apart["u"])
        lines.append(f"    {symbol:4} {said}; {agreed}, {off} apart")
    return lines


def witness_rows(document: Mapping[str, Any] | None) -> list[dict[str, str]]:
    """Return a row a quantity for the page; [] where there is nothing to show."""
    if document is None or not document["hits"]:
        return []
    rows = []
    for name, symbol in SYMBOLS.items():
        told = document[name]
        apart = told["difference"]
        places = decimals(apart["u"])
        row = {"symbol": symbol, "agree": "agree" if told["agree"] else "disagree"}
        for by in TOLD_BY:
            row[by] = f"{told[by]['value']:.{places}f}"
            row[f"{by}_u"] = f"{told[by]['u']:.{decimals(told[by]['u'])}f}"
        row["difference"] = f"{apart['value'] + 0.0:+.{places}f}".replace("-", "−")
        row["difference_u"] = f"{apart['u']:.{places}f}"
        rows.append(row)
    return rows


def witness_columns(witness: CameraComparison | None) -> dict[str, Any]:
    """Return what the camera says of every shot, as columns of the readings."""
    if witness is None:
        return {}
    filmed, u = witness.filmed, witness.u
    return {
        "video_speed_mph": filmed.flights.speed_in / MPH,
        "video_speed_u_mph": u["speed_in"] / MPH,
        "video_rebound_mph": filmed.flights.speed_out / MPH,
        "video_rebound_u_mph": u["speed_out"] / MPH,
        "video_place_in": filmed.place / INCH,
        "video_place_u_in": u["place"] / INCH,
        "video_angle_deg": np.asarray(filmed.angle_in) / DEGREE,
        "video_angle_u_deg": u["angle"] / DEGREE,
        "video_efficiency": witness.shots.rebound_efficiency,
        "video_efficiency_u": u["efficiency"],
    }
