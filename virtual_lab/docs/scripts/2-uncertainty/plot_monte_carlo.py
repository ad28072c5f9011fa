"""
Monte Carlo compared with first order
=====================================

Both ends of the 95 % interval of a speed, if the angle of the flight is 1.7° ± u. First order
follows the slope, which is small here. Monte Carlo includes the curvature.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

scatter = np.linspace(0.01, 0.07, 13)  # rad
methods = ("first-order", "first order", "C1--"), ("monte-carlo", "Monte Carlo", "C0-")
figure, axes = plt.subplots()
for method, label, line in methods:
    inputs = [{"angle": vl.Input(0.03, u)} for u in scatter]
    ends = [
        vl.propagate(lambda angle: 60 / np.cos(angle), each, method=method)["result"].interval
        for each in inputs
    ]
    axes.plot(np.degrees(scatter), ends, line, label=[label, "_"])
axes.set(xlabel="u of the angle, °", ylabel="ends of the 95 % interval, m/s")
axes.legend()
