"""
How many hits are enough
========================

Standard uncertainty u of the bat performance factor (BPF) of R161 in one
laboratory (others state another u). The part of the hits falls roughly as 1/√n
(each point is a new simulation and scatters). From about 16 hits on the other
components are larger, and more hits gain little.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

rules, hits = vl.procedure("astm-f1881"), (6, 12, 24, 48, 96)
parts = []
for n in hits:
    more = rules.with_(valid_hits=n, attempts=3 * n)
    test = vl.certify("r161", procedure=more, seed=7)
    of_hits, *others = 1e3 * test.budget["contribution"]
    parts.append((1e3 * test.u, of_hits, np.linalg.norm(others)))
result, of_hits, shared = np.transpose(parts)
figure, axes = plt.subplots()
axes.semilogx(hits, result, marker="o", label="result")
axes.plot(hits, of_hits, label="part of the hits")
axes.plot(hits, shared, marker="s", label="all other components")
axes.set(xlabel="number of valid hits", ylabel="u of BPF, in 0.001")
axes.set_xticks(hits, hits)
axes.minorticks_off()
axes.legend()
