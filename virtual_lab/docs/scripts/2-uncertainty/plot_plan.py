"""
The quickest way to a smaller uncertainty
=========================================

Median of u that 200 simulated laboratories state for the bat performance factor (BPF) of R161 by
ASTM F1881 (bars: ± 2 standard errors; crosses: first order, from the present budget). Better: half
the uncertainty and scatter. A hit takes 3.75 min. The better cannon needs no additional hits.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

plans = vl.plan("astm-f1881", target_u=0.004, laboratories=200).table.set_index("plan")
labels = {"present": "as it is", "1": "better cannon", "7": "better balance stand and pivot survey"}
figure, axes = plt.subplots()
for (plan, label), mark in zip(labels.items(), "osD", strict=True):
    row = plans.loc[plan]
    u, bar = 1e3 * row["simulated_u"], 2e3 * row["simulated_u_se"]
    text = f"{label}, {row['hits']} hits"
    axes.errorbar(row["minutes"], u, bar, fmt=mark, capsize=3, label=text)
    axes.plot(row["minutes"], 1e3 * row["planned_u"], "kx", zorder=3)
axes.axhline(4, color="black", linestyle="--", linewidth=1, label="target")
axes.set(xlabel="minutes per test", ylabel="u of BPF, in 0.001", ylim=(3.5, 5.9))
axes.legend()
