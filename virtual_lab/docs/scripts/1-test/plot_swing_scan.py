"""
A scan along the barrel
=======================

NCAA MODIFIED: a machine swings aluminum bat EA70 at 66 mph (6 in from the tip) at balls that arrive
at 70 mph, at one impact position after another. A cubic is fitted to the hits within an inch of the
best position. The top of the curve is the result.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

test = vl.certify("ea70", procedure="ncaa-modified", seed=7)
shots = test.shots.assign(mph=test.shots["metric_batted_speed_m_per_s"] / 0.44704)
figure, axes = plt.subplots()
for used, marker, label in ((False, "x", "other hits"), (True, "o", "hits of the fit")):
    rows = shots[shots["used"] == used]
    axes.plot(rows["impact_position_in"], rows["mph"], marker, label=label)
cubic = np.polynomial.Polynomial.fit(rows["impact_position_in"], rows["mph"], 3)
axes.plot(*cubic.linspace(), "k-", label="cubic fit")
axes.axhline(test.value, color="0.5", linestyle=":", label="result")
axes.set(xlabel="impact position from the tip, in", ylabel="batted-ball speed, mph")
axes.legend(loc="lower center")
