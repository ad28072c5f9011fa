"""Laboratories played from a tester's sheets, against the sheets recovered from their records.

python -m tests.studies.own_laboratory scatter LABORATORIES
python -m tests.studies.own_laboratory rms LABORATORIES
python -m tests.studies.own_laboratory budget
"""

import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

import virtual_lab as vl
from virtual_lab import catalog
from virtual_lab.catalog.reading import Key
from virtual_lab.lab import RoundRobin, TestSetup
from virtual_lab.sheets import sheets_in, toml_text
from virtual_lab.studies.own_laboratory.ball import PLACES, with_scatter
from virtual_lab.studies.plan.sample import SampledTests

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


def scatter(laboratories: int, procedure: str = "bbcor") -> None:
    """Print how often the 95 % interval of each recovered scatter contains that of the sheet."""
    inside: dict[str, list[bool]] = defaultdict(list)
    for seed in range(8100, 8100 + laboratories):
        with tempfile.TemporaryDirectory() as place:
            folder = write_tester(Path(place) / "tester", procedure, seed)
            ours = vl.laboratory(play(folder, procedure, seed))
            true = {
                (kind, name, each.key): each.value
                for (kind, name), text in texts_of(folder).items()
                for each in catalog.datums(vl.Sheet(kind, name, text).document)
            }
            for row in ours.rows:
                if row.low is not None and row.high is not None:
                    kind, name = row.sheet.split("/")
                    name = name.removesuffix("-ball-wall").removesuffix(f"-{procedure}")
                    name = "ball-cannon" if name.startswith("ball-cannon") else name
                    value = true[kind, name, row.key]
                    inside[f"{row.sheet} {row.key}"].append(row.low <= value <= row.high)
    for key, each in inside.items():
        print(f"{100 * np.mean(each):5.1f} % of {len(each)}  {key}")
    every = [each for key, values in inside.items() if "jitter" not in key for each in values]
    print(f"{100 * np.mean(every):5.1f} % of {len(every)}  all without jitter")


def rms_u(folder: Path, bat: str, procedure: str, tests: int = 1000) -> float:
    """Return the rms of u over simulated tests in the laboratory of a folder."""
    with catalog.sheets_in_place(texts_of(folder)):
        sample = SampledTests.of(RoundRobin.of(bat, procedure), tests, 77)
    return float(np.sqrt(np.mean(sample.u[sample.has_result] ** 2)))


def rms(laboratories: int) -> None:
    """Print rms of u by recovered sheets of five folders, divided by that of the tester's."""
    for procedure in ("astm-f1881", "bbcor"):
        ratios = []
        for seed in range(8200, 8200 + laboratories):
            with tempfile.TemporaryDirectory() as place:
                folder = write_tester(Path(place) / "tester", procedure, seed)
                ours = vl.laboratory(play(folder, procedure, seed, days=5))
                ours.save(Path(place) / "ours")
                ratios.append(
                    rms_u(Path(place) / "ours", "r161", procedure)
                    / rms_u(folder, "r161", procedure)
                )
            print(procedure, seed, f"{ratios[-1]:.3f}", flush=True)
        error = np.std(ratios, ddof=1) / np.sqrt(len(ratios))
        print(f"{procedure}: mean {np.mean(ratios):.3f} ± {error:.3f}", flush=True)


def budget() -> None:
    """Print median and rms of type B lines in recovered laboratories, per line of certificates."""
    for procedure, seed in (("astm-f1881", 1), ("bbcor", 2), ("ncaa-besr", 3), ("bbcor", 4)):
        with tempfile.TemporaryDirectory() as place:
            tested = vl.certify("r161", procedure=procedure, seed=seed)
            result = tested.save(Path(place) / "day")
            ours = vl.laboratory(result).save(Path(place) / "ours")
            _compare(tested, ours, procedure, seed)


def _compare(tested: vl.Certificate, folder: Path, procedure: str, seed: int) -> None:
    with catalog.sheets_in_place(texts_of(folder)):
        sample = SampledTests.of(RoundRobin.of("r161", procedure), 1000, 77)
    squares = sample.squares[sample.has_result]
    medians, means = (
        dict(zip(sample.names, np.sqrt(each).tolist(), strict=True))
        for each in (np.median(squares, axis=0), squares.mean(axis=0))
    )
    metric = tested.certification.metric
    assert metric is not None
    for part in metric.components:
        if part.evaluation == "B" and part.contribution > 0.02 * metric.u:
            name = part.pool or part.name
            ratios = [each[name] / part.contribution for each in (medians, means)]
            print(f"{procedure} {seed}: {ratios[0]:5.2f} {ratios[1]:5.2f}  {name}", flush=True)


if __name__ == "__main__":
    study, *numbers = sys.argv[1:]
    {"scatter": scatter, "rms": rms, "budget": budget}[study](*map(int, numbers))
