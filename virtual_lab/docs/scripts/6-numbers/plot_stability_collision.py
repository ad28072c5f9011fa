"""
Where the collision scheme is stable
====================================

State of 24 collisions for each length of the time step (1: as shipped) and impact position. Where
ball and bat meet twice a long step may be inaccurate; the program detects this and steps finer.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

folder = Path(vl.__file__).parent / "docs" / "tables"
table = pd.read_csv(folder / "stability-collision.csv")
figure, axes = plt.subplots(figsize=(4.8, 4.2))
for marker, (state, rows) in zip("o^xs", table.groupby("state"), strict=False):
    axes.plot(rows["value"], rows["step"], marker, mfc="none", label=state)
axes.axhline(1, color="black", linewidth=0.8)
axes.set(xlabel="impact position from the tip, in", ylabel="time step over that shipped")
figure.legend(loc="outside upper center", fontsize=9)
