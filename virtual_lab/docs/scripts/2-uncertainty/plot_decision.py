"""
Probability that a bat conforms
===============================

Probability that the true restitution e is below the limit (vertical line), for
three standard uncertainties u. A guard band accepts a bat only if it is
measured at least 1.64 u below the limit. Such a bat conforms with a
probability of at least 95 % (horizontal line).
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

measured = np.linspace(0.485, 0.515, 121)
figure, axes = plt.subplots()
for u in (0.0015, 0.003, 0.006):
    chance = [100 * vl.conformity(value, u, upper=0.5) for value in measured]
    axes.plot(measured, chance, label=f"u = {u}")
axes.axvline(0.5, color="black", linewidth=1, label="limit of BBCOR")
axes.axhline(95, color="0.5", linewidth=1, label="95 %")
axes.set_xlabel("measured restitution e")
axes.set_ylabel("probability that the bat conforms, %")
axes.legend()
