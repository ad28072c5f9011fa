"""
A control chart
===============

Restitution e0 of a check ball fired at a wall that slowly works loose. Days 1 to 25 set the mean
and σ. The rules raise an alarm on day 36, eight days before a single day leaves the band of 3 σ.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

days = vl.daily(drift=0.0005, seed=1)
table, chart = days.table, days.charted
figure, axes = plt.subplots()
axes.plot(table["day"], table["standardised"], "o", color="C0", label="one day")
axes.plot(table["day"], table["ewma"], color="C1", label="moving average")
alarms = table[table["alarms"].fillna("") != ""]
axes.plot(alarms["day"], alarms["standardised"], "x", color="black", label="day with an alarm")
axes.axhspan(-3, 3, color="0.93", zorder=0, label="± 3 σ")
axes.set(xlabel="day", ylabel="deviation of e0 from its mean, σ")
axes.legend()
