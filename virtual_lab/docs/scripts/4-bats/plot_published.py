"""
Published measurements compared with ours
=========================================

Our result over a published number that is not our input. Gray: accepted range, ± 2 published u, or
rounding and the effect of another bat or ball. Squares: our hollow is rigid,
our bat is another one (node, hoop), or the published number is rough (inertia).
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = vl.reference().table.query("role == 'prediction' and ~quantity.str.contains('minus')")
columns = ["value", "agreement_low", "agreement_high"]
ratios = table[columns].div(pd.to_numeric(table["published"], errors="coerce"), axis=0)
ratios = ratios.join(table[["quantity", "agreement"]]).dropna().sort_values("value").reset_index()
figure, axes = plt.subplots(figsize=(4.8, 8.5))
axes.hlines(ratios.index, ratios["agreement_low"], ratios["agreement_high"], color="0.8", lw=8)
for marker, (verdict, rows) in zip("os", ratios.groupby("agreement"), strict=True):
    axes.plot(rows["value"], rows.index, marker, mfc="none", ms=4, label=verdict)
axes.set_yticks(ratios.index, ratios["quantity"].str.wrap(36), fontsize=7)
axes.set(xlabel="our result / published number", ylim=(-1, len(ratios)))
figure.legend(loc="outside upper right", ncols=2)
