"""
Collision models: error and run time
====================================

Largest error of e_A in 400 collisions, relative to a model with 120 modes. Tests use the modal
model with its default of 20 modes (open triangle). Studies interpolate a table of it, the
surrogate.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(Path(vl.__file__).parents[1] / "data" / "figures" / "collision.csv")
table = table[(table.held_against == table.held_against[0]) & ~table.setting.str.contains("degree")]
figure, axes = plt.subplots(figsize=(4.8, 4.2))
for marker, (series, rows) in zip("os^D", table.groupby("series", sort=False), strict=True):
    axes.loglog(rows["us_a_shot"], rows["worst_error"], marker, label=series)
default = table[table["setting"] == "20 modes"]
axes.plot(default["us_a_shot"], default["worst_error"], "^", color="white", markersize=3)
axes.set(xlabel="time per collision, µs", ylabel="largest error of $e_A$")
axes.legend(fontsize=7.5)
