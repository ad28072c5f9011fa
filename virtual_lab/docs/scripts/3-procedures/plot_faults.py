"""
Which faults are caught
=======================

Sixty laboratories per fault, tested by ASTM F1881. Most faults raise a flag in each laboratory. Six
raise no more flags than no fault at all, and three others are mostly missed.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

folder = Path(vl.__file__).parents[1] / "tests" / "studies"
table = pd.read_csv(next(folder.glob("faults-*.csv")))
table = table[(table.procedure == "astm-f1881")].sort_values("detected")
figure, axes = plt.subplots(figsize=(4.8, 6.4))
names = table["fault"].replace("none", "no fault").str.replace("-", " ")
axes.barh(names, 100 * table["detected"], color="C0")
axes.tick_params(axis="y", labelsize=8.5)
axes.margins(y=0.01)
axes.set(xlabel="laboratories with a flag, %", xlim=(0, 100))
