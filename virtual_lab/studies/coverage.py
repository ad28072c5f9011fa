"""Attained coverage: how often, over many laboratories, the 95 % interval holds the truth."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from virtual_lab.certification import QUANTITIES
from virtual_lab.errors import InputError
from virtual_lab.lab import certify_bat

__all__ = ["coverage"]

Array = NDArray[np.float64]


def coverage(
    bat: str,
    *,
    procedure: str = "astm-f1881",
    laboratories: int = 1000,
    first_seed: int = 1,
    say: Callable[[str], None] = lambda _: None,
) -> list[dict[str, Any]]:
    """Certify one bat design in many laboratories and count intervals that hold the truth.

    Every laboratory draws its own bat, balls and calibration errors. The same seeds draw the
    same standardised errors for every bat, so two bats over the same seeds are one sample (their
    errors correlate by 0.98); take another `first_seed` for a second opinion.
    INVALID tests state no
    result and are counted apart.

    Returns
    -------
    list of dict
        A row a quantity: `laboratories` with a result, `invalid`, `coverage` with its
        Clopper-Pearson 95 % interval `low` to `high`, mean and standard deviation of the error
        in standard uncertainties (the mean with its standard error), and the root mean squares
        of the error and of the stated u: their ratio is 1 for an honest uncertainty, above 1
        for one that is too small.

    Raises
    ------
    InputError
        Unknown names, or fewer than 2 laboratories.
    """
    if laboratories < 2:
        raise InputError("", "laboratories", laboratories, "allowed: 2 and more")
    held: dict[str, list[bool]] = {name: [] for name in QUANTITIES}
    errors: dict[str, list[tuple[float, float]]] = {name: [] for name in QUANTITIES}
    invalid = 0
    for seed in range(first_seed, first_seed + laboratories):
        tested = certify_bat(bat, procedure=procedure, seed=seed)
        if tested.certification.verdict.value == "INVALID":
            invalid += 1
            continue
        for name, budget in tested.certification.quantities.items():
            true = tested.sealed.measurand[name]
            low, high = budget.interval_95
            held[name].append(low <= true <= high)
            errors[name].append((budget.value - true, budget.u))
        if (seed - first_seed + 1) % 100 == 0:
            say(f"{seed - first_seed + 1} of {laboratories} laboratories")
    return [
        {"bat": bat, "quantity": name, "invalid": invalid}
        | _row(np.array(held[name]), np.array(errors[name]))
        for name in QUANTITIES
    ]


def _row(held: NDArray[np.bool_], errors: Array) -> dict[str, Any]:
    count = binomtest(int(held.sum()), held.size).proportion_ci(0.95, "exact")
    error, u = errors.T
    z = error / u
    return {
        "laboratories": int(held.size),
        "coverage": float(held.mean()),
        "low": float(count.low),
        "high": float(count.high),
        "mean_z": float(z.mean()),
        "mean_z_se": float(z.std(ddof=1)) / sqrt(z.size),
        "sd_z": float(z.std(ddof=1)),
        "rms_error": sqrt(float((error**2).mean())),
        "rms_u": sqrt(float((u**2).mean())),
    }
