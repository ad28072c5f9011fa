"""Names of calibration constants in a session."""

from __future__ import annotations

from dataclasses import replace

from virtual_lab.catalog.specs import BallSpec
from virtual_lab.records import Record, join
from virtual_lab.records.session import Session
from virtual_lab.simulation.rig import RigOutput, Stage
from virtual_lab.uncertainty.estimate import Estimate


def constant_name(stage: Stage, name: str) -> str:
    """Return a constant's name in a session; rigs in one hall share air and gravity."""
    if name.startswith("hall."):
        return name
    return f"hall.{name}" if name.startswith("air.") else f"{stage.value}.{name}"


def lot_constants(ball: BallSpec) -> dict[str, Estimate]:
    """Return the constants of a lot that are known before a ball is measured."""
    return {
        "ball.radius": Estimate(value=ball.radius, u=ball.radius_u),
        "ball.restitution_slope": Estimate(
            value=ball.restitution.slope, u=ball.restitution.slope_u
        ),
    }


def with_records(session: Session, stage: Stage, plays: list[RigOutput]) -> Session:
    records: dict[str, Record] = {
        channel: join([play.records[channel] for play in plays]) for channel in plays[0].records
    }
    return replace(session, records={**session.records, stage.value: records})
