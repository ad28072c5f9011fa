"""
Does a procedure rank bats as play does?
========================================

Probability (%) that a laboratory ranks two bats opposite to their order in play (near 50: by
chance; near 100: the slower bat wins), for swings with n = 0.3.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(Path(vl.__file__).parent / "docs/tables/critique.csv")
table = table[table["swing_exponent"] == 0.3].replace({"r161": "R161 (wood)", "ea70": "EA70"})
grid = 100 * table.pivot(index=["bat", "against"], columns="procedure")["opposite_probability"]
figure, axes = plt.subplots(subplot_kw={"xlabel": "procedure", "ylabel": "pair of bats"})
axes.imshow(grid, cmap="cividis_r", vmin=0, vmax=100, aspect="auto", zorder=2)
for (row, column), value in np.ndenumerate(grid.to_numpy()):
    axes.text(column, row, f"{value:.0f}", ha="center", color="k" if value < 50 else "w")
axes.set_xticks(range(grid.shape[1]), grid.columns, rotation=25, ha="right", fontsize=8.5)
axes.set_yticks(range(grid.shape[0]), ["\n".join(pair) for pair in grid.index], fontsize=8)
