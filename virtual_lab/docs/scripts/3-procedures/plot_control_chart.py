"""
A control chart
===============

Restitution e0 of a check ball fired at a wall that slowly works loose, minus
the mean of days 1 to 25 (σ: their standard deviation). First alarm, day 36:
eight days are below the mean (day 33 is just below). The weighted average
(newest day: 20 %) leaves its limits on day 37, and a single day leaves ± 3 σ
on day 44.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl
from virtual_lab.studies.control_charts import EWMA_LIMIT

table = vl.daily(drift=0.0005, seed=1).table
figure, axes = plt.subplots()
axes.plot(table["day"], table["standardised"], "o", color="C0", label="one day")
alarms = table[table["alarms"].fillna("") != ""]
x, y = alarms["day"], alarms["standardised"]
axes.plot(x, y, "kx", label="day with an alarm")
axes.plot(table["day"], table["ewma"], color="C1", label="weighted average")
ends = [-EWMA_LIMIT, EWMA_LIMIT]
axes.hlines(ends, 26, 60, color="C1", linestyle=":", label="its limits")
axes.axhspan(-3, 3, color="0.93", zorder=0, label="± 3 σ")
axes.set(xlabel="day", ylabel="deviation of e0, σ", ylim=(-11, 3.5))
axes.legend(loc="lower left")
