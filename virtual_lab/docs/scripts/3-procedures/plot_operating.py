"""
Chance to pass near the limit
=============================

Chance that a bat passes BBCOR, for 20 variants of EA70 with different hoop frequencies. Circles:
counted in 5 000 laboratories each (95 % intervals). Line: predicted from the errors of one variant
in 20 000 laboratories. The limit is raised to 0.537 because all variants exceed the 0.500 of the
rules. At the limit 47 ± 1 % pass, not 50, because BBCOR comes out 0.00015 high on average.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(next(DATA.parent.glob("tests/studies/operating-*.csv"))).sort_values("true")
counted = 100 * table["counted"]
bars = [counted - 100 * table["low"], 100 * table["high"] - counted]
figure, axes = plt.subplots()
axes.errorbar(table["true"], counted, bars, fmt="o", capsize=2, label="counted")
axes.plot(table["true"], 100 * table["predicted"], color="C1", linestyle="--", label="predicted")
axes.axvline(0.537, color="black", linestyle=":", label="limit")
axes.set(xlabel="true BBCOR of the bat", ylabel="tests that pass, %")
axes.legend()
