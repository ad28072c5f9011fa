"""
A control chart
===============

Restitution e0 of a check ball fired at a wall that slowly works loose. Days 1 to 25 set the mean
and σ. The rule "8 days on one side of the mean" raises the first alarm, on day 36. The weighted
average leaves its limits (dotted) on day 37, a single day leaves the band of 3 σ on day 44.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl
from virtual_lab.studies.control_charts import EWMA_LIMIT

days = vl.daily(drift=0.0005, seed=1)
table, chart = days.table, days.charted
figure, axes = plt.subplots()
axes.plot(table["day"], table["standardised"], "o", color="C0", label="one day")
axes.plot(table["day"], table["ewma"], color="C1", label="weighted moving average")
alarms = table[table["alarms"].fillna("") != ""]
axes.plot(alarms["day"], alarms["standardised"], "x", color="black", label="day with an alarm")
axes.hlines([-EWMA_LIMIT, EWMA_LIMIT], 26, 60, color="C1", linestyle=":")
axes.axhspan(-3, 3, color="0.93", zorder=0, label="± 3 σ")
axes.set(xlabel="day", ylabel="deviation of e0 from its mean, σ")
axes.legend()
