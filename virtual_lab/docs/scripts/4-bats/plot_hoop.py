"""
The hoop mode of a hollow bat
=============================

Collision efficiency (rebound speed / impact speed, bat at rest) of the
aluminum bat EA70 (3000 Hz) and two variants. A softer shell (lower hoop
frequency) stores more energy and returns most of it. The ball loses less and
rebounds faster.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

figure, axes = plt.subplots()
for hertz in (2500, 3000, 5000):
    bat = vl.bat("ea70").with_({"body.hoop.frequency": f"{hertz} Hz"})
    table = vl.profile(bat).table
    rows = table[table["impact_position_in"].between(2, 12)]
    z, found = rows["impact_position_in"], rows["collision_efficiency"]
    axes.plot(z, found, label=f"{hertz} Hz")
axes.set_xlabel("impact position from the tip, in")
axes.set_ylabel("collision efficiency $e_A$")
axes.legend(title="hoop frequency")
