"""
Published measurements compared with ours
=========================================

Our result in the accepted range of a published number that is not our input;
-1 and 1 are the ends of the range. In brackets: our result over the published
number. Squares: explained in *Published measurements*. The script needs a clone
of the repository.
"""

import matplotlib.pyplot as plt
import pandas as pd

from tests.studies.reference import comparing, published

rows = [x for x in published.read_published() if x.find]
table = pd.DataFrame(map(comparing.compare_number, rows))
table = table[table["role"] == "prediction"]
table = table[~table["quantity"].str.contains("minus")]
columns = ["published", "value", "low", "high"]
table[columns] = table[columns].apply(pd.to_numeric, errors="coerce")
table = table.dropna(subset=columns)
low, high = table["low"], table["high"]
table["place"] = (2 * table["value"] - low - high) / (high - low)
table = table.sort_values("place").reset_index()
ratio = (table["value"] / table["published"]).map(" ({:.2f})".format)
figure, axes = plt.subplots(figsize=(4.8, 8.5))
axes.axvspan(-1, 1, color="0.88", zorder=0)
kinds = table.groupby("agreement")["place"]
for marker, (verdict, x) in zip("os", kinds, strict=True):
    axes.plot(x, x.index, marker, mfc="none", ms=5, label=verdict)
names = (table["quantity"] + ratio).str.wrap(36)
axes.set_yticks(table.index, names, fontsize=7)
axes.set(xlabel="position in the accepted range", ylim=(-1, len(table)))
figure.legend(loc="outside upper right", ncols=2)
