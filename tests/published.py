"""Published figures from random numbers: a row of `published.csv` each, checked with a second seed.

    python -m tests.published                   # run what has no second run yet, check all rows
    python -m tests.published renew [STUDY ...] # run the first seeds again, renew table and pages

A row has the figure with its standard error, the command that repeats it, and up to three runs,
each with seed and number of laboratories. The second and the third seed are in the table before
they are run; the third is run only where the first two differ by more than three standard errors.
If a study is renewed, its later runs are removed and get new seeds. The pages named in a row state
the figure as `printed`: ± is half of its 95 % interval. `tests/test_published.py` compares them.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from math import sqrt
from pathlib import Path

import numpy as np
from scipy.stats import chi2

import virtual_lab as vl
from tests.studies.coverage import bat_of
from virtual_lab.lab import RoundRobin
from virtual_lab.output.progress import quiet
from virtual_lab.studies.coverage import coverage_table, sample
from virtual_lab.studies.operating import POINTS

ROOT = Path(__file__).parents[1]
TABLE = Path(__file__).parent / "published.csv"
Figures = dict[str, tuple[float, float]]  # value and standard error by name


@dataclass(frozen=True)
class Run:
    """A run of a study; value and standard error are None before it is made."""

    size: int
    seed: int
    value: float | None = None
    error: float | None = None


@dataclass(frozen=True)
class Row:
    """A published figure."""

    study: str
    figure: str
    command: str
    pages: tuple[str, ...]
    form: str  # format of the value; a percentage is in %
    alone: bool  # counts in the sum of z²; other figures of the study come from the same numbers
    runs: tuple[Run, Run, Run]

    @property
    def printed(self) -> str:
        value, error = self.runs[0].value, self.runs[0].error
        assert value is not None
        assert error is not None
        if self.form.endswith("%"):
            return f"{100 * value:{self.form[:-1]}f} ± {200 * error:{self.form[:-1]}f} %"
        return f"{value:{self.form}} ± {2 * error:{self.form}}"

    def z(self, number: int) -> float | None:
        """Return run `number` minus the first run in standard errors; None if it was not made."""
        first, other = self.runs[0], self.runs[number]
        if first.value is None or first.error is None or other.value is None or other.error is None:
            return None
        return (other.value - first.value) / sqrt(first.error**2 + other.error**2)


# Studies, each a function of seed and number of laboratories


def share(count: float, of: int) -> tuple[float, float]:
    """Return a share with its standard error, which is not 0 for a count of 0."""
    p = (count + 0.5) / (of + 1)
    return count / of, sqrt(p * (1 - p) / of)


def operating(procedure: str, seed: int, size: int) -> Figures:
    found = vl.operating(
        "ea70", procedures=[procedure], laboratories=size, seed=seed, progress=quiet
    )
    limit = found[0].limit
    figures: Figures = {}
    for over in (0, 1, 2):
        for best_of, words in ((1, "one test"), (3, "best of 3 tests")):
            p = next(
                row.pass_probability
                for row in found
                if row.best_of == best_of and abs(row.true_value / limit - 1 - over / 100) < 1e-9
            )
            figures[f"{words}, {over} % over"] = share(p * size, size)
        p, u = figures[f"one test, {over} % over"]
        figures[f"best of 3 laboratories, {over} % over"] = 1 - (1 - p) ** 3, 3 * (1 - p) ** 2 * u
    one = [row for row in found if row.best_of == 1][:POINTS]
    true, passes = np.array([[row.true_value, row.pass_probability] for row in one]).T
    for accepted, words in zip(
        found.acceptance_limits[procedure], ("one test", "best of 3 laboratories"), strict=True
    ):
        risk = np.interp(2 * limit - accepted, true, passes)
        slope = -np.interp(2 * limit - accepted, true, np.gradient(passes, true))
        u = float(sqrt(risk * (1 - risk) / size) / slope)
        figures[f"limit of acceptance, {words}"] = accepted, u
        figures[f"guard band, {words}"] = limit - accepted, u
    return figures


def critique(first: str, second: str, procedure: str, seed: int, size: int) -> Figures:
    """Return the share of results in the opposite order, in one laboratory and in two."""
    found = vl.critique(
        first, second, procedures=[procedure], swings=[0.3], laboratories=size, seed=seed
    )
    (row,), (one, other) = found.pairs, found.ranked[0].measured.T
    figures: Figures = {}
    for words, against in (("in one laboratory", other), ("in two", np.roll(other, 1))):
        differences = (one - against)[np.isfinite(one - against)]
        opposite = np.sum(differences * row.batted_speed_difference_mph < 0)
        figures[f"opposite order, {words}"] = share(float(opposite), differences.size)
    return figures


def hits(count: int, seed: int, size: int) -> Figures:
    """Return the median u of tests with a number of hits, and its standard error by ranks."""
    rules = vl.procedure("astm-f1881").with_(valid_hits=count, attempts=3 * count)
    table = vl.sweep("r161", procedures=[rules], laboratories=size, seed=seed, progress=quiet)
    u, rank = table["u"].dropna(), 0.5 / sqrt(size)
    ends = u.quantile([0.5 - rank, 0.5 + rank])
    return {"median u": (float(u.median()), float(ends.diff().iloc[-1] / 2))}


def cannon(seed: int, size: int) -> Figures:
    """Return the mean u of the laboratory, and with a cannon without errors along the bat."""
    perfect = vl.instrument("slow-cannon").with_(along_scatter="0 mm", along_u="0 mm")
    figures: Figures = {}
    for name, sheets in {"present": [], "perfect cannon": [perfect]}.items():
        u = vl.sweep("r161", laboratories=size, seed=seed, instruments=sheets, progress=quiet)["u"]
        figures[f"mean u, {name}"] = float(u.mean()), float(u.std() / sqrt(size))
    return figures


def weight(seed: int, size: int) -> Figures:
    """Return the share of individual R161 that bbcor would reject for their weight."""
    bat = vl.bat("r161").with_(construction="aluminum")  # wood is exempt
    more = {"laboratories": size, "seed": seed, "individual": True, "progress": quiet}
    reasons = vl.sweep(bat, procedures=["bbcor"], **more)["reason"]
    return {"too light": share(float(reasons.str.contains("minus weight").sum()), size)}


def coverage(procedure: str, seed: int, size: int) -> Figures:
    """Return coverage, bias, and the rms error; seed 1 is that of the stored table."""
    bat, kept = bat_of(procedure), {}
    if seed == 1:
        (path,) = (TABLE.parent / "studies").glob("coverage-*.csv")
        with path.open(encoding="utf-8") as lines:
            rows = [row for row in csv.DictReader(lines) if row["instruments"] == "summed"]
        kept = {row["quantity"]: row for row in rows if row["procedure"] == procedure}
    else:
        blocks = map(sample, RoundRobin.of(bat, procedure).blocks(size, seed))
        table = coverage_table([*blocks], bat, procedure, seed).table
        kept = {row["quantity"]: row for row in table.to_dict("records")}
    figures: Figures = {}
    for name in ("metric", "collision_efficiency"):
        held, of = float(kept[name]["coverage"]), int(kept[name]["laboratories"])
        figures[f"held, {name}"] = share(held * of, of)
    row = {key: float(kept["metric"][key]) for key in ("bias", "bias_se", "rms_error", "rms_u")}
    figures["bias, metric"] = row["bias"], row["bias_se"]
    # error of a root mean square of nearly normal errors
    figures["rms error, metric"] = row["rms_error"], row["rms_error"] / sqrt(2 * of)
    return figures


STUDIES: dict[str, Callable[[int, int], Figures]] = {
    "operating astm-f1881": partial(operating, "astm-f1881"),
    "critique bbcor": partial(critique, "barrel-loaded", "knob-loaded", "bbcor"),
    "critique ncaa-besr": partial(critique, "ea70", "knob-loaded", "ncaa-besr"),
    "cannon": cannon,
    "weight": weight,
    **{f"hits {count}": partial(hits, count) for count in (6, 12, 24)},
    **{
        f"coverage {name}": partial(coverage, name)
        for name in ("astm-f1881", "asa", "bbcor", "proposed", "ncaa-besr", "ncaa-modified")
    },
}


# Table, pages, and check

COLUMNS = [field.name for field in fields(Row)][:-1]


def read_rows(path: Path = TABLE) -> list[Row]:
    with path.open(encoding="utf-8", newline="") as lines:
        return [_row(cells) for cells in csv.DictReader(lines)]


def _row(cells: dict[str, str]) -> Row:
    runs = tuple(
        Run(
            size=int(cells[f"size_{k}"]),
            seed=int(cells[f"seed_{k}"]),
            value=float(cells[f"value_{k}"]) if cells[f"value_{k}"] else None,
            error=float(cells[f"error_{k}"]) if cells[f"error_{k}"] else None,
        )
        for k in (1, 2, 3)
    )
    pages = tuple(cells["pages"].split())
    texts = {key: cells[key] for key in ("study", "figure", "command", "form")}
    return Row(**texts, pages=pages, alone=cells["alone"] == "yes", runs=runs)  # type: ignore[arg-type]


def write_rows(rows: Sequence[Row], path: Path = TABLE) -> None:
    numbered = [f"{field.name}_{k}" for k in (1, 2, 3) for field in fields(Run)]
    with path.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow([*COLUMNS, *numbered])
        for row in rows:
            texts = [getattr(row, key) for key in COLUMNS]
            texts[COLUMNS.index("pages")] = " ".join(row.pages)
            texts[COLUMNS.index("alone")] = "yes" if row.alone else "no"
            cells = [each for run in row.runs for each in asdict(run).values()]
            out.writerow([*texts, *(f"{x:.6g}" if isinstance(x, float) else x for x in cells)])


def run_studies(rows: list[Row], number: int, names: Iterable[str]) -> list[Row]:
    """Return the rows with run `number` of the named studies. The table is written after each."""
    for name in names:
        own = [row for row in rows if row.study == name]
        run = own[0].runs[number]
        print(f"{name}: seed {run.seed}, {run.size} laboratories", flush=True)
        found = STUDIES[name](run.seed, run.size)
        for at, row in enumerate(rows):
            if row.study == name:
                value, error = found[row.figure]
                runs = list(row.runs)
                runs[number] = replace(runs[number], value=value, error=error)
                rows[at] = replace(row, runs=tuple(runs))
        write_rows(rows)
    return rows


def renew(names: Sequence[str]) -> None:
    """Run the first seed of studies again, remove later runs, and change table and pages."""
    rows = read_rows()
    names = names or list(dict.fromkeys(row.study for row in rows))
    latest = max(run.seed for row in rows for run in row.runs)
    seeds = {name: latest + 2 * at + 1 for at, name in enumerate(names)}
    before = {(row.study, row.figure): row for row in rows}
    for at, row in enumerate(rows):
        if row.study in seeds:
            first, second, third = row.runs
            later = (Run(second.size, seeds[row.study]), Run(third.size, seeds[row.study] + 1))
            rows[at] = replace(row, runs=(first, *later))
    for row in run_studies(rows, 0, names):
        old = before[row.study, row.figure]
        if row.study not in seeds or old.runs[0].value is None or old.printed == row.printed:
            continue
        for page in row.pages:
            path = ROOT / page
            text = path.read_text("utf-8")
            if text.count(old.printed) == 1:
                path.write_text(text.replace(old.printed, row.printed), "utf-8")
            else:
                print(f"{page}: {old.printed!r} occurs {text.count(old.printed)} times; edit it")


def faults(rows: Sequence[Row]) -> list[str]:
    """Return the faults of the second and third runs that were made."""
    wrong, squares = [], []
    for row in rows:
        second, third = row.z(1), row.z(2)
        where = f"{row.study}, {row.figure}"
        if second is None:
            continue
        if row.alone:
            squares.append(second**2)
        if abs(second) > 4:
            wrong.append(f"{where}: the second run is {second:+.1f} standard errors away")
        elif abs(second) > 3 and third is None:
            wrong.append(f"{where}: {second:+.1f} standard errors; the third run is missing")
        elif third is not None and abs(third) > 3:
            wrong.append(f"{where}: the third run is {third:+.1f} standard errors away")
    if squares:
        low, high = chi2.interval(0.95, len(squares))
        total = sum(squares)
        print(
            f"sum of z² of {len(squares)} figures {total:.1f}, 95 % range {low:.1f} to {high:.1f}"
        )
        if not low <= total <= high:
            wrong.append(f"the sum of z² is {total:.1f}, outside {low:.1f} to {high:.1f}")
    return wrong


def main(words: Sequence[str]) -> int:
    if words[:1] == ["renew"]:
        renew(words[1:])
        return 0
    rows = read_rows()
    rows = run_studies(rows, 1, dict.fromkeys(row.study for row in rows if row.z(1) is None))
    again = [row.study for row in rows if abs(row.z(1) or 0) > 3 and row.z(2) is None]
    rows = run_studies(rows, 2, dict.fromkeys(again))
    wrong = faults(rows)
    print("\n".join(wrong) or f"{len(rows)} figures agree with their second run")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
