"""
Does the 95 % interval hold in each group?
==========================================

Wood bat R161, ASTM F1881: 100 000 laboratories (circles) and 20 000 (squares)
in ten groups, from small to large stated u. If the six hits of a single test
agree by chance, u is too small. If their scatter is pooled with that of ten
earlier tests, the interval holds in 91 to 97 % of each group (each ± 1.2 %),
not 81 to 100 (± 0.8 %).
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

kinds = (
    ("coverage", "single test", "o"),
    ("history", "pooled with ten earlier tests", "s"),
)
figure, axes = plt.subplots()
for kind, label, marker in kinds:
    rows = pd.read_csv(next(DATA.parent.glob(f"tests/studies/{kind}-*.csv")))
    rows = rows.query("procedure == 'astm-f1881' and quantity == 'metric'")
    shares = 100 * rows.iloc[0].filter(like="coverage_by_u_").astype(float)
    axes.plot(range(1, 11), shares, marker=marker, label=label)
axes.axhline(95, color="black", linewidth=1, label="95 %")
axes.set_xlabel("group, from small to large u")
axes.set_ylabel("intervals with the true value, %")
axes.legend()
