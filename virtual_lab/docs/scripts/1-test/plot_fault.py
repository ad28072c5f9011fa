"""
A fault and how it shows
========================

Misfit of the encoder record of each shot (usual: of a good record). Without a
fault, six hits are enough. With a coupling that slips, none of the 12 allowed
shots is valid. The seven shots in which it slips are above 12. The other five
are near 2, because all records are fitted together.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl
from virtual_lab.measurement.reduction.rate import MOST_MISFIT

figure, axes = plt.subplots()
cases = (
    ("no fault", {}, -0.2, ""),
    ("slipping coupling", {"faults": "encoder-slip"}, 0.2, "//"),
)
for label, fault, shift, hatch in cases:
    test = vl.certify("r161", seed=7, **fault)
    misfit = test.certification.readings.recoil.misfit
    numbers = np.arange(1, misfit.size + 1) + shift
    words = f"{label}: {test.verdict}"
    axes.bar(numbers, misfit, 0.4, hatch=hatch, ec="white", label=words)
axes.axhline(MOST_MISFIT, color="black", linestyle="--", label="limit")
axes.set(xlabel="shot number", ylabel="misfit / usual misfit")
axes.set(yscale="log", ylim=(0.8, 90))
axes.legend()
