"""
Published measurements compared with ours
=========================================

Our result over a published number that is not our input. Gray: accepted range. Squares: explained
in *Published measurements*. The script needs a clone of the repository.
"""

import matplotlib.pyplot as plt
import pandas as pd

from tests.studies.reference import comparing, published

rows = [comparing.compare_number(each) for each in published.read_published() if each.find]
table = pd.DataFrame(rows).query("role == 'prediction' and ~quantity.str.contains('minus')")
numbers = pd.to_numeric(table["published"], errors="coerce")
ratios = table[["value", "low", "high"]].div(numbers, axis=0)
ratios = ratios.join(table[["quantity", "agreement"]]).dropna().sort_values("value").reset_index()
figure, axes = plt.subplots(figsize=(4.8, 8.5))
axes.hlines(ratios.index, ratios["low"], ratios["high"], color="0.8", lw=8)
for marker, (verdict, rows) in zip("os", ratios.groupby("agreement"), strict=True):
    axes.plot(rows["value"], rows.index, marker, mfc="none", ms=4, label=verdict)
axes.set_yticks(ratios.index, ratios["quantity"].str.wrap(36), fontsize=7)
axes.set(xlabel="our result / published number", ylim=(-1, len(ratios)))
figure.legend(loc="outside upper right", ncols=2)
