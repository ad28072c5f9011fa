"""
Figure 2 of the paper
=====================

Restitution e, recoil factor r and collision efficiency e_A of the wood bat along its barrel. e_A
is largest where both the loss to vibration and the recoil are small.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

table = vl.profile("r161").table
rows = table[table["impact_position_in"].between(1, 12)]
figure, axes = plt.subplots()
labels = {"restitution": "$e$", "recoil_factor": "$r$", "collision_efficiency": "$e_A$"}
for column, label in labels.items():
    axes.plot(rows["impact_position_in"], rows[column], label=label)
axes.set(xlabel="impact position from the tip, in", ylabel="$e$, $r$, $e_A$")
axes.legend()
