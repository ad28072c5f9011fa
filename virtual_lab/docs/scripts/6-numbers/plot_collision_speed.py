"""
Collision models: error and run time
====================================

Largest error of the collision efficiency :math:`e_A` in 400 collisions (6 for
the ODE solver), compared with 120 modes. Tests use 20 modes. Studies look up
results of 20 modes in a table (surrogate); the time to make the table is not
counted.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

names = {
    "reference": "100 modes, general ODE solver",
    "surrogate of the default": "surrogate",
}
table = pd.read_csv(DATA / "figures/collision.csv").replace(names)
table = table[table.held_against == table.held_against[0]]
table = table[~table.setting.str.contains("degree")]
figure, axes = plt.subplots(figsize=(4.8, 4.2))
models = table.groupby("series", sort=False)
for marker, (name, rows) in zip("os^D", models, strict=True):
    x, y = rows["us_a_shot"], rows["worst_error"]
    axes.loglog(x, y, marker, mfc="none", label=name)
named = table.setting.str.fullmatch("(405|1152) nodes|(4|20|40) modes")
for row in table[named].itertuples():
    words = row.setting.replace("1152 nodes", "621, 1152 entries")
    words = words.replace("nodes", "entries")
    axes.text(row.us_a_shot, row.worst_error, f"  {words}", fontsize=8)
axes.set(xlabel="time per collision, µs", ylabel="largest error of $e_A$")
axes.legend(fontsize=7.5)
