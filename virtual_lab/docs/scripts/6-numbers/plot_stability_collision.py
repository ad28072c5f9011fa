"""
Where the collision scheme is accurate
======================================

Each mark is the worst of 24 collisions. Up to twice the default time step,
each larger error is detected, and the program repeats that collision with
finer steps. From three times on, some errors stay undetected. Unstable: energy
wrong by more than 10 %, or collision efficiency :math:`e_A` beyond ±2.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(f"{vl.__path__[0]}/docs/tables/stability-collision.csv")
words = {
    "good": "error of $e_A$ up to $10^{-6}$",
    "inaccurate, detected": "larger error, detected",
    "inaccurate": "larger error, not detected",
    "unstable": "unstable",
}
figure, axes = plt.subplots(figsize=(4.8, 4.4))
for marker, (state, label) in zip("ox^s", words.items(), strict=True):
    rows = table[table["state"] == state]
    axes.plot(rows["value"], rows["step"], marker, mfc="none", label=label)
axes.axhline(1, color="black", linewidth=0.8, label="default step")
axes.set_xlabel("impact position from the tip, in")
axes.set_ylabel("time step / default step")
figure.legend(loc="outside upper center", fontsize=9)
