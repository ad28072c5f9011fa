"""
Who passes by chance
====================

Chance that a bat passes the procedure, over its true metric: circles are counted from simulated
tests, with 95 % intervals; the line is what the program predicts from the scatter of the errors.
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
axes.set(xlabel="true e of the bat, standard ball", ylabel="tests that pass, %")
axes.legend()
