"""
Does a procedure rank bats as play does?
========================================

Probability (%) that a laboratory ranks two bats opposite to play (50: by
chance; ± 4 at most). In play less inertia means a faster swing, as in PROPOSED
(2003 paper); NCAA MODIFIED swings all bats alike. BPF (ASTM F1881) ignores the
mass near the ball. Loaded: EA70, 2.3 oz moved to this end.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import virtual_lab as vl

names = {"ea70": "EA70", "r161": "R161 (wood)"}
table = pd.read_csv(f"{vl.__path__[0]}/docs/tables/critique.csv").replace(names)
# from fast to slow in play
order = ["barrel-loaded", "knob-loaded", *names.values()]
pairs = (sorted(x, key=order.index) for x in table.to_numpy()[:, :2])
table["pair"] = ["\n> ".join(pair) for pair in pairs]
table = table.pivot(index="pair", columns="procedure")
grid = 100 * table["opposite_probability"]
figure, axes = plt.subplots(figsize=(4.8, 4))
axes.imshow(grid, cmap="Oranges", vmin=0, vmax=100, aspect="auto", zorder=2)
for (y, x), value in np.ndenumerate(grid):
    color = "k" if value < 80 else "w"
    axes.text(x, y, f"{value:.0f}", ha="center", color=color)
axes.set_ylabel("batted-ball speed in play")
names = [name.replace("-", "\n").upper() for name in grid]
axes.set_xticks(range(5), names, fontsize=9)
axes.set_yticks(range(6), grid.index, fontsize=8.5)
