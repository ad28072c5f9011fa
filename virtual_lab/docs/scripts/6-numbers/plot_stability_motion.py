"""
Where a physics engine is accurate
==================================

Rebound of a ball in the physics engine pymunk. It is accurate with our collision model. Alone, at
high speed, it is unstable (the ball passes the bat or gains energy) unless the steps are short.
"""

import matplotlib.pyplot as plt
import pandas as pd

import virtual_lab as vl

table = pd.read_csv(f"{vl.__path__[0]}/docs/tables/stability-motion.csv")
names = {"our pymunk model": "with our collision model", "plain pymunk": "pymunk alone"}
table = table.replace(names | {"good": "accurate"})
figure, panels = plt.subplots(1, 2, sharey=True, figsize=(5, 3.8))
for axes, (method, rows) in zip(panels, table.groupby("method"), strict=True):
    for k, (state, marker) in enumerate({"accurate": "o", "unstable": "^"}.items()):
        x, y = rows.loc[rows["state"] == state, ["value", "step"]].to_numpy().T
        axes.loglog(x, y, marker, color=f"C{k}", mfc="none", label=state)
    axes.set(title=method, xlabel="ball speed, mph")
panels[0].set(ylabel="time step, s")
figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", fontsize=9)
