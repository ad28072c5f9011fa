"""
The slope of e_A along the barrel
=================================

Derivative of e_A with respect to the impact position. It is zero where e_A is largest. The larger
its magnitude, the more an error of the impact position changes the measured e_A.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

figure, axes = plt.subplots()
for bat, label in (("r161", "R161, wood"), ("ea70", "EA70, aluminum")):
    table = vl.profile(bat).table
    rows = table[table["impact_position_in"].between(3, 10)]
    z = rows["impact_position_in"]
    axes.plot(z, np.gradient(rows["collision_efficiency"], z), label=label)
axes.axhline(0, color="black", linewidth=0.8)
axes.set(xlabel="impact position from the tip, in", ylabel="slope of $e_A$, 1/in")
axes.legend()
