"""
A pendulum that swings wider than noted
=======================================

Each mark is one period of wood bat R161 as a pendulum. Circles follow the
theory. Squares do not: the operator released the bat at 20° and noted 4°, so
that the periods are 0.7 % too long.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

figure, axes = plt.subplots()
releases = (("20°, noted as 4°", "pendulum-wide", "s"), ("4°", (), "o"))
for angle, faults, marker in releases:
    test = vl.certify("r161", seed=7, faults=faults).certification
    record = test.session.records["bench"]["pendulum"]
    first = record.first_amplitude[:, None]
    decay = (record.last_amplitude[:, None] / first) ** 0.1
    amplitude = np.degrees(first * decay ** (np.arange(10) + 0.5))
    periods = 1e3 * np.diff(record.times, axis=1)
    label = f"released at {angle}"
    axes.plot(amplitude.ravel(), periods.ravel(), marker, label=label)
slow = np.mean(periods / (1 + np.radians(amplitude) ** 2 / 16))
x = np.array([3.8, 4.2])
axes.plot(x, slow * (1 + np.radians(x) ** 2 / 16), label="theory")
axes.set(xlabel="noted amplitude, °", ylabel="period, ms")
axes.legend(loc="center")
