"""
How many hits are enough
========================

Standard uncertainty of the result over the number of valid hits, one laboratory. The part of the
hits falls with the root of their number, until what all hits share is left.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

rules, hits = vl.procedure("astm-f1881"), (6, 12, 24, 48, 96)
tests = [
    vl.certify("r161", procedure=rules.with_(valid_hits=n, attempts=3 * n), seed=7) for n in hits
]
shared = [test.budget["contribution"][1:].pow(2).sum() ** 0.5 for test in tests]
figure, axes = plt.subplots()
axes.semilogx(hits, [1e3 * test.u for test in tests], marker="o", label="u of the result")
axes.plot(hits, [1e3 * test.budget["contribution"][0] for test in tests], label="of the hits")
axes.plot(hits, [1e3 * each for each in shared], marker="s", label="of all else")
axes.set(xlabel="number of valid hits", ylabel="u of BPF, 0.001", xticks=hits, xticklabels=hits)
axes.minorticks_off()
axes.legend()
