"""
What a faster model costs a result
==================================

Change of a result, in its standard uncertainty u, against the finest model of each part (0.08 to
1.5 s, not drawn). Filled: used in studies. Dotted: 0.1 u, the largest change we accept. Exception:
first order, because its intervals hold their coverage.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(DATA / "uncertainty/laboratory.csv")
table = table[table["rms"] > 1e-6]
figure, axes = plt.subplots(figsize=(4.8, 3.8))
for k, (_, row) in enumerate(table.iterrows()):
    axes.loglog(row["ms"], row["rms"], "o", color="C0", mfc="C0" if row["shipped"] else "none")
    va = "bottom" if k in (1, 3, 5, 6) else "top"
    side = {"ha": "right" if row["ms"] > 10 else "left", "va": va}
    axes.text(row["ms"], row["rms"], f"  {row['part']}: {row['rung']}  ", fontsize=7.2, **side)
axes.axhline(0.1, color="black", linewidth=1, linestyle=":")
axes.set(xlabel="time per laboratory, ms", ylabel="rms change of the result, u", ylim=(1e-3, 30))
