"""
Uncertainty budgets
===================

Share of each component in u² of the result, two procedures. With six hits their scatter counts
most; a scan of many hits is limited by other things.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

figure, panels = plt.subplots(2, figsize=(4.8, 4.8), sharex=True)
for axes, procedure in zip(panels, ("astm-f1881", "bbcor"), strict=True):
    budget = vl.certify("ea70", procedure=procedure, seed=7).budget.head(6)[::-1]
    bars = axes.barh(budget["component"], budget["share_percent"])
    axes.bar_label(bars, fmt="%.0f", padding=2)
    axes.set_title(procedure)
    axes.tick_params(axis="y", labelsize=9)
panels[1].set(xlabel="share of u², %", xlim=(0, 100))
