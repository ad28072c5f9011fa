"""
A control chart
===============

Each day the laboratory fires its check ball at the wall, which slowly works loose. A cross marks a
day on which a rule of the chart is broken: long before a single day leaves the band of 3 σ.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

days = vl.daily(drift=0.0005, seed=1)
table, chart = days.table, days.charted
figure, axes = plt.subplots()
axes.plot(table["day"], table["standardised"], "o", color="C0", label="day")
axes.plot(table["day"], table["ewma"], color="C1", label="moving average")
alarms = table[table["alarms"].fillna("") != ""]
axes.plot(alarms["day"], alarms["standardised"], "x", color="black", label="an alarm")
axes.axhspan(-3, 3, color="0.93", zorder=0)
axes.set(xlabel="day", ylabel="e0 of the check ball, in σ")
axes.legend()
