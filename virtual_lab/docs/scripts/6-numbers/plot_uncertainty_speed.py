"""
Methods of propagation: error and time
======================================

Error of the ends of the 95 % interval over the time of the evaluation. First order is quick and as
good as the model is straight; Monte Carlo buys digits with draws.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(Path(vl.__file__).parents[1] / "data" / "uncertainty" / "methods.csv")
table["error"] = table[["low_error", "high_error"]].max(axis=1)
figure, axes = plt.subplots()
marker = {"first-order": "o", "second-order": "s", "monte-carlo": "^"}
for k, (model, rows) in enumerate(table.groupby("model", sort=False)):
    for method, points in rows.groupby("method", sort=False):
        axes.loglog(points["ms"], points["error"], marker.get(method, "x"), color=f"C{k}")
    axes.plot([], [], "-", color=f"C{k}", label=model)
axes.set(xlabel="time, ms", ylabel="error of an end, in U")
axes.legend(title="circle 1st, square 2nd order, triangle draws", fontsize=8, title_fontsize=8)
