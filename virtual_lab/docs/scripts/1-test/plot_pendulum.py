"""
A pendulum that swings wider than noted
=======================================

Periods of a bat that swings as a pendulum. Circles follow the theory for the noted amplitude.
Squares do not: the operator released the bat at a wider angle than noted.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

figure, axes = plt.subplots()
for label, faults, marker in (("wider than noted", "pendulum-wide", "s"), ("as noted", (), "o")):
    test = vl.certify("r161", seed=7, faults=faults).certification
    record = test.session.records["bench"]["pendulum"]
    first, last = record.first_amplitude[:, None], record.last_amplitude[:, None]
    amplitude = np.degrees(first * (last / first) ** ((np.arange(10) + 0.5) / 10))
    periods = 1e3 * np.diff(record.times, axis=1)
    axes.plot(amplitude.ravel(), periods.ravel(), marker, label=label)
slow = np.mean(periods / (1 + np.radians(amplitude) ** 2 / 16))
axes.plot([3.8, 4.2], [slow * (1 + np.radians(a) ** 2 / 16) for a in (3.8, 4.2)], label="theory")
axes.set(xlabel="noted amplitude, °", ylabel="period, ms")
axes.legend(loc="center right")
