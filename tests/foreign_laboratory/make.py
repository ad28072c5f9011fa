"""Write the tables of the other laboratory from a simulated test, as its recorders would.

    python -m tests.foreign_laboratory.make

The units are inches, ounces, mph, microseconds, degrees and milliseconds, indices begin at 1, and
values are rounded as such recorders show them. The form ``records/laboratory.toml`` is written by
hand and is not changed. The answer has the results of the same session in our own form, and the
truth. A change of the simulation does not require new tables. With new tables,
``worked_by_hand.md`` must change, too; its test names every number that differs.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from tests.laboratories import certify
from virtual_lab.measurement.certification import certify_session
from virtual_lab.measurement.procedure.model import QUANTITIES
from virtual_lab.records import Record
from virtual_lab.records.session import Session
from virtual_lab.units import DEGREE, INCH, MPH, OUNCE

HERE = Path(__file__).parent
RECORDS, ANSWER = HERE / "records", HERE / "answer.json"
SEED = 20031
SAMPLES = 700  # number of samples, of 1500, for a small file
EDGES = ("broke", "cleared")
Stage = dict[str, Record]


def main() -> None:
    tested = certify("r161", procedure="astm-f1881", seed=SEED)
    session = _shortened(tested.certification.session)
    bench(dict(session.records["bench"]))
    wall(dict(session.records["balls"]))
    impact(dict(session.records["impact"]))
    certification = certify_session(session)
    truth = tested.sealed.document()["measurand"]
    answer = {
        name: {"value": budget.value, "u": budget.u, "true": truth[name]}
        for name in QUANTITIES
        for budget in [certification.quantities[name]]
    }
    answer["verdict"] = certification.verdict.value
    ANSWER.write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")


def _shortened(session: Session) -> Session:
    encoder = session.records["impact"]["encoder"]
    short = replace(encoder, counts=encoder.counts[:, :SAMPLES], times=encoder.times[:SAMPLES])
    impact = {**session.records["impact"], "encoder": short}
    return replace(session, records={**session.records, "impact": impact})


def bench(records: Stage) -> None:
    """Write one table of the readings of the bat, one of the balls and one of the swings."""
    _write(
        "bat.csv",
        {
            "who": ["AB", "AB", "CD", "CD", "CD"],
            "weight (oz)": _round(records["bat-mass"].readings[0] / OUNCE, 3),
            "length (in)": _round(records["length"].readings[0] / INCH, 3),
            "barrel radius (in)": _round(records["barrel-radius"].readings[0] / INCH, 3),
            "balance point (in)": _round(records["balance"].readings[0] / INCH, 3),
        },
    )
    masses = _round(records["ball-mass"].readings / OUNCE, 3)
    ball, reading = np.indices(masses.shape).reshape(2, -1) + 1
    _write("balls.csv", {"mass_oz": masses.ravel(), "repeat": reading, "ball": ball})
    swings = records["pendulum"]
    _write(
        "swings.csv",
        {"release": np.arange(len(swings.times)) + 1}
        | {f"t{k}": _round(t * 1e3, 3) for k, t in enumerate(swings.times.T)}
        | {
            "start_deg": _round(swings.first_amplitude / DEGREE, 1),
            "end_deg": _round(swings.last_amplitude / DEGREE, 1),
        },
    )


def wall(records: Stage) -> None:
    """Write the wall's log, and its gates with one row per shot."""
    log = records["log"]
    _write("wall-shots.csv", _log(log) | {"place_in": 0})
    _write("wall-gates.csv", {"shot": np.arange(len(log.ball)) + 1} | _wide(records["gates"]))


def impact(records: Stage) -> None:
    """Write log and marks, the gates with a row per edge, the encoder with a column per shot."""
    log, encoder, aim = records["log"], records["encoder"], records["aim"]
    _write("shots.csv", _log(log) | {"place_in": _round(log.place / INCH, 4)})
    gates = records["gates"].table()
    gates["time_us"] = _microseconds(gates.pop("time_s"))
    for axis in ("shot", "way", "gate", "edge"):
        gates[axis] += 1
    order = ["edge", "time_us", "gate", "way", "shot"]
    _write("gates.csv", gates.sort_values(["edge", "gate", "shot"])[order])
    ticks = {"t [ms]": _round(encoder.times * 1e3, 3)}
    counts = {f"shot {n + 1}": row.astype(int) for n, row in enumerate(encoder.counts)}
    # encoder's recorder: on Windows
    text = pd.DataFrame(ticks | counts).to_csv(index=False, lineterminator="\r\n")
    (RECORDS / "encoder.csv").write_bytes(text.encode("utf-8-sig"))
    # marks: from a spreadsheet with decimal commas
    marks = {
        "across_mm": _round(aim.across * 1e3, 2),
        "mark": np.arange(aim.along.size) + 1,
        "along_mm": _round(aim.along * 1e3, 2),
    }
    text = pd.DataFrame(marks).to_csv(index=False, sep=";", decimal=",")
    (RECORDS / "marks.csv").write_text(text, encoding="utf-8")


def _log(log: Record) -> dict[str, object]:
    return {
        "nominal_speed_mph": _round(log.nominal_speed / MPH, 3),
        "ball": log.ball.astype(int) + 1,
        "shot": np.arange(len(log.ball)) + 1,
    }


def _wide(gates: Record) -> dict[str, pd.Series]:
    return {
        f"{'back' if way else 'in'} {gate + 1} {EDGES[edge]}": _microseconds(
            gates.times[:, way, gate, edge]
        )
        for way, gate, edge in np.ndindex(gates.times.shape[1:])
    }


def _round(values: np.ndarray, digits: int) -> np.ndarray:
    return np.round(values, digits) + 0.0  # sum with 0.0: no -0.0


def _microseconds(times: np.ndarray) -> pd.Series:
    """Return whole microseconds, with an empty cell where there is no time."""
    return pd.Series(np.round(times * 1e6)).astype("Int64")


def _write(name: str, columns: object) -> None:
    pd.DataFrame(columns).to_csv(RECORDS / name, index=False)


if __name__ == "__main__":
    main()
