"""Laboratories played from a tester's sheets, against the sheets recovered from their records.

    python -m tests.studies.own_laboratory scatter PROCEDURE SEED LABORATORIES OUT.CSV
    python -m tests.studies.own_laboratory rms PROCEDURE SEED LABORATORIES OUT.CSV
    python -m tests.studies.own_laboratory budget PROCEDURE SEED LABORATORIES OUT.CSV
    python -m tests.studies.own_laboratory foreign PROCEDURE SEED LABORATORIES OUT.CSV
    python -m tests.studies.own_laboratory table OUT.CSV

Each study appends its rows to the file, one laboratory per seed, the first of which is SEED.
`scatter`: a scatter of the recovered sheets with its 95 % interval, and that of the tester's sheet.
`rms`: rms of u over 1 000 tests by sheets recovered from five folders, and by those of the tester.
`budget`: a type B line above 2 % of u, as rms over 1 000 tests by sheets recovered from a test in
the laboratory of the catalog, and in the certificate of this test; low, high: 95 % of these tests.
`foreign`: the same, of records of another laboratory that describes its rigs in its own words.
A laboratory is left out if the procedure rejects the mean ball of its records. `table` prints the
lines of the page.
"""

import csv
import re
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import virtual_lab as vl
from virtual_lab import catalog
from virtual_lab.catalog.reading import Key
from virtual_lab.lab import RoundRobin, TestSetup
from virtual_lab.records.origin import Supplied
from virtual_lab.records.session import pack
from virtual_lab.sheets import sheets_in, toml_text
from virtual_lab.studies.own_laboratory.ball import PLACES, with_scatter
from virtual_lab.studies.own_laboratory.own_laboratory import OwnNumber
from virtual_lab.studies.plan.sample import SampledTests

FIELDS = ("study", "procedure", "seed", "quantity", "recovered", "low", "high", "tester")
Row = tuple[str, float, float | None, float | None, float]  # the last five fields
DENSITY_U = "density_u"  # a larger one gives air that no barometer shows
SCALED = ("_u", "_scatter", "_jitter", "repeatability")  # endings of the keys that are scaled


def write_tester(folder: Path, procedure: str, seed: int) -> Path:
    """Write a laboratory whose every u and scatter is 0.5 to 2 times that of the catalog."""
    chance = np.random.default_rng(seed)
    setup = TestSetup.of("r161", procedure=procedure)
    rigs = setup.rigs.values()
    names = dict.fromkeys(name for rig in rigs for name in catalog.rig_instruments(rig).values())
    sheets = [*map(vl.rig, rigs), *map(vl.instrument, names)]
    for sheet in sheets:
        scaled = {
            each.key: each.value * float(np.exp(chance.uniform(-np.log(2), np.log(2))))
            for each in sheet.datums
            if each.key.endswith(SCALED) and each.key != DENSITY_U
        }
        (folder / sheet.kind).mkdir(parents=True, exist_ok=True)
        sheet.with_(scaled).save(folder / sheet.kind / f"{sheet.name}.toml")
    ball = vl.ball(setup.rules.spec.ball)
    scatters = {each: 0.0037 * float(np.exp(chance.uniform(-0.69, 0.69))) for each in PLACES}
    text = toml_text(with_scatter(ball.document, scatters))
    (folder / "balls").mkdir()
    vl.Sheet("balls", ball.name, text).save(folder / f"balls/{ball.name}.toml")
    return folder


def texts_of(folder: Path) -> dict[Key, str]:
    """Return the texts of a laboratory's sheets."""
    return {(each.kind, each.name): each.text for each in sheets_in(folder)}


def play(folder: Path, procedure: str, seed: int, days: int = 1, bat: str = "r161") -> list[Path]:
    """Return the result folders of tests in the laboratory of a folder."""
    results = [folder.parent / f"{folder.name}-{procedure}-{day}" for day in range(1, days + 1)]
    for day, result in enumerate(results, start=1):
        tested = vl.certify(bat, procedure=procedure, seed=seed, test=day, laboratory=folder)
        tested.save(result)
    return results


def scatter(procedure: str, seed: int, place: Path) -> Iterator[Row]:
    """Yield each scatter that the recovered sheets state with an interval."""
    folder = write_tester(place / "tester", procedure, seed)
    ours = vl.laboratory(play(folder, procedure, seed))
    true = {
        (kind, name, each.key): each.value
        for (kind, name), text in texts_of(folder).items()
        for each in catalog.datums(vl.Sheet(kind, name, text).document)
    }
    for row in ours.rows:
        if row.low is not None:
            kind, name = sheet_of(row).split("/")
            quantity = f"{row.sheet} {row.key}"
            yield quantity, row.ours, row.low, row.high, true[kind, name, row.key]


def sheet_of(row: OwnNumber) -> str:
    """Return the sheet of a number in the laboratory that was played; two rigs share a cannon."""
    return re.sub("-cannon-(ball-wall|ball-cannon|astm-pivot)$", "-cannon", row.sheet)


def sample_in(folder: Path, procedure: str, tests: int = 1000, seed: int = 77) -> SampledTests:
    """Return simulated tests with a result in the laboratory of a folder."""
    with catalog.sheets_in_place(texts_of(folder)):
        sample = SampledTests.of(RoundRobin.of("r161", procedure), tests, seed)
    return sample.select(sample.has_result)


def rms_u(folder: Path, procedure: str) -> float:
    """Return the rms of u over simulated tests in the laboratory of a folder."""
    return float(np.sqrt(np.mean(sample_in(folder, procedure).u ** 2)))


def rms(procedure: str, seed: int, place: Path) -> Iterator[Row]:
    """Yield the rms of u by recovered sheets and by the tester's."""
    folder = write_tester(place / "tester", procedure, seed)
    vl.laboratory(play(folder, procedure, seed, days=5)).save(place / "ours")
    yield "u", rms_u(place / "ours", procedure), None, None, rms_u(folder, procedure)


def budget(procedure: str, seed: int, place: Path, *, foreign: bool = False) -> Iterator[Row]:
    """Yield the large type B lines in a recovered laboratory, and in the certificate."""
    tested = vl.certify("r161", procedure=procedure, seed=seed)
    session = tested.certification.session
    if foreign:
        rigs = {stage: f"{name}, hall 2" for stage, name in session.rigs.items()}
        session = replace(session, rigs=rigs, origin=Supplied(laboratory="Crosstown", customer=""))
    (place / "day").mkdir()
    pack(session).write(place / "day")
    sample = sample_in(vl.laboratory(place / "day").save(place / "ours"), procedure)
    metric = tested.certification.metric
    assert metric is not None
    for part in metric.components:
        if part.evaluation == "B" and part.contribution > 0.02 * metric.u:
            name = part.pool or part.name
            line = np.sqrt(sample.squares[:, sample.names.index(name)])
            low, high = np.quantile(line, (0.025, 0.975)).tolist()
            yield name, float(np.sqrt(np.mean(line**2))), low, high, part.contribution


def table(path: Path) -> list[str]:
    """Return the lines of the page, one per study and procedure."""
    rows = list(csv.DictReader(path.read_text().splitlines()))
    lines = []
    for study, procedure in dict.fromkeys((row["study"], row["procedure"]) for row in rows):
        ours = [row for row in rows if (row["study"], row["procedure"]) == (study, procedure)]
        if study == "scatter":
            ours = [row for row in ours if "jitter" not in row["quantity"]]
            inside = [
                float(each["low"]) <= float(each["tester"]) <= float(each["high"]) for each in ours
            ]
            found = f"{100 * np.mean(inside):.0f} % inside their interval"
        else:
            ratios = np.array([float(row["recovered"]) / float(row["tester"]) for row in ours])
            near = np.sum(np.abs(ratios - 1) <= 0.1)
            error = ratios.std(ddof=1) / np.sqrt(ratios.size)
            found = f"{ratios.mean():.2f} ± {error:.2f}, {near} within 10 %"
            if ours[0]["low"]:
                inside = [
                    float(each["low"]) <= float(each["tester"]) <= float(each["high"])
                    for each, ratio in zip(ours, ratios, strict=True)
                    if abs(ratio - 1) > 0.1
                ]
                found += f", {sum(inside)} of {len(inside)} others as on one of the days"
        laboratories = len({row["seed"] for row in ours})
        lines.append(f"| {study} | `{procedure}` | {laboratories} | {len(ours)} | {found} |")
    return lines


def main(study: str, procedure: str, first: int, laboratories: int, out: Path) -> None:
    """Append the rows of a study to a file."""
    is_new = not out.exists()
    with out.open("a", newline="") as file:
        written = csv.writer(file, lineterminator="\n")
        if is_new:
            written.writerow(FIELDS)
        for seed in range(first, first + laboratories):
            with tempfile.TemporaryDirectory() as place:
                try:
                    rows = list(STUDIES[study](procedure, seed, Path(place)))
                except vl.InputError as refused:
                    print(procedure, seed, refused)
                    continue
            for quantity, *numbers in rows:
                shown = ("" if each is None else f"{each:.5g}" for each in numbers)
                written.writerow((study, procedure, seed, quantity, *shown))
            file.flush()


STUDIES = {
    "scatter": scatter,
    "rms": rms,
    "budget": budget,
    "foreign": partial(budget, foreign=True),
}

if __name__ == "__main__":
    if sys.argv[1] == "table":
        print("\n".join(table(Path(sys.argv[2]))))
    else:
        main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), Path(sys.argv[5]))
