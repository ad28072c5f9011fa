"""
Do the intervals hold in every tenth?
=====================================

Simulated laboratories, sorted by their stated u into ten groups. Six hits that agree by chance
state too small a u; with ten earlier tests of the laboratory no group is far from 95 %.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

tables = Path(vl.__file__).parents[1] / "tests/studies"
kinds = (("coverage", "single test", "o"), ("history", "with ten earlier tests", "s"))
figure, axes = plt.subplots()
for kind, label, marker in kinds:
    rows = pd.read_csv(next(tables.glob(f"{kind}-*.csv")))
    row = rows.query("procedure == 'astm-f1881' and quantity == 'metric'").iloc[0]
    shares = [row[f"coverage_by_u_{tenth}"] for tenth in range(1, 11)]
    axes.plot(range(1, 11), shares, marker=marker, label=label)
axes.set(xlabel="tenth of the laboratories, from small to large u", ylabel="share with the truth")
axes.legend()
