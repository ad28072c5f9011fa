"""
The quickest way to a smaller uncertainty
=========================================

Two plans that lower u of the bat performance factor (BPF; R161, ASTM F1881) to 0.004. Named: what
is exchanged for one with half the u and scatter. Marks: median u of 200 simulated laboratories, ± 2
standard errors; crosses: predicted by the budget. A better cannon aims closer; no hits are added.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

plans = vl.plan("astm-f1881", target_u=0.004, laboratories=200).table.set_index("plan")
figure, axes = plt.subplots()
for (_, row), mark in zip(plans.loc[["present", "1", "3"]].iterrows(), "osD", strict=True):
    label = row["exchanged"].replace("none", "as it is")
    u, bar, text = row["simulated_u"], row["simulated_u_se"], f"{label}, {row['hits']} hits"
    axes.errorbar(row["minutes"], 1e3 * u, 2e3 * bar, fmt=mark, capsize=3, label=text)
x, y = plans.loc[["present", "1", "3"], ["minutes", "planned_u"]].to_numpy().T
axes.plot(x, 1e3 * y, "kx", zorder=3, label="predicted")
axes.axhline(4, color="black", linestyle="--", linewidth=1, label="target")
axes.set(xlabel="minutes per test", ylabel="u of BPF, in 0.001", ylim=(3.5, 5.9))
axes.legend()
