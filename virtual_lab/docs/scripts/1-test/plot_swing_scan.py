"""
A scan along the barrel
=======================

The swing machine swings a bat at a ball at one place after another. The procedure fits a curve to
the best hits, and its top is the result.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

test = vl.certify("ea70", procedure="ncaa-modified", seed=7)
shots = test.shots
figure, axes = plt.subplots()
for used, marker, label in ((True, "o", "in the result"), (False, "x", "other shots")):
    rows = shots[shots["used"] == used]
    axes.plot(rows["impact_position_in"], rows["metric_batted_speed_m_per_s"], marker, label=label)
axes.axhline(test.certification.metric.value, color="black", linewidth=1, label="result")
axes.set(xlabel="impact position from the tip, in", ylabel="batted-ball speed, m/s")
axes.legend()
