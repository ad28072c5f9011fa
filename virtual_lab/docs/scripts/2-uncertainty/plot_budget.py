"""
Uncertainty budgets
===================

Six largest components of the variance u² of a result of aluminum bat EA70 (u:
standard uncertainty). Both results (bat performance factor, restitution) are
means of six hits, whose scatter dominates. BBCOR must also find the position.
"""

from textwrap import fill

import matplotlib.pyplot as plt

import virtual_lab as vl

figure, panels = plt.subplots(2, figsize=(4.8, 4.8), sharex=True)
for axes, procedure in zip(panels, ("astm-f1881", "bbcor"), strict=True):
    budget = vl.certify("ea70", procedure=procedure, seed=7).budget
    budget = budget.head(6)[::-1]
    names = [fill(name, 28) for name in budget["source"]]
    bars = axes.barh(names, budget["share_percent"])
    axes.bar_label(bars, fmt="%.0f", padding=2)
    axes.tick_params("y", labelsize=8)
    axes.set_title(procedure.replace("-", " ").upper())
panels[1].set(xlabel="share of u², %", xlim=(0, 100))
