"""Verdicts against the records: INVALID sound laboratories, and the effect of faults.

    python -m tests.studies.verdicts sound PROCEDURE FIRST NUMBER FILE.csv
    python -m tests.studies.verdicts table FILE.csv ...
    python -m tests.studies.verdicts blocks PROCEDURE SEED NUMBER FILE.csv
    python -m tests.studies.verdicts injected PROCEDURE FIRST NUMBER FILE.csv
    python -m tests.studies.verdicts faults PROCEDURE FIRST NUMBER FILE.csv
    python -m tests.studies.verdicts stop FIRST NUMBER FILE.csv

`sound` plays full laboratories, one a seed, and adds a row each to the file; seeds that are there
already are left out, so that it can be stopped and resumed and cut into ranges. `table` sums such
files up. `blocks` plays sound laboratories side by side, whose recorders sum up, and adds a row a
check. `injected` changes one record of a sound session, writes the session to disk, reads it back,
reduces it and compares the result with the truth; `faults` compares that of each fault of the
catalog, whose records are written with it, and `stop` that of faster balls, whose bats meet their
stop. Each adds a row a case.
"""

from __future__ import annotations

import csv
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.stats import binom

import virtual_lab
from virtual_lab import catalog, lab
from virtual_lab.catalog.faults import FaultSheet
from virtual_lab.lab import RoundRobin
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.measurement.diagnostics.flag import CONTRADICTS, REMARKED
from virtual_lab.records.session import Session, load_session, save_session

# none of them used to develop the checks
BATS = {
    "astm-f1881": "ea70",
    "asa": "softball-wood-34",
    "bbcor": "r161",
    "ncaa-besr": "knob-loaded",
    "ncaa-modified": "barrel-loaded",
    "proposed": "ea70",
}
FIELDS = ("procedure", "bat", "seed", "verdict", "reasons", "flags", "misfits", "z", "pairs")
COUNTED = ("laboratories", "flagged", "INVALID")
ENOUGH = 1 - 1e-3  # probability that chance exceeds the bound


def row(certification: Certification, truth: float) -> dict[str, object]:
    """Return the results of a laboratory's checks, without its names."""
    metric, judged = certification.metric, certification.judgement.reasons
    return {
        "verdict": certification.verdict.value,
        "reasons": "; ".join(certification.reasons),
        "flags": " ".join(flag.name for flag in certification.flags),
        "misfits": sum("no smooth rotation" in reason for reason in judged),
        "z": f"{(metric.value - truth) / metric.u:.3f}" if metric else "",
        "pairs": " ".join(
            f"{f'{each.name} {each.of}'.strip().replace(' ', '_')}"
            f"={each.likely:.3g}/{each.harmful:.3g}"
            for each in certification.pairs
        ),
    }


def sound(procedure: str, first: int, number: int, into: Path) -> None:
    """Play sound laboratories, and write the row of each as soon as it is known."""
    done: set[int] = set()
    if into.exists():
        with into.open(encoding="utf-8") as file:
            done = {int(each["seed"]) for each in csv.DictReader(file)}
    with into.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        if not done:
            writer.writeheader()
        for seed in range(first, first + number):
            if seed in done:
                continue
            bat = BATS[procedure]
            found = lab.certify_bat(lab.TestSetup.of(bat, procedure=procedure, seed=seed))
            named = {"procedure": procedure, "bat": bat, "seed": seed}
            truth = found.sealed.measurand.get("metric", np.nan)
            writer.writerow(named | row(found.certification, truth))
            file.flush()


def table(files: list[Path]) -> list[dict[str, object]]:
    """Return one row per procedure and pair: counts of p-values below .1, .01 and both limits.

    `most` are the counts exceeded by chance in one study of a thousand.
    """
    laboratories: dict[str, int] = defaultdict(int)
    invalid: dict[str, int] = defaultdict(int)
    seen: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    for path in files:
        with path.open(encoding="utf-8") as file:
            for each in csv.DictReader(file):
                procedure = each["procedure"]
                laboratories[procedure] += 1
                invalid[procedure] += "flag " in each["reasons"] or int(each["misfits"]) > 0
                for pair in each["pairs"].split():
                    name, _, found = pair.partition("=")
                    likely, harmful = map(float, found.split("/"))
                    seen[procedure, name].append((likely, harmful))
    rows: list[dict[str, object]] = []
    for (procedure, name), found in sorted(seen.items()):
        likely, harmful = np.array(found).T
        n = likely.size
        most = {p: int(binom.ppf(ENOUGH, n, p)) for p in (0.1, 0.01)}
        rows.append(
            {
                "procedure": procedure,
                "pair": name.replace("_", " "),
                "laboratories": n,
                "below .1": int((likely < 0.1).sum()),
                "most .1": most[0.1],
                "below .01": int((likely < 0.01).sum()),
                "most .01": most[0.01],
                "remarks": int((likely < REMARKED).sum()),
                "INVALID": int(((likely < REMARKED) & (harmful < CONTRADICTS)).sum()),
            }
        )
    for procedure, n in sorted(laboratories.items()):
        lost = f"{invalid[procedure]} of them with a verdict or a hit lost"
        print(f"{procedure:14} {n} laboratories, {lost}", file=sys.stderr)
    return rows


def blocks(procedure: str, seed: int, number: int) -> Iterator[dict[str, object]]:
    """Yield one row per check, and one for all checks, for sound laboratories in blocks."""
    raised: dict[str, list[np.ndarray]] = defaultdict(list)
    voided: dict[str, list[np.ndarray]] = defaultdict(list)
    for tested in RoundRobin.of(BATS[procedure], procedure).blocks(number, seed):
        checked = tested.certified.checked
        for counts, masks in ((raised, checked.flagged), (voided, checked.voids)):
            for name, where in masks.items():
                counts[name].append(where)
            counts["any"].append(np.logical_or.reduce([*masks.values()]))
    for name in sorted(raised):
        yield {
            "procedure": procedure,
            "bat": BATS[procedure],
            "check": name,
            "laboratories": number,
            "flagged": sum(int(where.sum()) for where in raised[name]),
            "INVALID": sum(int(where.sum()) for where in voided[name]),
        }


Outcome = tuple[Certification, float]  # true value of the metric
CASES = (
    "case",
    "procedure",
    "bat",
    "laboratories",
    "INVALID",
    "remark",
    "silent",
    "median error",  # mean error of all results in u, with its sign
    "worst standing",  # largest error of a standing verdict in u
    "moved",  # largest difference from the sound twin, if the verdict stands
    "contradicted",  # number of verdicts wrong by 3 u although a difference exceeds 6 u
)


def case(
    name: str, procedure: str, bat: str, outcomes: list[Outcome], twins: list[Outcome]
) -> dict[str, object]:
    """Return the results of one case in several laboratories; `twins` are the same without it."""
    invalid = [found.verdict.value == "INVALID" for found, _ in outcomes]
    flagged = [bool(found.flags) for found, _ in outcomes]
    errors = np.array(
        [
            (found.metric.value - truth) / found.metric.u if found.metric else np.nan
            for found, truth in outcomes
        ]
    )
    moved = np.array(
        [
            abs(found.metric.value - twin.metric.value) / found.metric.u
            if found.metric and twin.metric
            else 0.0
            for (found, _), (twin, _) in zip(outcomes, twins, strict=True)
        ]
    )
    apart = [max((each.sigmas for each in found.pairs), default=0.0) for found, _ in outcomes]
    standing = np.where(invalid, 0.0, np.abs(errors))
    known = errors[np.isfinite(errors)]
    return {
        "case": name,
        "procedure": procedure,
        "bat": bat,
        "laboratories": len(outcomes),
        "INVALID": sum(invalid),
        "remark": sum(flag and not bad for flag, bad in zip(flagged, invalid, strict=True)),
        "silent": sum(not flag and not bad for flag, bad in zip(flagged, invalid, strict=True)),
        "median error": f"{np.median(known):+.1f}" if known.size else "",
        "worst standing": f"{standing.max():.1f}" if not all(invalid) else "",
        "moved": f"{np.where(invalid, 0.0, moved).max():.1f}" if not all(invalid) else "",
        "contradicted": int(((standing > 3) & (np.array(apart) > 6)).sum()),
    }


Fields = Mapping[str, np.ndarray]
Injection = tuple[str, str, Callable[[Any, Any], Fields]]


def slip(lost: float, lasts: float, some: float, record: Any, rng: Any) -> Fields:
    """Lose counts evenly over a time [ms], from a random time of some shots."""
    first, last = (
        (0.025, 0.14) if record.times[-1] > 0.1 else (0.0, 0.028)
    )  # record of a swing, which is short
    since = record.times - rng.uniform(first, last, (len(record.counts), 1))
    share = np.clip(since / (lasts * 1e-3), 0, 1) * (rng.random((len(since), 1)) < some)
    return {"counts": record.counts - np.round(lost * share)}


def sector(lost: int, record: Any, rng: Any) -> Fields:
    """Lose counts at one mark of the disk, the same in every shot."""
    turned = record.counts - record.counts[:, :1]
    return {"counts": record.counts - np.clip(turned - rng.uniform(500, 2500), 0, lost).round()}


def late(delay: float, record: Any, rng: Any) -> Fields:
    """Start the encoder's recorder this many ms after that of the gates."""
    return {"times": record.times + delay * 1e-3}


def skipped(samples: int, record: Any, rng: Any) -> Fields:
    """Lose samples of each record at a random time, without a gap in the clock."""
    length = record.counts.shape[1]
    kept = np.arange(length)[None] + samples * (
        np.arange(length) > rng.integers(300, length - 100, (len(record.counts), 1))
    )
    counts = np.take_along_axis(record.counts, np.minimum(kept, length - 1), axis=1)
    return {"counts": counts[:, : length - samples], "times": record.times[: length - samples]}


def gate_jump(jump: float, record: Any, rng: Any) -> Fields:
    """Let the clock of the gates jump ahead [us] when half of the balls come in."""
    times, struck = record.times.copy(), rng.random(len(record.times)) < 0.5
    times[struck, 0, 1:] += jump * 1e-6
    times[struck, 1] += jump * 1e-6
    return {"times": times}


def injections(session: Session) -> Iterator[Injection]:
    """Yield name, channel and change of each injection that the records allow."""
    channels = session.records["impact"]
    for name in {"encoder", "swing"} & channels.keys():
        for lost, lasts in ((5, 30), (20, 10), (20, 50), (50, 300)):
            for some, word in ((1.0, "every shot"), (0.2, "one in five shots")):
                yield (
                    f"slip {lost} counts in {lasts} ms, {word}",
                    name,
                    partial(slip, lost, lasts, some),
                )
        for lost in (10, 100):
            yield f"sector of {lost} counts lost", name, partial(sector, lost)
        for delay in (0.1, 0.2, 0.5, 1, 2, 2.5, 3, 4, 5, 10, 20):
            for way in (1, -1):
                yield f"trigger {way * delay:+g} ms", name, partial(late, way * delay)
        for samples in (2, 10):
            yield f"clock of the encoder loses {samples} samples", name, partial(skipped, samples)
    for jump in (5, 20, 100, 1000):
        yield f"clock of the gates jumps {jump} us", "gates", partial(gate_jump, jump)


def reduced(session: Session) -> Certification:
    """Write a session to disk, read it back and reduce it."""
    with TemporaryDirectory() as folder:
        save_session(session, Path(folder))
        return certify_session(load_session(Path(folder)))


def changed(session: Session, channel: str, fields: Fields) -> Session:
    """Return a session with one changed record of the hits."""
    hits = session.records["impact"]
    hits = {**hits, channel: replace(hits[channel], **fields)}
    return replace(session, records={**session.records, "impact": hits})


def injected(procedure: str, first: int, number: int, bat: str = "") -> Iterator[dict[str, object]]:
    """Yield one row per injection."""
    bat = bat or BATS[procedure]
    sound: list[tuple[int, Session, float]] = []
    for seed in range(first, first + number):
        found = lab.certify_bat(lab.TestSetup.of(bat, procedure=procedure, seed=seed))
        sound.append((seed, found.certification.session, found.sealed.measurand["metric"]))
    twins = [(reduced(session), truth) for _, session, truth in sound]
    yield case("none", procedure, bat, twins, twins)
    for name, channel, change in injections(sound[0][1]):
        outcomes = []
        for seed, session, truth in sound:
            rng = np.random.default_rng([seed, sum(map(ord, name))])
            fields = change(session.records["impact"][channel], rng)
            outcomes.append((reduced(changed(session, channel, fields)), truth))
        yield case(name, procedure, bat, outcomes, twins)


def faults(procedure: str, first: int, number: int) -> Iterator[dict[str, object]]:
    """Yield one row per fault of the catalog with a prediction for the procedure."""
    bat = BATS[procedure]

    def played(*names: str) -> list[Outcome]:
        outcomes = []
        for seed in range(first, first + number):
            setup = lab.TestSetup.of(bat, procedure=procedure, seed=seed, faults=names)
            found = lab.certify_bat(setup)
            truth = found.sealed.measurand.get("metric", np.nan)
            outcomes.append((found.certification, truth))
        return outcomes

    twins = played()
    for name in catalog.names("faults"):
        sheet = catalog.load("faults", name, FaultSheet).spec
        if procedure not in {each.procedure for each in sheet.predictions}:
            continue
        yield case(name, procedure, bat, played(name), twins)


def stop(first: int, number: int) -> Iterator[dict[str, object]]:
    """Yield one row per speed of a softball [mph]: at 67 the bat meets its stop in the record."""
    for bat in ("softball-34", "softball-wood-34"):
        for speed in (60, 66, 67, 68, 70, 72, 75):
            sheet = virtual_lab.procedure("asa").with_(ball_speed=speed)
            outcomes = []
            with catalog.sheets_in_place({("procedures", sheet.name): sheet.text}):
                for seed in range(first, first + number):
                    setup = lab.TestSetup.of(bat, procedure=sheet.name, seed=seed)
                    found = lab.certify_bat(setup)
                    truth = found.sealed.measurand.get("metric", np.nan)
                    outcomes.append((reduced(found.certification.session), truth))
            yield case(f"{speed} mph", "asa", bat, outcomes, outcomes)


def write(rows: Iterator[dict[str, object]], into: Path, columns: tuple[str, ...] = CASES) -> None:
    """Add rows to a file as soon as they are known."""
    new = not into.exists()
    with into.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        if new:
            writer.writeheader()
        for each in rows:
            writer.writerow(each)
            file.flush()


def main(words: list[str]) -> None:
    """Carry out one command."""
    command, *given = words
    if command == "sound":
        sound(given[0], int(given[1]), int(given[2]), Path(given[3]))
    elif command == "table":
        rows = table([Path(word) for word in given])
        print(",".join(rows[0]))
        for each in rows:
            print(",".join(str(value) for value in each.values()))
    elif command == "blocks":
        rows = blocks(given[0], int(given[1]), int(given[2]))
        write(rows, Path(given[3]), ("procedure", "bat", "check", *COUNTED))
    elif command == "stop":
        write(stop(int(given[0]), int(given[1])), Path(given[2]))
    else:
        played = {"injected": injected, "faults": faults}[command]
        write(played(given[0], int(given[1]), int(given[2])), Path(given[3]))


if __name__ == "__main__":
    main(sys.argv[1:])
