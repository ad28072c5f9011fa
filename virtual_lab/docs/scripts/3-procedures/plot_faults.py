"""
Which faults are caught
=======================

Sixty laboratories per fault test a bat by ASTM F1881. A flag is an invalid
test or a failed check of the records (shares ± 13 % at most). Most faults
raise a flag in each laboratory. Six raise no more flags than no fault at all,
and three others are mostly missed.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl
from virtual_lab.catalog.reading import DATA

table = pd.read_csv(next(DATA.parent.glob("tests/studies/faults-*.csv")))
table = table[table["procedure"] == "astm-f1881"].sort_values("detected")
titles = vl.shelf("faults").table.set_index("name")["title"]
names = table["fault"].map(titles).fillna("no fault")
figure, axes = plt.subplots(figsize=(4.8, 6.4))
axes.barh(names, 100 * table["detected"], color="C0")
axes.tick_params(axis="y", labelsize=8.5)
axes.margins(y=0.01)
axes.set(xlabel="laboratories with a flag, %", xlim=(0, 100))
