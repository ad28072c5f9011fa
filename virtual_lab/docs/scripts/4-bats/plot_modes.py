"""
Bending modes of a bat
======================

The three lowest bending modes of the free wood bat, scaled to unit modal mass. A ball that hits a
node does not excite that mode. The nodes of the first two modes lie near the best impact positions.
"""

import matplotlib.pyplot as plt
import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BatSpec
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of

modes = modes_of(catalog.load("bats", "r161", BatSpec).spec.body, Free(), 3)
z = np.linspace(0, modes.length, 300)
figure, axes = plt.subplots()
for mode in range(modes.rigid, modes.rigid + 3):
    hertz = modes.angular_frequencies[mode] / (2 * np.pi)
    axes.plot(z / 0.0254, modes.shape(z)[:, mode], label=f"{hertz:.0f} Hz")
axes.axhline(0, color="black", linewidth=0.8)
axes.set(xlabel="distance from the barrel tip, in (knob: 34)", ylabel="mode shape, 1/√kg")
axes.legend()
