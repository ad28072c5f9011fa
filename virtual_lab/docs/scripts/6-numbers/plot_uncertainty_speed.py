"""
Methods of propagation: error and run time
==========================================

Error of an end of the 95 % interval, divided by its half-width U. One line per example. First order
is fast, and good to 10 % of U for the bat and the end gauge, poor for the others. Each triangle has
eight times as many trials as the triangle on its left.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(DATA / "uncertainty/methods.csv")
error = table[["low_error", "high_error"]].max(axis=1)
figure, axes = plt.subplots(figsize=(4.8, 4.2))
for model, rows in table.groupby("model", sort=False):
    axes.plot(rows["ms"], error[rows.index], label=model.replace("squares", "power meter"))
for method, marker in (("first-order", "o"), ("second-order", "s"), ("monte-carlo", "^")):
    rows = table[table["method"] == method]
    label = method.replace("-", " ").title()
    axes.plot(rows["ms"], error[rows.index], marker, color="0.3", label=label)
axes.set(xlabel="run time, ms", ylabel="error / U", xscale="log", yscale="log")
axes.legend(fontsize=8)
