"""
The slope of the collision efficiency
=====================================

The collision efficiency is the rebound speed of a ball / its impact speed on a
bat at rest. Where its slope along the barrel is large, an error of the impact
position changes the measured value. The slope is zero where the collision
efficiency is largest.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

figure, axes = plt.subplots()
for bat, label in (("r161", "R161, wood"), ("ea70", "EA70, aluminum")):
    table = vl.profile(bat).table
    z = table["impact_position_in"]
    slope = np.gradient(table["collision_efficiency"], z)
    axes.plot(z[z.between(3, 10)], slope[z.between(3, 10)], label=label)
axes.axhline(0, color="black", linewidth=0.8)
axes.set_xlabel("impact position from the tip, in")
axes.set_ylabel("slope of collision efficiency, 1/in")
axes.legend()
