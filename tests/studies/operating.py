"""Operating characteristics compared with counts of bats that have the metric.

    python -m tests.studies.operating OUT.CSV

Eight bats near the limit of bbcor, 3 000 tests each in separate laboratories: r161 with other
moduli, and ea70 with another hoop frequency. `operating` predicts their shares from laboratories of
another seed. The study names no bat to it, only the design and the true metric.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

import virtual_lab as vl
from virtual_lab.output.progress import quiet

LIMIT, TESTS, SEED = 0.5, 3_000, 4_000
MODULI = {"youngs_modulus": 16.521, "shear_modulus": 0.965}  # nominal elastic moduli of r161 [GPa]
BATS = {
    "r161": [
        {f"body.material.{key}": f"{factor * at:.6g} GPa" for key, at in MODULI.items()}
        for factor in (1.14, 1.27, 1.52, 1.8)
    ],
    "ea70": [{"body.hoop.frequency": f"{at} Hz"} for at in (9900, 9300, 7020, 6600)],
}


def main(path: str) -> None:
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["bat", "changed", "true_value", "counted", "predicted", "z", "errors_of"])
        for name, changes in BATS.items():
            counts = {}
            for number, changed in enumerate(changes):
                bat = vl.bat(name).with_(changed)
                about = {"laboratories": TESTS, "seed": SEED + number, "progress": quiet}
                tests = vl.sweep(bat, procedures=["bbcor"], **about)
                passed = tests["true_value"] + tests["error"] <= LIMIT
                counts[tests["true_value"].mean()] = (
                    (tests["verdict"] != "INVALID") & passed
                ).mean()
            predictions = vl.operating(
                name, procedures=["bbcor"], true=list(counts), laboratories=TESTS, progress=quiet
            )
            rows = [row for row in predictions if row.best_of == 1][-len(counts) :]
            for changed, (true, counted), row in zip(changes, counts.items(), rows, strict=True):
                predicted = row.pass_probability
                u = np.sqrt((counted * (1 - counted) + predicted * (1 - predicted)) / TESTS)
                stated = ", ".join(f"{key} {value}" for key, value in changed.items())
                shares = (f"{each:.5g}" for each in (counted, predicted, (predicted - counted) / u))
                out.writerow([name, stated, f"{true:.6f}", *shares, row.errors_of])
                file.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
