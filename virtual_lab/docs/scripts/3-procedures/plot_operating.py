"""
Chance to pass near the limit
=============================

Chance that a variant of EA70 passes BBCOR (limit raised to 0.537), against its true restitution.
Circles: counted in 5 000 tests each (95 % intervals). Line: predicted from the scatter of errors.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

folder = Path(vl.__file__).parents[1] / "tests" / "studies"
table = pd.read_csv(next(folder.glob("operating-*.csv"))).sort_values("true")
counted = 100 * table["counted"]
bars = [counted - 100 * table["low"], 100 * table["high"] - counted]
figure, axes = plt.subplots()
axes.errorbar(table["true"], counted, bars, fmt="o", capsize=2, label="counted")
axes.plot(table["true"], 100 * table["predicted"], color="C1", linestyle="--", label="predicted")
axes.axvline(0.537, color="black", linestyle=":", label="limit")
axes.set(xlabel="true restitution e of the bat with a standard ball", ylabel="tests that pass, %")
axes.legend()
