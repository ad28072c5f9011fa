"""
What a faster model costs a result
==================================

Each number is a simpler model of one part of a test by ASTM F1881 (5: one filmed hit, BBCOR). It
changes the result, or the length of its interval (6, 7), from that of the finest model (80 to 1 500
ms, not drawn). Studies use 2, 3, 4 and 6. First order (6) exceeds the limit, so its coverage was
tested.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(DATA / "uncertainty/laboratory.csv").query("rms > 1e-6 and rung != 'modal'")
words = ["rigid bat", "table of collisions", "gate times without light edges"]
words += ["bat rates without encoder counts", "ball positions without camera frames"]
words += ["u to first order", "u to second order"]
figure, axes = plt.subplots(figsize=(4.8, 4.6))
for k, (ms, rms, label) in enumerate(zip(table["ms"], table["rms"], words, strict=True), 1):
    axes.loglog(ms, rms, marker=f"${k}$", color="C0", linestyle="", markersize=8, label=label)
axes.axhline(0.1, color="black", linewidth=1, linestyle=":", label="limit of changes")
axes.set(xlabel="time per laboratory, ms", ylabel="rms change of the result, u", ylim=(1e-3, 30))
figure.legend(loc="outside upper left")
