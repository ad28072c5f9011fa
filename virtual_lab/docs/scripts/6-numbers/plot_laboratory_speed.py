"""
What a faster model costs a result
==================================

Each number: a part of a test by ASTM F1881 (5: filmed BBCOR hit) has a simpler model, without light
edges (3), encoder counts (4) or frames (5). Studies use 2, 3, 4 and 6. First order (6) exceeds the
limit, so its coverage was tested. Second order (7) takes 94 times as long and is no better.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(DATA / "uncertainty/laboratory.csv")
base = table.groupby("part")["ms"].transform("last")
words = ["rigid bat", "collision table", "gate times drawn directly", "bat rates drawn directly"]
words += ["ball positions drawn directly", "interval: first order", "interval: second order"]
figure, axes = plt.subplots(figsize=(4.8, 4.6))
for k, (at, row) in enumerate(table.query("rms > 1e-6 and rung != 'modal'").iterrows()):
    axes.loglog(row.ms / base[at], row.rms, "C0", ls="", marker=f"${k + 1}$", ms=8, label=words[k])
axes.axhline(0.1, color="k", lw=1, linestyle=":", label="limit for use in studies (0.1 u)")
axes.axvline(1, color="0.6", zorder=1, label="finest model of each part")
axes.set(xlabel="run time / run time of finest model", ylabel="rms change of result / u")
figure.legend(loc="outside upper left")
