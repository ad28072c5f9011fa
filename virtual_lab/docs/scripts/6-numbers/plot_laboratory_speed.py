"""
What a faster model costs a result
==================================

Change of a result in u (standard uncertainty) against the finest model of each part (not drawn).
Filled: used in studies. First order is used above 0.1 u because its intervals hold their coverage.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(Path(vl.__file__).parents[1] / "data" / "uncertainty" / "laboratory.csv")
table = table[table["rms"] > 1e-6]
figure, axes = plt.subplots(figsize=(4.8, 3.8))
for marker, (part, rows) in zip("o^vDP", table.groupby("part", sort=False), strict=True):
    (line,) = axes.loglog(rows["ms"], rows["rms"], marker, mfc="none", label=part)
    taken = rows[rows["shipped"] == 1]
    axes.plot(taken["ms"], taken["rms"], marker, color=line.get_color())
axes.axhline(0.1, color="black", linewidth=1, linestyle=":", label="0.1 u")
axes.set(xlabel="time per laboratory, ms", ylabel="rms change of the result, u", ylim=(1e-3, 30))
axes.legend(fontsize=8.5)
