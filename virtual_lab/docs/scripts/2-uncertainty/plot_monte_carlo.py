"""
Monte Carlo compared with first order
=====================================

Both ends of the 95 % interval of the speed (60 m/s) / cos(angle), if the angle
is 1.7° with standard uncertainty u (normal distribution). The speed is at
least 60 m/s, where the interval by Monte Carlo begins. First order uses only
the slope at 1.7°, and both its ends are too low.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

scatter = np.linspace(0.01, 0.07, 13)  # rad
methods = (
    ("first-order", "first order", "C1--"),
    ("monte-carlo", "Monte Carlo", "C0-"),
)
figure, axes = plt.subplots()
for method, label, line in methods:
    ends = []
    for u in scatter:
        angle = {"angle": vl.Input(0.03, u)}
        table = vl.propagate(
            lambda angle: 60 / np.cos(angle), angle, method=method
        )
        ends.append(table["result"].interval)
    axes.plot(np.degrees(scatter), ends, line, label=[label, "_"])
axes.set(xlabel="u of the angle, °", ylabel="ends of the 95 % interval, m/s")
axes.legend()
