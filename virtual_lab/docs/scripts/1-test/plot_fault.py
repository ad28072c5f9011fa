"""
A fault and how it shows
========================

The coupling of the encoder slips at the hit. Each bar says how far an encoder record is from a
smooth turn with a ringing bat, in its noise. No record of the faulty test fits, and it is INVALID.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

figure, axes = plt.subplots()
cases = (("sound", {}, -0.2, ""), ("slipping", {"faults": "encoder-slip"}, 0.2, "//"))
for label, fault, shift, hatch in cases:
    test = vl.certify("r161", seed=7, **fault)
    misfit = test.certification.readings.recoil.misfit
    numbers = np.arange(1, misfit.size + 1) + shift
    words = f"{label}: {test.verdict}"
    axes.bar(numbers, misfit, 0.4, hatch=hatch, edgecolor="white", label=words)
axes.set(xlabel="number of the shot", ylabel="misfit, in noise", yscale="log", ylim=(0.8, 50))
axes.legend()
