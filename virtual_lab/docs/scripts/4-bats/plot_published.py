"""
Published measurements beside ours
==================================

Our result over the published number, for each number that is not an input of ours. Circles agree
within what is known; `virtual-lab reference` explains each other one.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = vl.reference().table
table["value"] = pd.to_numeric(table["value"], errors="coerce")
table = table[(table["role"] == "prediction")].dropna(subset=["result", "value"])
ratio = (table["result"] / table["value"]).sort_values()
place = pd.Series(range(1, ratio.size + 1), ratio.index)
figure, axes = plt.subplots()
axes.axvline(1, color="black", linewidth=1)
for marker, (verdict, rows) in zip("osx^D", table.groupby("verdict"), strict=False):
    axes.plot(ratio[rows.index], place[rows.index], marker, mfc="none", label=verdict)
axes.set(xlabel="our result over the published number", ylabel="published numbers, sorted")
axes.legend()
