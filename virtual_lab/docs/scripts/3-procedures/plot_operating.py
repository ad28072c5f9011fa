"""
Chance to pass near the limit
=============================

Chance that a bat passes BBCOR, for four variants each of R161 (another
modulus) and EA70 (another hoop frequency). Circles: counted in 3 000
laboratories each. Crosses: predicted by ``vl.operating``, which knows only the
design and the true metric.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(next(DATA.parent.glob("tests/studies/operating-*.csv")))
figure, axes = plt.subplots()
for color, (bat, rows) in zip(("C0", "C1"), table.groupby("bat"), strict=True):
    for marker, kind in (("o", "counted"), ("x", "predicted")):
        text = f"{bat}, {kind}"
        axes.plot(
            rows["true_value"], 100 * rows[kind], marker, c=color, label=text
        )
axes.axvline(0.5, color="black", linestyle=":", label="limit")
axes.set(xlabel="true BBCOR of the bat", ylabel="tests that pass, %")
axes.legend()
