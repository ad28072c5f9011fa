"""
Is the stated u of a laboratory right?
======================================

A twin repeats the test of a laboratory a thousand times, with the instruments
and scatter that its records state. The standard deviation of its errors should
be the u that the laboratory states: ratio 1 (below 1: u is too small; each ± 4
%). Of the ratios, 95 % are between 0.8 and 1.2, and the largest is 1.8. All
laboratories are simulated, have no fault and test bats of model R161.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(next(DATA.parent.glob("tests/studies/twin-*.csv")))
table = table[table["fault"].isna()]
figure, panels = plt.subplots(2, 1, sharex=True)
for axes, (key, rows) in zip(panels, table.groupby("procedure"), strict=True):
    axes.hist(rows["ratio"], np.arange(0.6, 2, 0.05), edgecolor="white")
    axes.axvline(1, color="black", linestyle="--")
    name = key.replace("-", " ").upper()
    axes.set(title=f"{name}, {len(rows)} laboratories", ylabel="laboratories")
panels[-1].set(xlabel="stated u / standard deviation of the errors of the twin")
