"""
Sobol indices
=============

Which input explains the variance of a moment of inertia from a pendulum? The distance from the
pivot to the center of mass does. The bars of each pair are equal: the inputs do not interact.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl


def inertia(period, mass, distance, g):
    return period**2 * g * mass * distance / (4 * np.pi**2)


inputs = {"period": vl.Input(1.44, 3e-4), "mass": vl.Input(0.886, 3e-4)}
inputs |= {"distance": vl.Input(low=0.412, high=0.4132), "g": vl.Input(9.8065, 1e-3)}
table = vl.sobol(inertia, inputs, points=1024).set_index("input")[["first_order", "total_order"]]
figure, axes = plt.subplots()
(100 * table).plot.bar(ax=axes, rot=0, hatch="", color=["C0", "C5"], edgecolor="black")
axes.legend(["input alone", "with interactions"])
axes.set(xlabel="", ylabel="share of the variance, %")
