"""
Bending modes of a bat
======================

The three lowest bending modes of the free wood bat R161, scaled to unit modal
mass. A ball that hits a node (zero) does not excite that mode. The barrel
nodes of the lowest two modes are 6.8 and 5.2 in from the tip. The best impact
positions are between them (gray).
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of

modes = modes_of(vl.bat("r161").spec.body, Free(), 3)
z = np.linspace(0, modes.length, 300)
hertz = modes.angular_frequencies[modes.rigid :] / (2 * np.pi)
figure, axes = plt.subplots()
labels = [f"{f:.0f} Hz" for f in hertz]
axes.plot(z / 0.0254, modes.shape(z)[:, modes.rigid :], label=labels)
axes.axvspan(5.2, 6.8, color="0.9", zorder=0)
axes.axhline(0, color="black", linewidth=0.8)
axes.set_xlabel("distance from the barrel tip, in (knob: 34)")
axes.set_ylabel("mode shape, 1/√kg")
axes.legend()
