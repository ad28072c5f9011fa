"""
Does the 95 % interval hold in each group?
==========================================

Simulated laboratories in ten groups of rising stated u. If six hits agree by chance, u is too small
and the interval short. With ten earlier tests, all groups are between 91 and 98 %, not 81 and 100.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

kinds = (("coverage", "single test", "o"), ("history", "with ten earlier tests", "s"))
figure, axes = plt.subplots()
for kind, label, marker in kinds:
    rows = pd.read_csv(next(Path(vl.__file__).parents[1].glob(f"tests/studies/{kind}-*.csv")))
    row = rows.query("procedure == 'astm-f1881' and quantity == 'metric'").iloc[0]
    shares = 100 * row.filter(like="coverage_by_u_").astype(float)
    axes.plot(range(1, 11), shares, marker=marker, label=label)
axes.axhline(95, color="black", linewidth=1)
axes.set(xlabel="group, from small to large u", ylabel="intervals with the true value, %")
axes.legend()
