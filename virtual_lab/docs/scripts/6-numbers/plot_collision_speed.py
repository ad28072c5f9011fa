"""
Collision models: error and time
================================

Largest error of e_A in 400 collisions, over the time per collision. Down and left is better. Tests
use the modal model, and studies the table that interpolates it (the surrogate).
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(Path(vl.__file__).parents[1] / "data" / "figures" / "collision.csv")
table = table[table["held_against"] == table["held_against"][0]]
figure, axes = plt.subplots(figsize=(4.8, 4.2))
for marker, (series, rows) in zip("os^vD", table.groupby("series", sort=False), strict=True):
    axes.loglog(rows["us_a_shot"], rows["worst_error"], marker, label=series)
axes.set(xlabel="time per collision, µs", ylabel="largest error of $e_A$")
axes.legend(fontsize=7.5)
