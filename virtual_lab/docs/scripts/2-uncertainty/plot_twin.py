"""
Is the stated u of one laboratory right?
========================================

Stated u of a laboratory over the standard deviation of its errors: its twin repeats the test day a
thousand times, with the instruments and scatter that its records state. At 1 (dashed) the stated u
is right. Each procedure tested one bat in many laboratories.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import virtual_lab as vl

folder = Path(vl.__file__).parents[1] / "tests" / "studies"
table = pd.read_csv(next(folder.glob("twin-*.csv"))).query("fault.isna()")
figure, panels = plt.subplots(2, 1, sharex=True)
for axes, (procedure, rows) in zip(panels, table.groupby("procedure"), strict=True):
    axes.hist(rows["ratio"], np.arange(0.6, 2, 0.05), edgecolor="white")
    axes.axvline(1, color="black", linestyle="--")
    axes.set(title=f"{procedure}, {len(rows)} laboratories", ylabel="laboratories")
panels[-1].set(xlabel="stated u / standard deviation of the errors")
