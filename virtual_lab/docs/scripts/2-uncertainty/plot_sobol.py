"""
Sobol indices
=============

Which input explains the variance of a moment of inertia from a pendulum? The
distance from the pivot to the center of mass does. scipy computes the indices
of any model.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import norm, sobol_indices, uniform


def inertia(inputs):
    period, mass, distance, g = inputs
    return period**2 * g * mass * distance / (4 * np.pi**2)


inputs = {"period": norm(1.44, 3e-4), "mass": norm(0.886, 3e-4)}
inputs |= {"distance": uniform(0.412, 0.0012), "g": norm(9.8065, 1e-3)}
laws = list(inputs.values())
found = sobol_indices(func=inertia, n=1024, dists=laws, rng=0)
figure, axes = plt.subplots()
axes.bar(list(inputs), 100 * np.ravel(found.first_order))
axes.set(ylabel="share of the variance, %")
