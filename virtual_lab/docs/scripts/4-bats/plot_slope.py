"""
The slope of e_A along the barrel
=================================

How fast e_A falls with the impact position, two bats. A test at one place must hit it the better,
the steeper the curve is there.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

figure, axes = plt.subplots()
for bat in ("r161", "ea70"):
    table = vl.profile(bat).table
    rows = table[table["impact_position_in"].between(3, 10)]
    z = rows["impact_position_in"]
    axes.plot(z, np.gradient(rows["collision_efficiency"], z), label=bat)
axes.axhline(0, color="black", linewidth=0.8)
axes.set(xlabel="impact position from the tip, in", ylabel="slope of $e_A$, 1/in")
axes.legend()
