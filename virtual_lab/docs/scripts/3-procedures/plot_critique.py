"""
Does a procedure rank bats as play does?
========================================

Probability (%) that a laboratory ranks two bats opposite to their order in play (50: by chance).
Swing speed in play falls with (moment of inertia)⁻⁰·³. PROPOSED uses this law, so all its ranks are
right; NCAA MODIFIED swings all bats at 66 mph. Loaded: EA70, wall thinner for 2.3 oz in an end.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(f"{vl.__path__[0]}/docs/tables/critique.csv")
table = table.replace({"ea70": "EA70", "r161": "R161 (wood)"})
order = ["barrel-loaded", "knob-loaded", "EA70", "R161 (wood)"]  # from fast to slow in play
table["pair"] = ["\n> ".join(sorted(x, key=order.index)) for x in table.to_numpy()[:, :2]]
grid = 100 * table.pivot(index="pair", columns="procedure")["opposite_probability"]
figure, axes = plt.subplots(figsize=(4.8, 4), subplot_kw={"ylabel": "batted-ball speed in play"})
axes.imshow(grid, cmap="cividis_r", vmin=0, vmax=100, aspect="auto", zorder=2)
for at, value in enumerate(grid.to_numpy().ravel()):
    axes.text(at % 5, at // 5, f"{value:.0f}", ha="center", color="k" if value < 50 else "w")
axes.set_xticks(range(5), [x.replace("-", "\n").upper() for x in grid], fontsize=9)
axes.set_yticks(range(6), grid.index, fontsize=8.5)
