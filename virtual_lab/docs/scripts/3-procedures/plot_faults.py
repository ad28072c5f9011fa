"""
Which faults are caught
=======================

Share of simulated laboratories in which a fault raises a flag, on the pivoted-bat rig; `none` is a
sound laboratory. Faults at the bottom leave no trace: only a control bat reveals them.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

folder = Path(vl.__file__).parents[1] / "tests" / "studies"
table = pd.read_csv(next(folder.glob("faults-*.csv")))
table = table[(table.procedure == "astm-f1881")].sort_values("detected")
figure, axes = plt.subplots(figsize=(4.8, 6.4))
axes.barh(table["fault"], 100 * table["detected"], color="C0")
axes.tick_params(axis="y", labelsize=8.5)
axes.margins(y=0.01)
axes.set(xlabel="laboratories with a flag, %", xlim=(0, 100))
