"""
A fault and how it shows
========================

Misfit of each encoder record, divided by the misfit expected of a good record. A coupling that
slips at the hit takes every misfit above the limit. After twelve invalid shots the test is INVALID.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl
from virtual_lab.measurement.reduction.rate import MOST_MISFIT

figure, axes = plt.subplots()
cases = (("no fault", {}, -0.2, ""), ("slipping coupling", {"faults": "encoder-slip"}, 0.2, "//"))
for label, fault, shift, hatch in cases:
    test = vl.certify("r161", seed=7, **fault)
    misfit = test.certification.readings.recoil.misfit
    numbers = np.arange(1, misfit.size + 1) + shift
    words = f"{label}: {test.verdict}"
    axes.bar(numbers, misfit, 0.4, hatch=hatch, edgecolor="white", label=words)
axes.axhline(MOST_MISFIT, color="black", linestyle="--", label="limit")
axes.set(xlabel="shot number", ylabel="misfit / expected misfit", yscale="log", ylim=(0.8, 90))
axes.legend()
