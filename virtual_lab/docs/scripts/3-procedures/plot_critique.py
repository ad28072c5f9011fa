"""
Does the procedure rank bats as the field does?
===============================================

Probability that a laboratory ranks two bats against their order in play, by pair and procedure.
Below 5 %: reliable; about 50 %: by chance; near 100 %: the rule prefers the slower bat.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(Path(vl.__file__).parent / "docs/tables/critique.csv").query(
    "swing_exponent == 0.3"
)
table["pair"] = table["bat"] + "\n" + table["against"]
grid = 100 * table.pivot(index="pair", columns="procedure", values="opposite_probability")
figure, axes = plt.subplots(figsize=(4.8, 4.4))
axes.imshow(grid, cmap="cividis_r", vmin=0, vmax=100, aspect="auto", zorder=2)
for (row, column), value in np.ndenumerate(grid.to_numpy()):
    axes.text(column, row, f"{value:.0f}", ha="center", color="k" if value < 50 else "w")
axes.set_xticks(range(grid.shape[1]), grid.columns, rotation=40, ha="right", fontsize=8.5)
axes.set_yticks(range(grid.shape[0]), grid.index, fontsize=8.5)
