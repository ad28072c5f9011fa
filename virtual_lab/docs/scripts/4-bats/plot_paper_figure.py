"""
Restitution, recoil and collision efficiency
============================================

Restitution e, recoil factor r (mass of the ball / effective mass of the bat at
the impact position) and collision efficiency (e - r) / (1 + r) of the wood bat
R161 in a game (90 mph pitch), as in Figure 2 of Nathan (2003). e peaks near 5
in and r falls toward 11 in, so the efficiency peaks in between.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

table = vl.profile("r161").table
rows = table[table["impact_position_in"].between(1, 12)]
figure, axes = plt.subplots()
labels = {
    "restitution": "restitution $e$",
    "recoil_factor": "recoil factor $r$",
    "collision_efficiency": "collision efficiency $e_A$",
}
for column, label in labels.items():
    axes.plot(rows["impact_position_in"], rows[column], label=label)
axes.set_xlabel("impact position from the tip, in")
axes.set(ylabel="$e$, $r$, $e_A$", ylim=(-0.15, 0.75))
axes.legend(loc="upper right", fontsize=8.5)
