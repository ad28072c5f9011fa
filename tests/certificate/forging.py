"""Forged result folders: records or truth changed, and everything else made again to agree.

All digests and forms are made by the functions of the program, so no digest reveals a forgery.

``python -m tests.certificate.forging OUT.csv`` lists for every forgery, and for every alteration by
hand of `tests.certificate.test_alterations`, what `verify` and `score` find (some minutes).
"""

from __future__ import annotations

import csv
import hashlib
import json
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import cv2
import numpy as np

import virtual_lab as vl
from virtual_lab import score as score_folder
from virtual_lab.api import Certificate
from virtual_lab.certificate.seal import write_seal
from virtual_lab.certificate.verify import verify
from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import certify_session
from virtual_lab.records.session import Session, load_session
from virtual_lab.uncertainty.estimate import Estimate

Truth = dict[str, Any]
Forge = Callable[[Session, Truth], tuple[Session, Truth]]
SEED = 0x5EED_0000_0000_0000_0000_0000_0000_0007  # in place of a random seed, which is sealed


def sealed_test(
    folder: Path, bat: str = "r161", seed: int = SEED, pdf: bool = False, **choices: Any
) -> Path:
    """Save the test of a sealed seed, which is always the same."""
    with (
        mock.patch("secrets.randbits", return_value=seed),
        mock.patch("secrets.token_bytes", return_value=bytes(range(16))),
    ):
        return vl.certify(bat, **choices).save(folder, pdf=pdf)


def forge(folder: Path, target: Path, change: Forge) -> Path:
    """Save a forgery of a result folder, with all digests, forms, sums and seal made again."""
    truth = json.loads((folder / "truth/truth.json").read_text("utf-8"))
    session, truth = change(load_session(folder / "records"), truth)
    sealed: Any = truth  # only its presence matters: the bytes below are written
    forged = Certificate(certification=certify_session(session), sealed=sealed)
    forged.__dict__["_truth"] = (json.dumps(truth, indent=1) + "\n").encode()
    return forged.save(target)


def in_session(**changes: Any) -> Forge:
    return lambda session, truth: (replace(session, **changes), truth)


def particular(table: str, **changes: Any) -> Forge:
    def change(session: Session, truth: Truth) -> tuple[Session, Truth]:
        stated = session.particulars
        inner = replace(getattr(stated, table), **changes)
        return replace(session, particulars=replace(stated, **{table: inner})), truth

    return change


def origin(**changes: Any) -> Forge:
    return lambda session, truth: (
        replace(session, origin=replace(session.origin, **changes)),
        truth,
    )


def model(name: str, **changes: Any) -> Forge:
    def change(session: Session, truth: Truth) -> tuple[Session, Truth]:
        rungs: Any = dict(session.origin.rungs)  # type: ignore[union-attr]
        rungs[name] = replace(rungs[name], **changes)
        return origin(rungs=rungs)(session, truth)

    return change


def constant(key: str, **changes: Any) -> Forge:
    def change(session: Session, truth: Truth) -> tuple[Session, Truth]:
        stated = session.calibration[key]
        factors = {name: getattr(stated, name) * factor for name, factor in changes.items()}
        entries = {**session.calibration, key: replace(stated, **factors)}
        return replace(session, calibration=entries), truth

    return change


def source_of(key: str) -> Forge:
    def change(session: Session, truth: Truth) -> tuple[Session, Truth]:
        entries = {**session.calibration}
        entries[key] = replace(entries[key], source="recalibrated")
        return replace(session, calibration=entries), truth

    return change


def rules(old: str, new: str) -> Forge:
    def change(session: Session, truth: Truth) -> tuple[Session, Truth]:
        assert old in session.procedure_text
        return replace(session, procedure_text=session.procedure_text.replace(old, new, 1)), truth

    return change


def record(channel: str, field: str, change: Callable[[Any], Any]) -> Forge:
    """Change an array of a record, which the function gets as a copy."""
    stage, name = channel.split("/")

    def changed(session: Session, truth: Truth) -> tuple[Session, Truth]:
        stated = session.records[stage][name]
        values = np.array(getattr(stated, field))
        new = replace(stated, **{field: change(values)})
        records = {**session.records, stage: {**session.records[stage], name: new}}
        return replace(session, records=records), truth

    return changed


def step(size: float, place: Any = -1) -> Callable[[Any], Any]:
    """Return a change of one reading by a step of its instrument."""

    def change(values: Any) -> Any:
        values.reshape(-1)[place] += size
        return values

    return change


def swap(values: Any) -> Any:
    values[[0, 1]] = values[[1, 0]]
    return values


def without(channel: str) -> Forge:
    stage, name = channel.split("/")

    def change(session: Session, truth: Truth) -> tuple[Session, Truth]:
        left = {key: each for key, each in session.records[stage].items() if key != name}
        return replace(session, records={**session.records, stage: left}), truth

    return change


def last_shot_gone(session: Session, truth: Truth) -> tuple[Session, Truth]:
    impact = {
        name: each.select(slice(-1)) if "shot" in each.sizes() else each
        for name, each in session.records["impact"].items()
    }
    return replace(session, records={**session.records, "impact": impact}), truth


def in_truth(key: str, value: Any) -> Forge:
    """Set a value of the truth; a function changes the old one."""

    def change(session: Session, truth: Truth) -> tuple[Session, Truth]:
        truth = table = deepcopy(truth)
        *above, last = [int(part) if part.isdigit() else part for part in key.split("/")]
        for part in above:
            table = table[part]
        table[last] = value(table[last]) if callable(value) else value
        return session, truth

    return change


def scaled(factor: float) -> Callable[[float], float]:
    return lambda value: value * factor


def measured_is_true(session: Session, truth: Truth) -> tuple[Session, Truth]:
    metric = certify_session(session).metric
    assert metric is not None
    return in_truth("measurand/metric", metric.value)(session, truth)


def both(*changes: Forge) -> Forge:
    def change(session: Session, truth: Truth) -> tuple[Session, Truth]:
        for each in changes:
            session, truth = each(session, truth)
        return session, truth

    return change


def limit_in_both(session: Session, truth: Truth) -> tuple[Session, Truth]:
    session, truth = rules("value = 1.2,", "value = 1.3,")(session, truth)
    return in_truth("recipe/sheets", {"procedures/astm-f1881": session.procedure_text})(
        session, truth
    )


def name_in_both(session: Session, truth: Truth) -> tuple[Session, Truth]:
    text = vl.bat("r161").text.replace('name = "r161"', 'name = "r162"')
    session, truth = in_session(bat="r162")(session, truth)
    for key, value in (
        ("recipe/bat", "r162"),
        ("recipe/sheets", {"bats/r162": text}),
        ("bat/name", "r162"),
    ):
        session, truth = in_truth(key, value)(session, truth)
    return origin(unverified_numbers=renamed(session))(session, truth)


def renamed(session: Session) -> dict[str, str]:
    counts: Any = session.origin.unverified_numbers  # type: ignore[union-attr]
    return {key.replace("r161", "r162"): value for key, value in counts.items()}


HISTORY = {
    name: Estimate(value=1e-9, dof=400.0, source="40 earlier tests")
    for name in ("metric", "restitution", "collision_efficiency", "bat_performance_factor")
}
STATED = {
    name: {"value": 1e-9, "u": 0.0, "dof": 400.0, "source": "40 earlier tests"} for name in HISTORY
}
MICROSECOND = 1e-6

RECORDS: dict[str, Forge] = {  # records, constants and rules
    "name of the bat": in_session(bat="ea70"),
    "sport of the bat": in_session(bat_sport=""),
    "construction of the bat": in_session(bat_construction=""),
    "name of the ball": in_session(ball="baseball-2010"),
    "sport of the ball": in_session(ball_sport=""),
    "name of the rig": in_session(rigs={"bench": "bench", "balls": "ball-wall", "impact": "mine"}),
    "method of the uncertainty": in_session(uncertainty="second-order"),
    "scatter of earlier tests": in_session(history=HISTORY),
    "limit": rules("value = 1.2,", "value = 0.9,"),
    "limit that passes": rules("value = 1.2,", "value = 1.3,"),
    "name of the procedure": rules('name = "astm-f1881"', 'name = "astm-f1881-best"'),
    "edition of the procedure": rules("ASTM F1881-11", "ASTM F1881-23"),
    "remark in the procedure": lambda s, t: (
        replace(s, procedure_text=s.procedure_text + "# approved\n"),
        t,
    ),
    "mass of the bat": record("bench/bat-mass", "readings", step(1e-4)),
    "mass of a ball": record("bench/ball-mass", "readings", step(1e-4, 0)),
    "reference mass": record("bench/reference-mass", "readings", step(1e-4)),
    "length": record("bench/length", "readings", step(5e-4)),
    "radius of the barrel": record("bench/barrel-radius", "readings", step(5e-4)),
    "balance point": record("bench/balance", "readings", step(5e-4)),
    "passage of the pendulum": record("bench/pendulum", "times", step(1e-5)),
    "amplitude of the pendulum": record("bench/pendulum", "first_amplitude", step(1e-3)),
    "temperature": record("bench/climate", "temperature", step(0.1)),
    "humidity": record("bench/climate", "humidity", step(0.01)),
    "pressure": record("bench/climate", "pressure", step(10.0)),
    "humidity of the store": record("bench/store", "humidity", step(0.01)),
    "gate of a hit on the wall": record("balls/gates", "times", step(MICROSECOND)),
    "all gates of the wall": record("balls/gates", "times", lambda times: times * 1.0001),
    "speed in the log of the wall": record("balls/log", "nominal_speed", step(0.1)),
    "gate of a shot": record("impact/gates", "times", step(MICROSECOND)),
    "first gate of a shot": record("impact/gates", "times", step(-MICROSECOND, 0)),
    "all gates of the shots": record("impact/gates", "times", lambda times: times * 1.0001),
    "shots exchanged": record("impact/gates", "times", swap),
    "count of the encoder": record("impact/encoder", "counts", step(1.0)),
    "counts exchanged": record("impact/encoder", "counts", swap),
    "times of the encoder": record("impact/encoder", "times", lambda times: times + 1e-5),
    "mark of the aim": record("impact/aim", "along", step(5e-4)),
    "mark across": record("impact/aim", "across", step(5e-4)),
    "ball in the log": record("impact/log", "ball", step(-1.0)),
    "position in the log": record("impact/log", "place", step(1e-3)),
    "speed in the log": record("impact/log", "nominal_speed", step(0.1)),
    "store gone": without("bench/store"),
    "climate gone": without("bench/climate"),
    "last shot gone": last_shot_gone,
    **{
        f"{what} of {key}": constant(key, **{what: factor})
        for key in (
            "bench.scale.span",
            "bench.rule.offset",
            "bench.stand.offset",
            "bench.pendulum.clock",
            "bench.pendulum.pivot_from_knob",
            "balls.gates.distance_0",
            "hall.air.drag_coefficient",
            "impact.gates.distance_0",
            "impact.gates.clock",
            "impact.encoder.scale",
            "ball.radius",
        )
        for what, factor in (("value", 1 + 1e-6), ("u", 0.5))
    },
    "source of a constant": source_of("impact.gates.clock"),
    "kind of the simulation": origin(reality="ideal"),
    "unverified numbers": origin(unverified_numbers={}),
    "collision model": model("collision", rung="reference"),
    "model of the motion": model("motion", rung="pymunk"),
}
TRUTHS: dict[str, Forge] = {  # the truth alone
    "true metric set to the measured one": measured_is_true,
    **{
        f"true {name}": in_truth(f"measurand/{name}", scaled(1 + 1e-7))
        for name in ("metric", "restitution", "collision_efficiency", "recoil_factor")
    },
    "seed": in_truth("seed", SEED + 1),
    "seed in the recipe": in_truth("recipe/seed", SEED + 1),
    "both seeds": both(in_truth("seed", SEED + 1), in_truth("recipe/seed", SEED + 1)),
    "salt": in_truth("salt", "00" * 16),
    "number": in_truth("number", 1),
    "number in the recipe": both(in_truth("number", 1), in_truth("recipe/number", 1)),
    "kind of the true test": in_truth("reality", "ideal"),
    "density of the bat": in_truth("bat/body/material/density", scaled(1.001)),
    "true name of the bat": in_truth("bat/name", "ea70"),
    "true mass of the bat": in_truth("bat_properties/mass", scaled(1.001)),
    "true mass of a ball": in_truth("balls/mass/3", scaled(1.001)),
    "true e0 of a ball": in_truth("balls/restitution/3", scaled(1.001)),
    "balls in use": in_truth("balls/used", [3, 4]),
    "true constant": in_truth("constants/impact.gates.clock", scaled(1 + 1e-6)),
    "true e_A of a shot": in_truth("shots/collision_efficiency/0", scaled(1.001)),
    "true e0 of a hit on the wall": in_truth("wall_hits/ball_restitution/0", scaled(1.001)),
    "true position": in_truth("place_m/0", scaled(1.001)),
    "a fault": in_truth("faults", ["gate-moved"]),
    "a fault in the recipe": in_truth("recipe/faults", ["gate-moved"]),
    "a fault in both": both(
        in_truth("faults", ["gate-moved"]), in_truth("recipe/faults", ["gate-moved"])
    ),
    "bat in the recipe": in_truth("recipe/bat", "ea70"),
    "procedure in the recipe": in_truth("recipe/procedure", "bbcor"),
    "test in the recipe": in_truth("recipe/test", 2),
    "lot in the recipe": in_truth("recipe/lot", 2),
    "nominal bat in the recipe": in_truth("recipe/random_bat", False),
    "motion in the recipe": in_truth("recipe/motion", "pymunk"),
    "method in the recipe": in_truth("recipe/uncertainty", "second-order"),
    "no recipe": in_truth("recipe", {}),
    "an unknown rig in the recipe": in_truth("recipe/rig", "mine"),
}
SIGNED: dict[str, Forge] = {  # changes that only a signature shows, as README.md lists them
    "date": in_session(date="2020-01-01"),
    "customer": particular("customer", name="Nobody"),
    "laboratory": particular("laboratory", name="Crosstown"),
    "serial number": particular("bat", serial="S-2"),
    "operator": particular("test", operator="Nobody"),
    "deviations": particular("test", deviations="none"),
    "sentence on the seed": origin(sealing="reproducible: seed chosen, not sealed"),
    "commitment, with its salt": both(
        in_truth("salt", "00" * 16),
        origin(seed_commitment=hashlib.sha256(bytes(16) + str(SEED).encode()).hexdigest()),
    ),
    "error of a model": model("collision", error=1e-9),
    "reason for a model": model("collision", reason="the best one"),
    "scatter of earlier tests, also in the recipe": both(
        in_session(history=HISTORY), in_truth("recipe/history", STATED)
    ),
    "limit, also in the recipe": limit_in_both,
    "name of the bat, also in the recipe": name_in_both,
}


def find(folder: Path) -> tuple[str, int]:
    """Return the state that `verify` finds and the exit code of `score`; 2 is bad input."""
    results = []
    for check in (lambda: verify(folder).state, lambda: score_folder(folder).code):
        try:
            results.append(check())
        except InputError:
            results.append(2)
    return results[0], results[1]


def table(work: Path) -> Iterator[tuple[str, str, str, int]]:
    """Yield kind and name of every forgery and alteration, and what is found in it.

    An alteration by hand also has new lists of digests: ``SHA256SUMS`` and the seal.
    """
    from tests.certificate.altering import sums_again
    from tests.certificate.test_alterations import ALTERED

    cv2.imwrite(str(work / "logo.png"), np.zeros((9, 9), np.uint8))
    lab = work / "lab.toml"
    stated = '[laboratory]\nname = "Bat Laboratory"\nlogo = "logo.png"\n'
    lab.write_text(f'{stated}[customer]\nname = "Ashwood & Sons"\n')
    made = sealed_test(work / "made")
    altered = sealed_test(work / "altered", pdf=True, laboratory=lab)
    yield "none", "", *find(made)
    for kind, forgeries in (("truth", TRUTHS), ("signed", SIGNED), ("records", RECORDS)):
        for name, change in forgeries.items():
            yield kind, name, *find(forge(made, work / f"{kind} {name}".replace("/", "-"), change))
    for number, (name, (edit, _, _)) in enumerate(ALTERED.items()):
        folder = Path(shutil.copytree(altered, work / str(number)))
        edit(folder)
        write_seal(folder)
        sums_again(folder)
        yield "by hand", name, *find(folder)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name, open(sys.argv[1], "w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(("kind", "change", "verify", "score"))
        for row in table(Path(name)):
            writer.writerow(row)
            out.flush()
