"""Coverage by tenths of u and of degrees of freedom, for every procedure.

    python -m tests.studies.coverage PROCEDURE LABORATORIES HISTORY OUT.CSV
    python -m tests.studies.coverage picture OUT.PNG

The bat is r161, or softball-34 for `asa`. Instruments record only summary values; HISTORY earlier
tests per laboratory count. Results of blocks stay in a folder beside the table, from which an
interrupted run continues. The picture shows the stored tables.
"""

from __future__ import annotations

import csv
import pickle
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from virtual_lab.files import whole_file
from virtual_lab.files.tables import write_csv
from virtual_lab.lab import RoundRobin
from virtual_lab.output.style import page_figure
from virtual_lab.studies.coverage import coverage_table, plot_tenths, sample

HERE = Path(__file__).parent
SEED, BLOCK = 1, 768  # laboratories per block
TABLES = {"coverage-*.csv": "this test alone", "history-*.csv": "with ten earlier tests"}
TENTHS = {
    "coverage_by_u": "tenths by u, smallest first",
    "coverage_by_dof": "tenths by ν, fewest first",
}
FEWEST = 4_000  # laboratories, so that a tenth is known to a percent


def bat_of(procedure: str) -> str:
    return "softball-34" if procedure == "asa" else "r161"


def rows_of(pattern: str) -> dict[str, dict[str, Any]]:
    """Return the stored rows of the metric by procedure, for studies by tenths."""
    (path,) = HERE.glob(pattern)
    with path.open(encoding="utf-8") as lines:
        rows = [row for row in csv.DictReader(lines) if row["quantity"] == "metric"]
    known = [row for row in rows if row["coverage_by_u_1"] and int(row["laboratories"]) > FEWEST]
    return {row["procedure"]: row for row in known}


def tenths(row: dict[str, Any], key: str) -> list[float]:
    return [float(row[f"{key}_{number}"]) for number in range(1, 11)]


def draw(path: str) -> None:
    with page_figure(5.4) as figure:
        panels = figure.subplots(2, 2, sharex=True, sharey=True)
        for across, (pattern, said) in zip(panels, TABLES.items(), strict=True):
            for axes, (key, words) in zip(across, TENTHS.items(), strict=True):
                axes.axhspan(94, 96, color="0.9", linewidth=0)
                axes.axhline(90, color="0.5", linewidth=0.6)
                rows = rows_of(pattern)
                plot_tenths(axes, {name: tenths(row, key) for name, row in rows.items()})
                axes.set_title(f"{said}: {words}")
            across[0].set_ylabel("intervals with the true value, %")
        named = panels[0, 0].get_legend_handles_labels()
        figure.legend(*named, loc="outside lower center", ncols=6)
    figure.savefig(path)


def main(procedure: str, laboratories: str, history: str, path: str) -> None:
    bat = bat_of(procedure)
    rules = replace(RoundRobin.of(bat, procedure), history=int(history))
    kept = Path(path).with_suffix("")
    kept.mkdir(parents=True, exist_ok=True)
    for first in range(0, int(laboratories), BLOCK):
        file = kept / f"{first:06}.pkl"
        if not file.exists():
            (block,) = rules.blocks(min(BLOCK, int(laboratories) - first), SEED, first)
            with whole_file(file) as draft:
                draft.write(pickle.dumps(sample(block)))
    samples = [pickle.loads(file.read_bytes()) for file in sorted(kept.glob("*.pkl"))]
    write_csv(coverage_table(samples, bat, procedure, SEED).table, Path(path))


if __name__ == "__main__":
    if sys.argv[1] == "picture":
        draw(sys.argv[2])
    else:
        main(*sys.argv[1:])
