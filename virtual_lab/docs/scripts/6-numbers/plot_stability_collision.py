"""
Where the collision scheme is accurate
======================================

Each mark is the worst of 24 collisions. Up to twice the default time step, each inaccurate
collision is detected, and the program repeats it with finer steps. From three times on, some errors
stay undetected. Unstable: energy wrong by more than 10 %, or e_A beyond ±2.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

folder = Path(vl.__file__).parent / "docs" / "tables"
table = pd.read_csv(folder / "stability-collision.csv").replace("good", "accurate")
figure, axes = plt.subplots(figsize=(4.8, 4.2))
for marker, (state, rows) in zip("o^xs", table.groupby("state"), strict=False):
    axes.plot(rows["value"], rows["step"], marker, mfc="none", label=state)
axes.axhline(1, color="black", linewidth=0.8)
axes.set(xlabel="impact position from the tip, in", ylabel="time step / default")
figure.legend(loc="outside upper center", fontsize=9)
