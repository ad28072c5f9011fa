"""
Monte Carlo beside first order
==============================

95 % interval of a speed whose flight is askew by an angle of unknown size, over the u of that
angle. First order follows the slope, which is small here; the draws see the curvature too.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

scatter = np.array([0.01, 0.03, 0.05, 0.07])  # rad
figure, axes = plt.subplots()
for method, line in (("first-order", "C1--"), ("monte-carlo", "C0-")):
    inputs = [{"angle": vl.Input(0.03, u)} for u in scatter]
    ends = [
        vl.propagate(lambda angle: 60 / np.cos(angle), each, method=method)["result"].interval
        for each in inputs
    ]
    axes.plot(np.degrees(scatter), ends, line, label=[method, "_"])
axes.set(xlabel="u of the angle, °", ylabel="95 % interval of the speed, m/s")
axes.legend()
