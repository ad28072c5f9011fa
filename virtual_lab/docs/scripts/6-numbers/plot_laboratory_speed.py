"""
What a faster model costs a result
==================================

A simpler model of one part of a test (ASTM F1881; 5: a filmed hit), compared
with the finest model of this part: rms over many tests of the change of the
result (6, 7: of half the 95 % interval), in u. Studies use 2, 3, 4; also 6,
because its intervals still contain the truth in 94 % of tests.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(f"{vl.__path__[0]}/docs/tables/models.csv")
base = table.groupby("part")["ms"].transform("last")
labels = [
    "rigid bat, not vibrating",
    "collision table, not solved",
    "gate times, not light signals",
    "bat rates, not encoder counts",
    "ball positions, not camera frames",
    "interval to first order, not Monte Carlo",
    "to second order, not Monte Carlo",
]
figure, axes = plt.subplots(figsize=(4.8, 4.6))
table["ratio"] = table["ms"] / base
rows = table.query("rms > 1e-6 and rung != 'modal'")
for k, row in enumerate(rows.itertuples()):
    style = {"color": "C0", "ls": "", "ms": 8, "marker": f"${k + 1}$"}
    axes.loglog(row.ratio, row.rms, label=labels[k], **style)
label = "limit for use in studies (0.1 u)"
axes.axhline(0.1, color="k", lw=1, linestyle=":", label=label)
axes.set_xlabel("run time / run time of finest model")
axes.set_ylabel("rms change of result / u")
figure.legend(loc="outside upper left")
