"""
Methods of propagation: error and run time
==========================================

Error of the worse end of the 95 % interval / standard uncertainty u, for four
examples (lines). First order is fast, and good to 10 % of u for the bat and
the end gauge, not for the others. Monte Carlo has 65 536 trials at its first
triangle and eight times as many at each next one. The reference is Monte Carlo
with 134 million trials.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(f"{vl.__path__[0]}/docs/tables/methods.csv")
error = table[["low_error", "high_error"]].max(axis=1)
figure, axes = plt.subplots(figsize=(4.8, 4.2))
for model, rows in table.groupby("model", sort=False):
    name = model.replace("squares", "power meter")
    axes.plot(rows["ms"], error[rows.index], label=name)
methods = {"first order": "o", "second order": "s", "Monte Carlo": "^"}
for label, marker in methods.items():
    rows = table[table["method"] == label.lower().replace(" ", "-")]
    axes.plot(rows["ms"], error[rows.index], marker, color="0.3", label=label)
axes.set(xlabel="run time, ms", ylabel="error / u", xscale="log", yscale="log")
axes.legend(fontsize=8)
