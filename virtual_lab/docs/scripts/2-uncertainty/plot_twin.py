"""
Is the stated u of one laboratory right
=======================================

Each point is one laboratory. Its twin plays its day a thousand times, as its records state it. The
stated u is right if it equals the standard deviation of the errors of these days (line at 1).
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

folder = Path(vl.__file__).parents[1] / "tests" / "studies"
table = pd.read_csv(next(folder.glob("twin-*.csv"))).query("fault.isna()")
figure, axes = plt.subplots()
for (procedure, rows), marker in zip(table.groupby("procedure"), "os", strict=True):
    axes.plot(range(1, len(rows) + 1), rows["ratio"], marker, label=procedure)
axes.axhline(1, color="black", linestyle="--", linewidth=1)
axes.set(xlabel="laboratory", ylabel="stated u / standard deviation", ylim=(0, 2))
axes.legend(loc="lower right")
