"""
Restitution, recoil and collision efficiency
============================================

Restitution e, recoil factor r and collision efficiency e_A = (e - r) / (1 + r) of the wood bat
R161, as in Figure 2 of Nathan (2003). e peaks near 5 in and r falls toward 11 in, so e_A peaks in
between.
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
