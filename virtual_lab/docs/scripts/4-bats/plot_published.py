"""
Published measurements compared with ours
=========================================

Ratio of our result to the published number, where the number is not an input of ours. A bar is the
range in which we accept a result. `virtual-lab reference` gives the reason of each disagreement.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = vl.reference().table
table["published"] = pd.to_numeric(table["published"], errors="coerce")
table = table[(table["role"] == "prediction")].dropna(subset=["value", "published"])
ratio = (table["value"] / table["published"]).sort_values()
place = pd.Series(range(1, ratio.size + 1), ratio.index)
figure, axes = plt.subplots()
ends = table[["agreement_low", "agreement_high"]].div(table["published"], axis=0).T
axes.plot(ends[ratio.index], [place, place], "-", color="0.8", linewidth=4, zorder=0)
for marker, (verdict, rows) in zip("osx^D", table.groupby("agreement"), strict=False):
    axes.plot(ratio[rows.index], place[rows.index], marker, mfc="none", label=verdict)
axes.set(xlabel="our result / published number", ylabel="published numbers, sorted", xlim=(0, 2))
axes.legend()
