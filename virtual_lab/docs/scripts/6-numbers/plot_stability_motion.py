"""
Where a physics engine is accurate
==================================

Rebound of a ball in the physics engine pymunk. Accurate (both panels): the velocity after the hit
differs from that of the exact solution by less than 0.01 % of the speed of approach. Left: the
engine alone is unstable from 20 mph at 10 ms, 60 mph at 3 ms and 160 mph at 1 ms; the ball passes
the bat or gains energy. Right: our model finds hit and impulse, the engine moves ball and bat.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

names = {"our pymunk model": "with our model", "plain pymunk": "pymunk alone", "good": "accurate"}
table = pd.read_csv(f"{vl.__path__[0]}/docs/tables/stability-motion.csv").replace(names)
figure, panels = plt.subplots(1, 2, sharey=True, figsize=(5, 3.8))
for axes, (method, rows) in zip(panels, table.groupby("method"), strict=True):
    for k, (state, marker) in enumerate({"accurate": "o", "unstable": "^"}.items()):
        x, y = rows.loc[rows["state"] == state, ["value", "step"]].to_numpy().T * [[1], [1e3]]
        axes.loglog(x, y, marker, color=f"C{k}", mfc="none", label=state)
    axes.set(title=method, xlabel="ball speed, mph")
panels[0].set(ylabel="time step, ms")
figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", fontsize=9)
