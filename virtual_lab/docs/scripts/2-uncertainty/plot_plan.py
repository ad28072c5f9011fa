"""
The quickest way to a smaller uncertainty
=========================================

Plans for a target uncertainty u of the bat performance factor (BPF, dashed). More hits cost
minutes, better instruments (half their u) do not. Crosses are predicted, other marks simulated
(bars: 2 standard errors).
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

plans = vl.plan("astm-f1881", target_u=0.004, laboratories=200).table.set_index("plan")
labels = {"present": "as it is", "1": "better instruments", "single change": "hits alone"}
figure, axes = plt.subplots()
for (plan, label), mark in zip(labels.items(), "osD", strict=True):
    row = plans.loc[plan]
    u, bar = 1e3 * row["simulated_u"], 2e3 * row["simulated_u_se"]
    text = f"{label}, {row['hits']} hits"
    axes.errorbar(row["minutes"], u, bar, fmt=mark, capsize=3, label=text)
    axes.plot(row["minutes"], 1e3 * row["planned_u"], "kx", zorder=3)
axes.axhline(4, color="black", linestyle="--", linewidth=1)
axes.set(xlabel="minutes per test", ylabel="u of BPF, in 0.001", ylim=(3.5, 5.6))
axes.legend()
