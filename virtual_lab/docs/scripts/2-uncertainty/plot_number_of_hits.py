"""
How many hits are enough
========================

Standard uncertainty u of the bat performance factor (BPF) of R161 in one laboratory (others state
another u). The part of the hits falls roughly as 1/√n (each point is a new simulation and
scatters). From about 16 hits on the other components are larger, and more hits gain little.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

rules, hits = vl.procedure("astm-f1881"), (6, 12, 24, 48, 96)
tests = [
    vl.certify("r161", procedure=rules.with_(valid_hits=n, attempts=3 * n), seed=7) for n in hits
]
shared = [test.budget["contribution"][1:].pow(2).sum() ** 0.5 for test in tests]
figure, axes = plt.subplots()
axes.semilogx(hits, [1e3 * test.u for test in tests], marker="o", label="result")
axes.plot(hits, [1e3 * test.budget["contribution"][0] for test in tests], label="part of the hits")
axes.plot(hits, [1e3 * each for each in shared], marker="s", label="all other components")
axes.set(xlabel="number of valid hits", ylabel="u of BPF, in 0.001", xticks=hits, xticklabels=hits)
axes.minorticks_off()
axes.legend()
