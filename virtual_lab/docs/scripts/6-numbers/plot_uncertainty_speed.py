"""
Methods of propagation: error and run time
==========================================

Error of an end of the 95 % interval, divided by the half-width U of the interval. First order is
fast, and good if the model is nearly linear. Monte Carlo gains accuracy with run time.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(DATA / "uncertainty/methods.csv")
error = table[["low_error", "high_error"]].max(axis=1)
colors = {model: f"C{k}" for k, model in enumerate(table["model"].unique())}
figure, axes = plt.subplots()
for method, marker in (("first-order", "o"), ("second-order", "s"), ("monte-carlo", "^")):
    axes.plot([], [], marker, color="0.5", label=method.replace("-", " ").title())
    rows = table[table["method"] == method]
    axes.scatter(rows["ms"], error[rows.index], 28, rows["model"].map(colors), marker=marker)
for model, color in colors.items():
    axes.plot([], [], "-", color=color, label=model.replace("squares", "power meter"))
axes.set(xlabel="run time, ms", ylabel="error / U", xscale="log", yscale="log")
axes.legend(fontsize=8)
