"""The operating characteristic compared with counts of bats that have the metric.

    python -m tests.studies.operating OUT.CSV

Twenty variants of ea70 (hoop frequency) near a limit of .537 by bbcor, 5 000 tests each in
separate laboratories, compared with the errors of the middle one in 20 000 laboratories. (No hoop
frequency gives this bat less than .504, so none of its variants is at the limit of the rules.)
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

import virtual_lab as vl
from virtual_lab.output.progress import quiet

MIDDLE, SPAN, BATS = 3000, 75, 20  # Hz
LIMIT = 0.537
TESTS, MODEL, SEED = 5_000, 20_000, 4_000


def errors(frequency: float, laboratories: int, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the errors, a mask of valid tests, and the mean true metric of a variant."""
    bat = vl.bat("ea70").with_({"body.hoop.frequency": f"{frequency:.6g} Hz"})
    found = vl.sweep(
        bat, procedures=["bbcor"], laboratories=laboratories, seed=seed, progress=quiet
    )
    valid = (found["verdict"] != "INVALID").to_numpy()
    return found["error"].to_numpy(), valid, float(found["true"].mean())


def main(path: str) -> None:
    error, sound, _ = errors(MIDDLE, MODEL, SEED)
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        out.writerow(["frequency_Hz", "true", "counted", "low", "high", "predicted", "error_sd"])
        for number, frequency in enumerate(np.linspace(MIDDLE - SPAN, MIDDLE + SPAN, BATS)):
            own, valid, true = errors(frequency, TESTS, SEED + 1 + number)
            passed = int(np.sum(valid & (true + own <= LIMIT)))
            band = binomtest(passed, TESTS).proportion_ci(0.95, method="exact")
            predicted = float(np.mean(sound & (true + error <= LIMIT)))
            row = passed / TESTS, band.low, band.high, predicted, np.nanstd(own[valid])
            out.writerow([round(float(frequency), 2), f"{true:.6f}", *(f"{x:.5g}" for x in row)])
            file.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
