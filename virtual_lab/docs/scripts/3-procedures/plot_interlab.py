"""
Why laboratories differ
=======================

Standard deviation of BBCOR among laboratories that test one EA70, for one cause of variation at a
time (bars) and for all (s_R, dashed). Normalizing removes the effects of ball lot and ball store.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

folder = Path(vl.__file__).parents[1] / "tests" / "studies"
table = pd.read_csv(next(folder.glob("interlab-2*.csv")))
table = table.query("bat == 'ea70' & procedure == 'bbcor'")
causes = ["lot", "stiffness", "store", "calibration", "wall"]
figure, panels = plt.subplots(1, 2, sharey=True)
for axes, result in zip(panels, ["as found", "normalized"], strict=True):
    spread = 1e3 * table[table["result"] == result].set_index("term")["simulated"]
    axes.barh(causes, spread[causes], hatch="//", edgecolor="white")
    axes.axvline(spread["s_R"], color="C1", linestyle="--")
    axes.set(title=f"{result}, s_R {spread['s_R']:.1f}", xlabel="sd of BBCOR, 0.001", xlim=(0, 5))
