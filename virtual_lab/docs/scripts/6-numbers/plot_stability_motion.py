"""
Where a physics engine is accurate
==================================

State of shots computed by pymunk, over the speed of the ball and the time step. The rung of the
program, which gives the engine the collision's result, is right for every step; alone it is not.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(Path(vl.__file__).parent / "docs/tables/stability-motion.csv")
figure, panels = plt.subplots(1, 2, sharey=True, figsize=(4.8, 3.8))
marks = dict(zip(sorted(set(table["state"])), "o^xs", strict=False))
for axes, (method, rows) in zip(panels, table.groupby("method"), strict=True):
    for k, (state, marker) in enumerate(marks.items()):
        there = rows[rows["state"] == state]
        axes.loglog(there["value"], there["step"], marker, color=f"C{k}", mfc="none", label=state)
    axes.set(title=method, xlabel="speed, mph")
panels[0].set(ylabel="time step, s")
figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", fontsize=9)
