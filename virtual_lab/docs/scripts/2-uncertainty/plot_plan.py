"""
The quickest way to a smaller uncertainty
=========================================

Two plans that lower u of the bat performance factor (BPF; R161, ASTM F1881) to
0.004. Named: what is exchanged for one with half the u and scatter. Marks:
median u of 200 simulated laboratories, ± 2 standard errors; crosses: predicted
by the budget. A better cannon aims closer; with a better balance stand
no hit is added.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

plans = vl.plan("astm-f1881", target_u=0.004, laboratories=200).table
plans = plans[plans["plan"].isin(["present", "1", "2"])]
figure, axes = plt.subplots()
for (_, row), mark in zip(plans.iterrows(), "osD", strict=True):
    label = row["exchanged"].replace("none", "as it is")
    label = f"{label}, {row['hits']} hits"
    x, y, bar = row[["minutes", "simulated_u", "simulated_u_se"]]
    axes.errorbar(x, 1e3 * y, 2e3 * bar, fmt=mark, capsize=3, label=label)
x, y = plans[["minutes", "planned_u"]].to_numpy().T
axes.plot(x, 1e3 * y, "kx", zorder=3, label="predicted")
axes.axhline(4, color="black", linestyle="--", linewidth=1, label="target")
axes.set(xlabel="minutes per test", ylabel="u of BPF, in 0.001")
axes.set(xlim=(107.5, 113.5), ylim=(3.5, 5.9))
axes.legend()
