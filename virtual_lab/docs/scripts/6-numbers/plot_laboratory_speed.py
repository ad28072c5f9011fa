"""
What a cheaper model costs a result
===================================

Effect of each model on the result of a test, in u of the result, over its time per laboratory.
Filled: the model that the program takes. Below 0.1 u a better one changes nothing. (Motion: 1e-13.)
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(Path(vl.__file__).parents[1] / "data" / "uncertainty" / "laboratory.csv")
table = table[table["rms"] > 0]
figure, axes = plt.subplots(figsize=(4.8, 3.8))
for marker, (part, rows) in zip("os^vDP", table.groupby("part", sort=False), strict=True):
    (line,) = axes.loglog(rows["ms"], rows["rms"], marker, mfc="none", label=part)
    taken = rows[rows["shipped"] == 1]
    axes.plot(taken["ms"], taken["rms"], marker, color=line.get_color())
axes.axhline(0.1, color="black", linewidth=1, linestyle=":")
axes.set(xlabel="time per laboratory, ms", ylabel="rms change of the result, in u", ylim=(1e-3, 30))
axes.legend(fontsize=8.5)
