"""
A scan along the barrel
=======================

NCAA MODIFIED: a machine swings aluminum bat EA70 at 66 mph (6 in from the tip)
at balls that arrive at 70 mph, at one impact position after another. A cubic
is fitted to the hits within an inch of the best position. The top of the curve
is the result.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

test = vl.certify("ea70", procedure="ncaa-modified", seed=7)
figure, axes = plt.subplots()
kinds = ((False, "x", "other hits"), (True, "o", "hits of the fit"))
for used, marker, label in kinds:
    rows = test.shots[test.shots["used"] == used]
    z, mph = rows["impact_position_in"], rows["metric_batted_speed_m_per_s"]
    mph = mph / 0.44704
    axes.plot(z, mph, marker, label=label)
cubic = np.polynomial.Polynomial.fit(z, mph, 3)
axes.plot(*cubic.linspace(), "k-", label="cubic fit")
axes.axhline(test.value, color="0.5", linestyle=":", label="result")
axes.set_xlabel("impact position from the tip, in")
axes.set_ylabel("batted-ball speed, mph (1 mph = 0.447 m/s)")
axes.legend(loc="lower center")
