"""
Published measurements compared with ours
=========================================

Ratio of our result to a published number that is not our input. Gray bars (cut at 0 and 2) are the
ranges in which we accept a result. `virtual-lab reference` explains each square outside its bar.
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
axes.plot(ends[ratio.index], [place, place], "-", c="0.8", lw=4, solid_capstyle="butt")
for marker, (verdict, rows) in zip("osx^D", table.groupby("agreement"), strict=False):
    axes.plot(ratio[rows.index], place[rows.index], marker, mfc="none", ms=4, label=verdict)
axes.set(xlabel="our result / published number", ylabel="published numbers, sorted", xlim=(0, 2))
axes.legend()
